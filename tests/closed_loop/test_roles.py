"""Roles and tiers in a line, and slots that a dead agent's vehicle blocks."""

from pathlib import Path

import numpy as np
import pytest

from agent.messages import DISTRESS, MEMBER, SUB_VERTEX, VERTEX
from worldsim.engine.virtual import VirtualFleet
from worldsim.scenario.file import load, parse

WEDGE = Path(__file__).parents[2] / "deploy" / "scenarios" / "wedge-9.toml"
LINE = """
duration_s = 60
[fleet]
agents = {agents}
start = {{ kind = "list", positions_m = {positions} }}
[netem]
range_m = {range_m}
[formation]
name = "line"
vertices = {{ V1 = [0, 0, 0] }}
[[formation.queue]]
name = "Q1"
vertices = ["V1"]
shape = {{ kind = "ray", direction = [-1, 0, 0] }}
"""


def line(xs, range_m, **overrides):
    positions = [[-float(x), 0.0, 0.0] for x in xs]
    text = LINE.format(agents=len(positions), positions=positions, range_m=range_m)
    return VirtualFleet(parse(text, overrides=overrides))


def telemetry_of(fleet):
    return [command.telemetry for command in fleet.loop.world.latest]


def fly(fleet, seconds):
    for _ in range(round(seconds * 80)):
        fleet.slot()


def test_remark_5_a_line_with_a_radio_range_of_one_spacing():
    fleet = line(range(8), 1.0 + 1e-6)
    fly(fleet, 5.0)
    settled = [(each.tier, each.parent, each.role) for each in telemetry_of(fleet)]
    assert [tier for tier, _, _ in settled] == list(range(8))
    assert [parent for _, parent, _ in settled] == list(range(-1, 7))
    assert [role for _, _, role in settled] == [VERTEX, *[SUB_VERTEX] * 6, MEMBER]
    flips = 0
    for _ in range(30 * 20):
        fly(fleet, 0.05)
        now = [(each.tier, each.parent, each.role) for each in telemetry_of(fleet)]
        flips += now != settled
    assert flips == 0


def test_who_sees_a_member_but_does_not_hear_it_takes_no_place_from_the_team():
    """Two metres of sight and 1.2 m of radio: members see others that they do not hear.

    What it reports as taken is held by members that the leader hears, and stays in the shares.
    """
    fleet = VirtualFleet(load(WEDGE, {"seed": "4", "netem.range_m": "1.2", "duration_s": "12"}))
    fly(fleet, 12.0)
    places = sorted(tuple(each.place) for each in telemetry_of(fleet))
    assert places == [(0, 0), *[(queue, rank) for queue in range(4) for rank in (1, 2)]]
    assert fleet.loop.judge.min_separation_m >= 0.25


def test_fig_4_five_agents_on_one_queue():
    """r2 and r3 hear r1, r3 hears r4, r4 hears r5: r3 and r4 are sub-vertices of tiers 1 and 2.

    They hardly move: a parent that leaves the range would be replaced.
    """
    fleet = line((0.0, 0.9, 1.8, 3.2, 4.6), 1.9, **{"vehicle.max_speed_mps": "0.01"})
    fly(fleet, 1.5)
    assert [(each.tier, each.parent, each.role) for each in telemetry_of(fleet)] == [
        (0, -1, VERTEX),
        (1, 0, MEMBER),
        (1, 0, SUB_VERTEX),
        (2, 2, SUB_VERTEX),
        (3, 3, MEMBER),
    ]


def test_an_agent_that_hears_no_other_flies_to_the_vertex():
    fleet = line((0.0, 1.0, 30.0), 2.5)
    fly(fleet, 0.3)
    assert [each.role for each in telemetry_of(fleet)] == [DISTRESS] * 3, (
        "an agent takes a role before it has listened"
    )
    fly(fleet, 1.2)
    assert [each.role for each in telemetry_of(fleet)] == [VERTEX, MEMBER, DISTRESS], (
        "an agent that hears nobody does not wait for late beacons"
    )
    fly(fleet, 0.8)
    assert [each.role for each in telemetry_of(fleet)] == [VERTEX, MEMBER, VERTEX]
    assert telemetry_of(fleet)[2].target == (0.0, 0.0, 0.0), (
        "the third agent does not lead a vertex alone"
    )


def root_of(telemetry, agent):
    """Return whom an agent's parents lead to; -1 if they lead nowhere."""
    for _ in telemetry:
        if telemetry[agent].tier <= 0:
            return agent if telemetry[agent].tier == 0 else -1
        agent = telemetry[agent].parent
    return -1


