"""The world: it owns the truth, conducts time, judges, records, and launches fleets."""

import sys
from importlib.machinery import PathFinder
from importlib.util import module_from_spec
from pathlib import Path


def _prefer_own_packages() -> None:
    """Import the packages beside this one, whatever a user's folders on PYTHONPATH hold.

    A user may well have a module agent.py.
    """
    root = str(Path(__file__).resolve().parents[1])
    for name in ("netem", "agent"):
        spec = PathFinder.find_spec(name, [root])
        if name not in sys.modules and spec is not None and spec.loader is not None:
            sys.modules[name] = module_from_spec(spec)
            spec.loader.exec_module(sys.modules[name])


_prefer_own_packages()
