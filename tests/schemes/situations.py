"""A wedge's agents and what they sense, for laws of the schemes."""

from pathlib import Path

from agent.config import AgentSetup, Comms, Control, Vehicle
from agent.controller import Flown, Heard, Peer, Senses
from agent.heard_beacon import HeardStanding
from agent.qstructure.formation import formation_of
from agent.qstructure.target_frame import Frame
from worldsim.scenario.file import load
from worldsim.scenario.library import SCENARIOS

SPACING_M = 1.0
TABLES = load(SCENARIOS / "wedge-9.toml").formation
WEDGE = formation_of(TABLES, SPACING_M)
LINES = formation_of(load(Path(SCENARIOS / "horizontal-lines-12.toml")).formation, SPACING_M)


def setup(own, team=9):
    return AgentSetup(
        id=own,
        incarnation=0,
        tick_hz=20.0,
        slots_per_tick=4,
        command_ticks=1,
        vehicle=Vehicle(),
        fleet_max_speed_mps=0.5,
        control=Control(),
        comms=Comms(),
        formation=TABLES,
        team=team,
    )


def heard(own, position, place=None, velocity=(0.0, 0.0, 0.0), target=None, standing=None):
    said = HeardStanding(standing) if standing is not None else None
    return Heard(own, 0.05, position, velocity, target or position, place, standing=said)


def senses(
    position, neighbours=(), now_s=0.0, yaw=0.0, *, frame=None, formation=WEDGE, summaries=()
):
    return Senses(
        now_s=now_s,
        position=position,
        velocity=(0.0, 0.0, 0.0),
        yaw=yaw,
        vehicles=(),
        neighbours=tuple(neighbours),
        team=lambda: tuple(Peer(each.id, each.position, each.place) for each in neighbours),
        mission=Flown(0, formation, frame or Frame()),
        summaries=summaries,
    )
