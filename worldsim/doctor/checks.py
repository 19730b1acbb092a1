"""What is there on this host: cores, clock, compiler, compiled code, Zenoh, viewer, extras."""

import os
import shutil
import statistics
import time
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

from netem.compiled import FOLDER, PURE, REMEDY, ROOT, UNTOLD, UnfitError, fitting
from worldsim.bench.circumstances import code_form, cpu_model, modules
from worldsim.recording.viewer import ViewerError, viewer_program
from worldsim.report.film import MP4, film_suffix
from worldsim.results.provenance import provenance, version_text

CLOCK_SOURCE = Path("/sys/devices/system/clocksource/clocksource0/current_clocksource")
MEMORY = Path("/proc/meminfo")
SLEEPS, SLEEP_S = 40, 0.005
LATE_S = 0.01
"""A host that wakes later than this at times loses ticks at 20 Hz."""
EXTRAS = {"cluster": "distributed", "export": "mcap"}
"""The package of each optional extra, beside that for films."""


class Check(NamedTuple):
    """One line about the host."""

    name: str
    says: str
    hint: str = ""  # what helps; "" where nothing is missing


def checks() -> Iterator[Check]:
    """Yield what is there, one after another."""
    known = provenance()
    host, packages = known["host"], known["packages"]
    yield Check("qswarm", version_text(known).removeprefix("qswarm "))
    yield Check("host", f"{host['os']} {host['kernel']}, {host['machine']}, {_memory()}")
    load = os.getloadavg()[0]
    yield Check(
        "cores", f"{host['cpus']} usable, {cpu_model() or 'of unknown kind'}; load {load:.1f}"
    )
    yield clock_check(_lateness_s())
    yield Check("Python", known["python"])
    yield compiled_check()
    yield Check("Zenoh", f"{packages.get('eclipse-zenoh') or 'not installed'}")
    yield _viewer()
    films = film_suffix() == MP4
    yield Check("film", "mp4" if films else "gif", "" if films else "pip install 'qswarm[video]'")
    for extra, package in EXTRAS.items():
        there = find_spec(package) is not None
        hint = "" if there else f"pip install 'qswarm[{extra}]'"
        yield Check(f"extra {extra}", "installed" if there else "not installed", hint)


def clock_check(late_s: list[float]) -> Check:
    """Return what sleeps of 5 ms say of the clock. late_s: how late each ended [s]."""
    source = _text(CLOCK_SOURCE) or "unknown source"
    resolution = time.get_clock_info("monotonic").resolution
    median_ms, worst_ms = 1e3 * statistics.median(late_s), 1e3 * max(late_s)
    says = (
        f"{source}, {resolution * 1e9:g} ns; wakes {median_ms:.1f} ms late, {worst_ms:.1f} at worst"
    )
    busy = max(late_s) > LATE_S
    return Check("clock", says, "the host is busy: expect late ticks" if busy else "")


def compiled_check() -> Check:
    """Return whether compiled code runs, and why not."""
    UNTOLD.clear()  # it is told here
    form = code_form(modules())
    compiler = shutil.which(os.environ.get("CC") or "cc")
    says = f"{form}; {'a C compiler is there' if compiler else 'no C compiler'}"
    if form.startswith("compiled"):
        return Check("code", says)
    return Check("code", says, _why_pure() or "deploy/compile.sh makes it several times faster")


def _why_pure() -> str:
    try:
        there = bool(fitting(ROOT, FOLDER))
    except UnfitError as error:
        return f"{error}; {REMEDY}"
    return f"{PURE}=1 asks for pure Python" if there else ""


def _viewer() -> Check:
    try:
        viewer_program(window=False)
        viewer_program(window=True)
    except ViewerError as error:
        return Check("viewer", "not in a window", str(error))
    return Check("viewer", "in a window, or in a browser with --web")


def _lateness_s() -> list[float]:
    late = []
    for _ in range(SLEEPS):
        due_s = time.monotonic() + SLEEP_S
        time.sleep(SLEEP_S)
        late.append(time.monotonic() - due_s)
    return late


def _memory() -> str:
    for line in _text(MEMORY).splitlines():
        if line.startswith("MemAvailable:"):
            return f"{int(line.split()[1]) / 1024**2:.1f} GB of memory free"
    return "unknown memory"


def _text(file: Path) -> str:
    try:
        return file.read_text(encoding="ascii").strip()
    except OSError:
        return ""
