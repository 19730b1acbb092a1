"""The timeline in flight: missions, losses, joins, partitions; for a few seeds each."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from random import Random

import numpy as np
import pytest

from agent.messages import Believed, Observation
from worldsim.engine.virtual import Flight, fly
from worldsim.judge.run_events import RunEvent
from worldsim.judge.tick import Tick
from worldsim.judge.verdict import Figures
from worldsim.scenario.file import load
from worldsim.scenario.tables import Scenario

WEDGE = Path(__file__).parents[2] / "deploy" / "scenarios" / "wedge-9.toml"
HORIZONTAL = "'../formations/three-horizontal-lines.toml'"
VERTICAL = "'../formations/three-vertical-lines.toml'"
BAD = {"netem.loss_percent": "50", "netem.delay_ms": "200"}
WORST = {"netem.loss_percent": "80", "netem.delay_ms": "500"}
SEEDS = range(2)


class TickList:
    """Records every tick."""

    records_ticks = True

    def __init__(self) -> None:
        self.ticks: list[Tick] = []

    def tick(self, tick: Tick, figures: Figures) -> None:
        self.ticks.append(tick)

    def observe(self, observations: Sequence[tuple[int, Observation]]) -> None:
        """What agents observe is not looked at."""

    def believe(self, agent: int, slot: int, believed: Believed) -> None:
        """What agents believe is not looked at."""

    def event(self, event: RunEvent) -> None:
        """The loop keeps the events itself."""


def scenario(seed: int, duration_s: float, *events: str, **overrides: str) -> Scenario:
    timeline = f"[{', '.join(f'{{ {event} }}' for event in events)}]"
    flown_s = str(duration_s)
    return load(WEDGE, {"seed": str(seed), "duration_s": flown_s, "event": timeline, **overrides})


def flown(seed: int, duration_s: float, *events: str, **overrides: str) -> Flight:
    flight = fly(scenario(seed, duration_s, *events, **overrides))
    check_safety(flight)
    return flight


def check_safety(flight: Flight) -> None:
    """Check that no vehicles collided and that every packet is accounted for."""
    found = flight.loop.judge.invariants()
    for name in ("I1", "I8"):
        assert found[name].ticks == flight.loop.judge.ticks
        assert found[name].violations == 0


def violated(flight: Flight) -> list[str]:
    found = flight.loop.judge.invariants()
    assert {"I2", "I3", "I4", "I6", "I7"} <= set(found)
    return [name for name, tally in found.items() if tally.violations]


def kinds(flight: Flight, *wanted: str) -> list[tuple[float, str, int | None]]:
    events = flight.loop.events
    return [(e.t_s, e.kind, e.agent) for e in events if e.kind in wanted]


def reformed_s(flight: Flight) -> list[float]:
    times_s = [recovery.reformed_s for recovery in flight.loop.judge.recoveries]
    assert None not in times_s
    return [each for each in times_s if each is not None]


@pytest.mark.parametrize("seed", SEEDS)
def test_six_agents_switch_between_three_formations(seed: int) -> None:
    flight = flown(
        seed,
        60,
        f"at_s = 20, formation = {HORIZONTAL}",
        f"at_s = 40, formation = {VERTICAL}",
        **{"fleet.agents": "6"},
    )
    phases = flight.loop.judge.phases
    assert [(phase.formation.name, phase.from_s) for phase in phases] == [
        ("pyramidal-wedge", 0.0),
        ("three-horizontal-lines", 20.0),
        ("three-vertical-lines", 40.0),
    ]
    assert all(phase.converge_s is not None and phase.converge_s <= 8.0 for phase in phases)
    assert all(phase.residual_m is not None and phase.residual_m < 0.01 for phase in phases)
    assert violated(flight) == []


@pytest.mark.parametrize("seed", SEEDS)
def test_the_team_follows_a_frame_that_turns_by_90_degrees(seed: int) -> None:
    flight = flown(seed, 32, "at_s = 15, frame = { yaw_deg = 90, waypoints_m = [[1, 0, 0.5]] }")
    before, after = flight.loop.judge.phases
    assert before.formation.name == after.formation.name
    assert after.converge_s is not None
    assert after.converge_s <= 10.0
    apex = flight.loop.world.vehicles.position - np.array([1.0, 0.0, 0.5])
    assert np.min(np.linalg.norm(apex, axis=1)) < 0.01
    assert violated(flight) == []


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(("radio", "duration_s"), [({}, 36), (BAD, 60)], ids=["clean", "half lost"])
def test_another_agent_takes_the_apex_when_its_agent_leaves(
    seed: int, radio: dict[str, str], duration_s: float
) -> None:
    """Without loss I7 is evaluated again 10 s after the leave, and at half lost 41 s after it."""
    flight = flown(seed, duration_s, "at_s = 15, leave = ['vertex:V1']", **radio)
    ((t_s, _, gone),) = kinds(flight, "leave")
    assert t_s == 15.0
    assert max(reformed_s(flight)) <= 10.0
    assert violated(flight) == []
    assert np.isnan(flight.loop.world.vehicles.position[gone]).all()
    # Without delay nothing is on its way to one who has just been handed its batch.
    assert flight.medium_counters.fates["dropped_medium"] > 0 or not radio


@pytest.mark.parametrize("seed", SEEDS)
def test_the_apex_agent_leaves_under_80_percent_loss(seed: int) -> None:
    flight = flown(seed, 50, "at_s = 15, leave = ['vertex:V1']", **WORST)
    assert max(reformed_s(flight)) <= 25.0
    assert flight.loop.judge.invariants()["I6"].violations == 0


@pytest.mark.parametrize("seed", SEEDS)
def test_the_apex_agent_dies_and_its_vehicle_hovers_in_its_slot(seed: int) -> None:
    flight = flown(seed, 36, "at_s = 15, kill = ['vertex:V1']")
    ((_, _, dead),) = kinds(flight, "kill")
    assert dead is not None
    assert np.linalg.norm(flight.loop.world.vehicles.position[dead]) < 0.12
    assert max(reformed_s(flight)) <= 15.0
    assert violated(flight) == []


@pytest.mark.parametrize("seed", SEEDS)
def test_a_team_grows_and_shrinks(seed: int) -> None:
    flight = flown(seed, 60, "at_s = 15, join = 3", "at_s = 40, leave = ['random:4']")
    assert [agent for _, _, agent in kinds(flight, "join")] == [9, 10, 11]
    assert [len(each.agents) for each in flight.loop.judge.recoveries] == [3, 4]
    assert None not in [each.reformed_s for each in flight.loop.judge.recoveries]
    assert violated(flight) == []


@pytest.mark.parametrize(("seed", "loss"), [(0, "0"), (1, "20")])
def test_both_sides_of_a_partition_form_a_complete_formation(seed: int, loss: str) -> None:
    """Each side has its own vertex agents; vehicles of the other side block slots (E18).

    I7 is evaluated again at most 22 s after the heal.
    """
    apart = Random(seed).sample(range(9), 3 + seed)
    events = [f"at_s = 15, for_s = 60, partition = [{apart}]"]
    flight = flown(seed, 115, *events, **{"netem.loss_percent": loss})
    roles = Counter(agent for t_s, _, agent in kinds(flight, "role") if t_s > 15.0)
    assert max(roles.values(), default=0) <= 3
    assert violated(flight) == []
    assert flight.loop.judge.phases[0].residual_m == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize("loss", ["0", "20"])
def test_a_partition_splits_the_team_and_a_heal_merges_it(loss: str) -> None:
    events = ["at_s = 15, for_s = 20, partition = [[0, 1, 2, 3]]"]
    flight = flown(1, 60, *events, **{"netem.loss_percent": loss})
    assert kinds(flight, "partition", "heal") == [(15.0, "partition", None), (35.0, "heal", None)]
    assert flight.medium_counters.fates["dropped_partition"] > 5000
    heard = {agent: flight.loop.world.latest[agent].telemetry.heard for agent in range(9)}  # type: ignore[union-attr]
    assert any(other >= 4 for agent in range(4) for other in heard[agent])


def test_conditions_change_for_a_while() -> None:
    flight = flown(1, 20, "at_s = 5, for_s = 5, netem = { loss_percent = 100 }")
    lost = flight.medium_counters.fates["dropped_loss"]
    sent_a_second = flight.medium_counters.addressed / 20.0
    assert 0.9 * 5.0 * sent_a_second < lost < 1.1 * 5.0 * sent_a_second
    assert len(kinds(flight, "netem")) == 2


def test_a_row_is_empty_before_its_join_and_the_vehicle_hovers_until_the_first_step() -> None:
    recorder = TickList()
    fly(scenario(1, 12, "at_s = 5, join = 1", "at_s = 9, leave = [9]"), recorder)
    there = {tick.time_s: not np.isnan(tick.position[9, 0]) for tick in recorder.ticks}
    alive = {tick.time_s: bool(tick.alive[9]) for tick in recorder.ticks}
    assert [t_s for t_s in there if there[t_s]] == [t_s for t_s in there if 5.0 <= t_s < 9.0]
    assert [t_s for t_s in alive if alive[t_s]] == [t_s for t_s in alive if 6.0 <= t_s < 9.0]
    still = [tick.position[9] for tick in recorder.ticks if 5.0 <= tick.time_s <= 6.0]
    assert np.ptp(still, axis=0).max() == 0.0


def test_dead_agents_restart_with_a_higher_incarnation() -> None:
    flight = flown(1, 30, "at_s = 15, for_s = 3, kill = ['all']")
    assert [t_s for t_s, _, _ in kinds(flight, "kill")] == [15.0] * 9
    assert [t_s for t_s, _, _ in kinds(flight, "restart")] == [18.0] * 9
    assert {command.incarnation for command in flight.loop.world.latest if command} == {1}


def test_a_mission_survives_the_loss_of_the_agents_that_got_it() -> None:
    flight = flown(
        1,
        30,
        f"at_s = 15, formation = {HORIZONTAL}",
        "at_s = 15, kill = [0]",
        "at_s = 15, leave = [1]",
    )
    living = [flight.loop.world.latest[agent] for agent in range(2, 9)]
    assert {command.telemetry.mission for command in living if command} == {65536}


def test_the_same_seed_has_the_same_faults_and_the_same_trace() -> None:
    events = (
        "at_s = 3, kill = ['random:2']",
        "at_s = 4, join = 2",
        "at_s = 5, leave = ['random:1']",
    )
    first, again, other = (
        fly(scenario(seed, 9, *events, **{"netem.loss_percent": "20"})) for seed in (3, 3, 4)
    )
    assert first.loop.trace.sha256 == again.loop.trace.sha256
    assert first.loop.events == again.loop.events
    assert first.loop.trace.sha256 != other.loop.trace.sha256
    changes = [kinds(flight, "kill", "join", "leave") for flight in (first, other)]
    assert len(changes[0]) == 5
    assert changes[0] != changes[1]


@pytest.mark.parametrize("seed", SEEDS)
def test_the_paused_apex_agent_hovers_and_rejoins_the_team(seed: int) -> None:
    flight = flown(seed, 45, "at_s = 12, pause = ['vertex:V1'], for_s = 15")
    (paused,) = kinds(flight, "pause")
    assert kinds(flight, "resume") == [(27.0, "resume", paused[2])]
    assert all(time_s <= 10.0 for time_s in reformed_s(flight))
    assert violated(flight) == []


def test_a_pause_of_100_ms_changes_no_place_and_no_role() -> None:
    flight = flown(0, 25, "at_s = 12, pause = ['vertex:V1', 2], for_s = 0.1")
    assert kinds(flight, "slot", "role") == [
        each for each in kinds(flight, "slot", "role") if each[0] < 12.0
    ]
    assert violated(flight) == []
