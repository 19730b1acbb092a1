"""Fleets of processes in the benchmark: flown once each, and only sound runs give figures."""

from typing import Any

import pytest

from worldsim.bench import process_costs
from worldsim.bench.measures import InvalidFigureError, Measure, measured_row
from worldsim.bench.process_costs import SIZES, flown, measures, process_wedge, unsound
from worldsim.scenario.tables import Scenario

SOUND: dict[str, Any] = {
    "duration_s": 20.0,
    "outcome": "pass",
    "reason": None,
    "phases": [{"converged": True, "converge_s": 4.7}],
    "late_tick_fraction": 0.002,
    "real_time_factor": 0.998,
    "resources": {
        "start_up_s": 0.3,
        "cpu_us_per_agent_step": {"agents": 400.0, "netem": 200.0, "world": 60.0},
        "agent_private_mb": 4.0,
    },
}
UNCONVERGED = [{"converged": False, "converge_s": None}]


class Flights:
    """Flies in no time; the summary of a fleet is SOUND with the changes for its size."""

    def __init__(self, changes: dict[int, dict[str, Any]] | None = None) -> None:
        self.flown: list[tuple[int, float, bool]] = []
        self._changes = changes or {}

    def __call__(self, scenario: Scenario, lockstep: bool) -> dict[str, Any]:
        agents = scenario.fleet.agents
        self.flown.append((agents, scenario.duration_s, lockstep))
        if agents in self._changes and not self._changes[agents]:
            raise InvalidFigureError("no summary, exit status 2: no room")
        return {**SOUND, "duration_s": scenario.duration_s, **self._changes.get(agents, {})}


def found(flights: Flights, seconds: float | None = None) -> dict[str, Any]:
    rows = [measured_row(measure, 3) for measure in measures(seconds, flights)]
    return {row.name: row.measured if row.invalid is None else row.invalid for row in rows}


def test_every_fleet_is_flown_once_for_all_of_its_rows() -> None:
    flights = Flights()
    figures = found(flights)
    assert [(agents, lockstep) for agents, _, lockstep in flights.flown] == [
        *((agents, False) for agents in SIZES),
        (20, True),
    ]
    assert figures["processes, N = 10: late ticks"] == pytest.approx(0.2)
    assert figures["processes, N = 10: CPU, all"] == pytest.approx(660.0)
    assert figures["processes, N = 25: CPU, netem"] == 200.0
    assert figures["processes, N = 50: start"] == 0.3
    assert figures["processes, N = 100: memory of an agent"] == 4.0
    assert figures["processes: CPU, all, N = 100 against 10"] == pytest.approx(1.0)
    assert figures["lockstep, N = 20: speed"] == 0.998
    assert figures["lockstep, N = 20: converged after"] == 4.7


def test_all_fleets_fly_as_long_as_asked() -> None:
    flights = Flights()
    found(flights, 7.0)
    assert {duration_s for _, duration_s, _ in flights.flown} == {7.0}


def test_an_unconverged_fleet_has_no_figures_and_the_others_have() -> None:
    flights = Flights({25: {"phases": UNCONVERGED, "late_tick_fraction": 0.25, "outcome": "fail"}})
    figures = found(flights)
    of_25 = {value for name, value in figures.items() if "N = 25:" in name}
    assert of_25 == {"not converged within 20 s, 25.0 % of ticks late"}
    assert figures["processes, N = 10: CPU, all"] == pytest.approx(660.0)
    assert len(flights.flown) == len(SIZES) + 1


def test_growth_needs_both_fleets() -> None:
    figures = found(Flights({100: {}}))
    assert figures["processes: CPU, all, N = 100 against 10"].startswith("no summary, ")
    assert figures["processes, N = 100: late ticks"] == "no summary, exit status 2: no room"


def test_what_the_host_cannot_measure_is_said() -> None:
    resources = {**SOUND["resources"], "agent_private_mb": None}
    figures = found(Flights({10: {"resources": resources}}))
    assert figures["processes, N = 10: memory of an agent"] == "not measured on this host"
    assert figures["processes, N = 10: start"] == 0.3


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({}, None),
        ({"outcome": "inconclusive", "late_tick_fraction": 0.2}, None),
        ({"phases": UNCONVERGED}, "not converged within 20 s, 0.2 % of ticks late"),
        ({"phases": UNCONVERGED, "late_tick_fraction": None}, "not converged within 20 s"),
        ({"duration_s": 3.0, "reason": "netem ended"}, "ended early: netem ended"),
        ({"outcome": "fail", "reason": "violated: I1"}, "failed: violated: I1"),
    ],
)
def test_only_a_whole_flight_that_converged_is_sound(
    changes: dict[str, Any], reason: str | None
) -> None:
    assert unsound({**SOUND, **changes}, 20.0) == reason


def test_the_wedge_has_one_density_and_a_lossy_radio() -> None:
    for agents in SIZES:
        scenario = process_wedge(agents, 5.0)
        x, y, z = scenario.fleet.start.size_m
        assert agents / (x * y * z) == pytest.approx(9 / 75, rel=0.06)
        assert (scenario.netem.range_m, scenario.netem.loss_percent) == (3.0, 10.0)


def test_names_are_unique() -> None:
    names = [measure.name for measure in measures()]
    assert len(set(names)) == len(names)
    assert all(isinstance(measure, Measure) for measure in measures())


WRITES = """
import json, pathlib, sys
assert sys.argv[1] == "run" and sys.argv[4].endswith("run"), sys.argv
run = pathlib.Path(sys.argv[4])
run.mkdir()
arguments = [each for each in sys.argv if each.startswith("--")]
(run / "summary.json").write_text(json.dumps(dict(arguments=arguments)))
sys.exit(3)
"""


def call(monkeypatch: pytest.MonkeyPatch, program: str, lockstep: bool = False) -> dict[str, Any]:
    """Fly with a program in the place of qswarm."""
    monkeypatch.setattr(process_costs, "QSWARM", program)
    return flown(process_wedge(10, 1.0), lockstep)


@pytest.mark.parametrize("lockstep", [False, True])
def test_the_figures_are_those_of_the_summary(
    monkeypatch: pytest.MonkeyPatch, lockstep: bool
) -> None:
    arguments = call(monkeypatch, WRITES, lockstep)["arguments"]
    assert arguments == ["--out", "--no-recording", *(["--lockstep"] if lockstep else [])]


def test_a_run_without_a_summary_is_quoted(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InvalidFigureError, match=r"^no summary, exit status 2: no room$"):
        call(monkeypatch, "import sys; print('starting'); print('no room'); sys.exit(2)")


def test_an_interrupted_run_interrupts_the_benchmark(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(KeyboardInterrupt):
        call(monkeypatch, "import sys; sys.exit(130)")


def test_a_run_that_does_not_end_is_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(process_costs, "START_WITHIN_S", 0.1)
    monkeypatch.setattr(process_costs, "SLOWEST", 0.0)
    with pytest.raises(InvalidFigureError, match="exit status -15"):
        call(monkeypatch, "import time; time.sleep(60.0)")
