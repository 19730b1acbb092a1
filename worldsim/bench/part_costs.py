"""CPU time of single parts: a control step, and a frame in the medium."""

from collections.abc import Callable
from time import process_time

import msgspec

from agent.controller import Flown, Heard, Peer, Senses
from agent.guidance.q_structure import QStructure
from agent.messages import Place, Vector
from agent.qstructure.formation import Formation
from agent.qstructure.target_frame import Frame
from netem.link_parameters import Conditions
from netem.medium import Medium
from netem.wire.channels import LOCAL
from netem.wire.frame import Outgoing, Transmission
from worldsim.bench.fleets import EIGHT_IN_RANGE_M, wedge

PAYLOAD_B = 280
"""About the size of a beacon with eight echoes."""
NEIGHBOURS = 8
OBSTACLES: tuple[Vector, ...] = ((1.2, 0.3, 0.0), (-0.9, 1.1, 0.2), (0.4, -1.5, 0.4), (1.6, 1.0, 0))
"""Relative positions of points of obstacles [m; world axes]."""
LATTICE_M = 1.2
"""Spacing of the vehicles on a cubic lattice."""
FRAMES = 400
"""Frames that are measured, at least three for each sender."""


def per_call_us(call: Callable[[int], object], count: int) -> float:
    """Return the mean CPU time of ``count`` calls [us]; the argument is the call's number."""
    started_s = process_time()
    for number in range(count):
        call(number)
    return 1e6 * (process_time() - started_s) / count


def control_step_us(count: int = 4000) -> float:
    """Return the CPU time of one decision with 8 neighbours and 4 obstacles [us]."""
    scenario = wedge(NEIGHBOURS + 1, 1.0)
    formation = Formation(scenario.formation, scenario.control.spacing_m)
    controller = QStructure(scenario.agent_setup(0, 0, 1))
    places = formation.layout(NEIGHBOURS + 1).places
    slots = [_slot(formation, place) for place in places]
    team = tuple(Peer(i, slots[i], place, 1.0) for i, place in enumerate(places))
    heard = tuple(
        Heard(i, 0.05, slots[i], (0.1, 0.0, 0.0), slots[i], places[i]) for i in range(1, len(team))
    )
    flown = Flown(0, formation, Frame())

    def step(number: int) -> None:
        at = (slots[0][0] + 1.0 + 1e-5 * number, 0.2, 0.1)
        controller.decide(
            Senses(
                now_s=0.05 * number,
                position=at,
                velocity=(0.2, 0.0, 0.0),
                yaw=3.0,
                vehicles=((-1.0, 0.4, 0.3), (0.9, -0.7, 0.2)),
                neighbours=heard,
                team=lambda: team,
                mission=flown,
                obstacles=OBSTACLES,
            )
        )

    per_call_us(step, count // 10)
    return per_call_us(step, count)


def frame_us(agents: int, link: Conditions = Conditions()) -> float:  # noqa: B008
    """Return the CPU time of one frame, sent and collected, with about 8 receivers [us]."""
    setup = wedge(agents, 1.0, EIGHT_IN_RANGE_M).medium_setup()
    side = round(agents ** (1.0 / 3.0) + 0.49)
    positions = tuple(
        (LATTICE_M * (i % side), LATTICE_M * (i // side % side), LATTICE_M * (i // side**2))
        for i in range(agents)
    )
    conditions = msgspec.structs.replace(link, range_m=1.5 * LATTICE_M)
    medium = Medium(msgspec.structs.replace(setup, conditions=conditions))
    transmission = Transmission(0, 0, (Outgoing(LOCAL, bytes(PAYLOAD_B)),))

    def tick(number: int) -> None:
        time_s = 0.05 * number
        medium.place(positions)
        for source in range(agents):
            medium.transmit(source, time_s, transmission)
        for receiver in range(agents):
            medium.collect(receiver, time_s)
        medium.digest()

    return per_call_us(tick, max(3, FRAMES // agents)) / agents


def _slot(formation: Formation, place: Place) -> Vector:
    slot = formation.slot(place, NEIGHBOURS + 1)
    return slot.point if slot is not None else (0.0, 0.0, 0.0)
