"""What figures were measured with: machine, versions, commit, and the form of the code."""

import importlib.util
import pkgutil
import re
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path

import agent
import netem
import worldsim
from worldsim.results.provenance import Host, Provenance, provenance

CPU_INFO = Path("/proc/cpuinfo")
PACKAGES = (netem, agent, worldsim)
PURE = "pure Python"

_MODEL = re.compile(r"^(?:model name|Hardware|CPU part)\s*:\s*(.+)$", re.MULTILINE)


class BenchHost(Host):
    """The kind of machine, with its processor."""

    cpu: str | None


class Circumstances(Provenance):
    """Provenance of figures of speed."""

    code: str  # PURE, or how much of it is compiled


def circumstances() -> Circumstances:
    """Return what this process measures with."""
    known = provenance()
    host: BenchHost = {**known["host"], "cpu": cpu_model()}
    return {**known, "host": host, "code": code_form(modules())}


def cpu_model(file: Path = CPU_INFO) -> str | None:
    """Return the name of the processor; None where the kernel tells none."""
    try:
        found = _MODEL.search(file.read_text(encoding="utf-8", errors="replace"))
    except OSError:
        return None
    return found[1].strip() if found else None


def modules() -> dict[str, str]:
    """Return the file from which each of qswarm's modules is, or would be, loaded."""
    found = {}
    for package in PACKAGES:
        for info in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            spec = importlib.util.find_spec(info.name)
            if spec is not None and spec.origin is not None:
                found[info.name] = spec.origin
    return found


def code_form(files: dict[str, str]) -> str:
    """Return in words whether compiled code runs, from the files of all modules."""
    compiled = [name for name, file in files.items() if file.endswith(tuple(EXTENSION_SUFFIXES))]
    if not compiled:
        return PURE
    return f"compiled ({len(compiled)} of {len(files)} modules)"