def wedge_without(place, seed, **overrides):
    """Fly the wedge; at 10 s the agent in a place dies. Return the fleet and the other agents."""
    fleet = VirtualFleet(load(WEDGE, {"seed": str(seed), "duration_s": "35", **overrides}))
    fly(fleet, 10.0)
    dead = [tuple(each.place) for each in telemetry_of(fleet)].index(place)
    fleet.loop.effects.record_exit(dead, signal=9, status=None)
    fly(fleet, 25.0)
    living = [agent for agent in range(9) if agent != dead]
    return fleet, living


@pytest.mark.parametrize("lossy", [False, True])
@pytest.mark.parametrize("seed", range(2))
def test_the_team_fills_the_slots_around_a_dead_apex_agent(seed, lossy):
    radio = {"netem.loss_percent": "50", "netem.delay_ms": "200"} if lossy else {}
    fleet, living = wedge_without((0, 0), seed, **radio)
    telemetry = telemetry_of(fleet)
    places = sorted(tuple(telemetry[agent].place) for agent in living)
    assert places == [(queue, rank) for queue in range(4) for rank in (1, 2)]
    (head,) = [agent for agent in living if telemetry[agent].role == VERTEX]
    assert telemetry[head].place[1] == 1, (
        "the leader is not in the first slot behind the shared vertex"
    )
    assert {root_of(telemetry, agent) for agent in living} == {head}
    assert fleet.loop.judge.min_separation_m >= 0.25
    assert max(fleet.loop.figures.slot_error[living]) < 0.01
    changes = [event.t_s for event in fleet.loop.events if event.kind == "slot"]
    assert max(changes) <= 25.0, "quiet within 15 s"


@pytest.mark.parametrize("place", [(1, 1), (2, 2)])
def test_the_team_skips_the_slot_of_a_dead_member(place):
    fleet, living = wedge_without(place, 1)
    places = [tuple(telemetry_of(fleet)[agent].place) for agent in living]
    assert place not in places
    assert len(set(places)) == 8
    assert fleet.loop.judge.min_separation_m >= 0.25
    assert np.max(fleet.loop.figures.slot_error[living]) < 0.01


def with_losses(seed, agents, killed, spacing_m=1.0, lasts_s=40.0):
    """Fly a wedge of which some agents die at 15 s."""
    event = f"[{{ at_s = 15.0, kill = ['{killed}'] }}]"
    given = {"fleet.agents": str(agents), "event": event, "duration_s": str(lasts_s)}
    given |= {"control.spacing_m": str(spacing_m), "netem.range_m": "12"}
    fleet = VirtualFleet(load(WEDGE, {"seed": str(seed), **given}))
    fly(fleet, lasts_s)
    return fleet


def check_at_rest(fleet, since_s):
    """Check that no agent has changed its place for long, and that all stand in their slots."""
    assert max(event.t_s for event in fleet.loop.events if event.kind == "slot") < since_s
    assert np.nanmax(fleet.loop.figures.slot_error[fleet.loop.members.alive]) < 0.01
    tallies = fleet.loop.judge.invariants()
    assert [name for name, tally in tallies.items() if tally.violations] == []


@pytest.mark.parametrize("seed", range(3))
def test_the_last_survivor_takes_the_slot_behind_the_dead_vertex_agent(seed):
    fleet = with_losses(seed, 2, "vertex:V1")
    (survivor,) = np.flatnonzero(fleet.loop.members.alive)
    assert telemetry_of(fleet)[survivor].place[1] == 1
    check_at_rest(fleet, since_s=20.0)


@pytest.mark.parametrize("seed", [3, 4, 7, 9])
def test_three_survivors_come_to_rest_among_nine_dead(seed):
    """Their slots are out of sight of some dead vehicles, which must not be forgotten."""
    check_at_rest(with_losses(seed, 12, "random:9"), since_s=26.0)


def test_a_dead_vertex_agent_that_no_slot_is_in_sight_of_is_not_forgotten():
    check_at_rest(with_losses(1, 5, "vertex:V1", spacing_m=2.5), since_s=30.0)


def test_agents_look_after_a_dead_vehicle_that_no_slot_is_in_sight_of_ever_less_often():
    """Two looks in 225 s: 60 s after the vehicle was seen last, and 120 s after that."""
    lasts_s = 240.0
    fleet = with_losses(1, 2, "vertex:V1", spacing_m=2.5, lasts_s=lasts_s)
    changes_s = [event.t_s for event in fleet.loop.events if event.kind == "slot"]
    assert len([time_s for time_s in changes_s if time_s > 30.0]) == 4, "there and back, twice"
    check_at_rest(fleet, since_s=lasts_s - 5.0)
