"""The run folder: summary.json, events.jsonl, logs, the verdict in words, and a run's tables."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from worldsim.results.run import Run, open

__all__ = ["Run", "open"]


def __getattr__(name: str) -> Any:
    """Return ``open`` or ``Run``, which are quickest not imported: they read recordings."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from worldsim.results import run  # noqa: PLC0415 - few that import this package read runs

    return getattr(run, name)
