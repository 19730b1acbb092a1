"""Fleets of real processes: late ticks, CPU time by part, start and memory.

Each fleet is flown by `qswarm run` in a process of its own, on loopback and for a bounded time, and
its figures are those of its summary. A fleet that does not converge has no figures.
"""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import msgspec

from netem.link_parameters import Conditions
from worldsim.bench.fleets import wedge
from worldsim.bench.measures import InvalidFigureError, Measure
from worldsim.results.exit_status import INTERRUPTED
from worldsim.results.provenance import ROOT
from worldsim.scenario.file import dump
from worldsim.scenario.tables import Scenario

Summary = dict[str, Any]
Fly = Callable[[Scenario, bool], Summary]
"""Flies a scenario with processes, in lockstep or not; raises InvalidFigureError."""
Figure = Callable[[Summary], Any]
"""Reads a figure from a summary; None: this host cannot measure it."""

QSWARM = """
import signal
from worldsim.fleet.fork import request_death_signal
request_death_signal({parent}, signal.SIGTERM)
from worldsim.commands.app import main
main()
"""
"""The program that flies a fleet; it ends in order when this process dies."""
RANGE_M = 3.0
LOSS_PERCENT = 10.0
SECONDS = {10: 20.0, 20: 20.0, 25: 20.0, 50: 30.0, 100: 60.0}
"""How long a wedge of so many agents flies: its queues grow with it [s; simulated time]."""
SIZES = (10, 25, 50, 100)
LOCKSTEP_SIZE = 20
START_WITHIN_S = 60.0
SLOWEST = 5.0
"""A fleet that takes so many times as long as it should is ended."""
END_WITHIN_S = 30.0


class ProcessFleets:
    """Flies each fleet once. seconds: how long all of them fly; None: as in SECONDS."""

    def __init__(self, seconds: float | None, fly: Fly | None = None) -> None:
        self._seconds = seconds
        self._fly = fly if fly is not None else flown
        self._summaries: dict[tuple[int, bool], Summary | InvalidFigureError] = {}

    def figure(self, agents: int, lockstep: bool, figure: Figure) -> float:
        """Return a figure of a fleet. Raises InvalidFigureError."""
        found = self._summaries.get((agents, lockstep))
        if found is None:
            found = self._summaries[agents, lockstep] = self._summary(agents, lockstep)
        if isinstance(found, InvalidFigureError):
            raise found
        value = figure(found)
        if value is None:
            raise InvalidFigureError("not measured on this host")
        return float(value)

    def _summary(self, agents: int, lockstep: bool) -> Summary | InvalidFigureError:
        scenario = process_wedge(agents, self._seconds or SECONDS[agents])
        try:
            summary = self._fly(scenario, lockstep)
        except InvalidFigureError as error:
            return error
        problem = unsound(summary, scenario.duration_s)
        return summary if problem is None else InvalidFigureError(problem)


def process_wedge(agents: int, duration_s: float) -> Scenario:
    """Return a wedge at the density of all benchmarks, with a short and lossy radio."""
    radio = Conditions(range_m=RANGE_M, loss_percent=LOSS_PERCENT)
    scenario: Scenario = msgspec.structs.replace(wedge(agents, duration_s), netem=radio)
    return scenario


def unsound(summary: Summary, duration_s: float) -> str | None:
    """Return why a run proves nothing of its fleet's cost; None: it does."""
    if summary["duration_s"] < duration_s - 1e-6:
        return f"ended early: {summary['reason']}"
    if not all(phase["converged"] for phase in summary["phases"]):
        late = summary["late_tick_fraction"]
        with_late = f", {100 * late:.1f} % of ticks late" if late else ""
        return f"not converged within {duration_s:g} s{with_late}"
    if summary["outcome"] == "fail":
        return f"failed: {summary['reason']}"
    return None


class Column(NamedTuple):
    """One figure of every fleet."""

    name: str
    unit: str
    goal: float | None
    figure: Figure
    more: bool = False
    grain: float = 0.0

    def of(self, fleets: ProcessFleets, agents: int, lockstep: bool) -> Measure:
        """Return the row of one fleet."""

        def measured() -> float:
            return fleets.figure(agents, lockstep, self.figure)

        name = f"{'lockstep' if lockstep else 'processes'}, N = {agents}: {self.name}"
        return Measure(name, self.unit, self.goal, self.more, measured, self.grain)


