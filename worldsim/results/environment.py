"""The environment of a command, cleared of what is meant for other programs."""

import os
import resource
from pathlib import Path


def prepare_environment() -> None:
    """Ignore settings that would change or disable a library, and allow all descriptors.

    RERUN=off would leave a recording empty, and a notebook's MPLBACKEND cannot draw a file.
    """
    for name in [name for name in os.environ if name.lstrip("_").startswith("RERUN")]:
        del os.environ[name]
    os.environ["MPLBACKEND"] = "agg"
    _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))


def descriptors_problem(needed: int) -> str | None:
    """Return what is wrong where this process may not open so many files; None: nothing."""
    allowed, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    if allowed == resource.RLIM_INFINITY or allowed >= needed:
        return None
    return f"needs {needed} file descriptors, and only {allowed} are allowed (ulimit -n)"


def folder_is_gone() -> bool:
    """Return whether the current folder was removed."""
    try:
        Path.cwd()
    except FileNotFoundError:
        return True
    return False