def _speed(goal: float) -> Column:
    return Column("speed", "x real time", goal, lambda s: s["real_time_factor"], more=True)


def _cpu_us(part: str) -> Figure:
    return lambda summary: summary["resources"]["cpu_us_per_agent_step"][part]


def _all_us(summary: Summary) -> float:
    return float(sum(summary["resources"]["cpu_us_per_agent_step"].values()))


STEP = "us/agent-step"
LATE = Column("late ticks", "%", 1.0, lambda s: 100.0 * s["late_tick_fraction"], grain=0.5)
COSTS = tuple(
    Column(f"CPU, {part}", STEP, None, _cpu_us(part)) for part in ("agents", "netem", "world")
)
ALL = Column("CPU, all", STEP, 700.0, _all_us)
START = (
    Column("start", "s", 2.0, lambda s: s["resources"]["start_up_s"]),
    Column("memory of an agent", "MB", 5.0, lambda s: s["resources"]["agent_private_mb"]),
)
CONVERGED = Column("converged after", "s", None, lambda s: s["phases"][0]["converge_s"])


def measures(seconds: float | None = None, fly: Fly | None = None) -> tuple[Measure, ...]:
    """Return the rows of fleets of processes."""
    fleets = ProcessFleets(seconds, fly)
    return (*_free_running(fleets), *_lockstep(fleets))


def _free_running(fleets: ProcessFleets) -> Iterator[Measure]:
    for agents in SIZES:
        for row in (LATE, _speed(0.99), *COSTS, ALL, *START, CONVERGED):
            yield row.of(fleets, agents, lockstep=False)
    least, most = SIZES[0], SIZES[-1]

    def growth() -> float:
        of_most = fleets.figure(most, False, _all_us)
        return of_most / fleets.figure(least, False, _all_us)

    yield Measure(f"processes: CPU, all, N = {most} against {least}", "x", 1.3, False, growth)


def _lockstep(fleets: ProcessFleets) -> Iterator[Measure]:
    for row in (_speed(5.0), *COSTS, ALL._replace(goal=None), CONVERGED):
        yield row.of(fleets, LOCKSTEP_SIZE, lockstep=True)


def flown(scenario: Scenario, lockstep: bool) -> Summary:
    """Fly a scenario by `qswarm run`; return its summary. No process is left, however it ends.

    Raises InvalidFigureError where there is no summary, KeyboardInterrupt where it is interrupted.
    """
    with TemporaryDirectory(prefix="qswarm-bench-") as folder:
        file, run, output = (Path(folder) / name for name in ("bench.toml", "run", "output"))
        file.write_text(dump(scenario), encoding="utf-8")
        arguments = ["run", str(file), "--out", str(run), "--no-recording"]
        status = _called([*arguments, "--lockstep"] if lockstep else arguments, output, scenario)
        if status == INTERRUPTED:
            raise KeyboardInterrupt
        try:
            summary: Summary = json.loads((run / "summary.json").read_text("utf-8"))
        except FileNotFoundError:
            last = output.read_text("utf-8", "replace").strip().rpartition("\n")[2]
            raise InvalidFigureError(f"no summary, exit status {status}: {last}") from None
        return summary


def _called(arguments: list[str], output: Path, scenario: Scenario) -> int:
    """Call `qswarm`, of the same code as this process; return its exit status."""
    program = QSWARM.format(parent=os.getpid())
    path = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH"))))
    with output.open("wb") as file:
        process = subprocess.Popen(
            [sys.executable, "-c", program, *arguments],
            stdin=subprocess.DEVNULL,
            stdout=file,
            stderr=subprocess.STDOUT,
            cwd=output.parent,
            env={**os.environ, "PYTHONPATH": path},
        )
    try:
        return process.wait(START_WITHIN_S + SLOWEST * scenario.duration_s)
    except subprocess.TimeoutExpired:
        process.send_signal(signal.SIGTERM)
        return process.wait(END_WITHIN_S)
    finally:
        _end(process)


def _end(process: "subprocess.Popen[bytes]") -> None:
    """End a launcher that still runs; it ends its fleet, and a fleet ends with its launcher."""
    if process.poll() is not None:
        return
    process.terminate()
    try:
        process.wait(END_WITHIN_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
