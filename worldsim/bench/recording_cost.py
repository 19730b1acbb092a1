"""The cost of a recording, for a large fleet whose vehicles all move at every tick."""

from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time

import numpy as np

from agent.messages import MEMBER, SUB_VERTEX, VERTEX
from worldsim.bench.fleets import EIGHT_IN_RANGE_M, wedge
from worldsim.judge.run_events import SlotChanged
from worldsim.judge.tick import HierarchyRows, Tick
from worldsim.judge.verdict import Figures
from worldsim.recording.recorder import RunRecorder
from worldsim.scenario.tables import Scenario

DURATION_S = 20
LATTICE_M = 1.75
"""Spacing of the slots on a cubic lattice."""
SWAY_M = 0.5
"""Amplitude of the vehicles about their slots."""
QUEUES = 4
UNSETTLED = 5
"""One agent in this many changes its slot and tier each second, as while a fleet gathers."""
ROLES = (VERTEX, SUB_VERTEX, MEMBER)


def recording_us(agents: int) -> float:
    """Return the CPU time for recording one tick, over all threads [us]."""
    return _recorded(agents)[0]


def recording_mb(agents: int) -> float:
    """Return the size of a recording of one minute [MB]."""
    return _recorded(agents)[1]


def _recorded(agents: int) -> tuple[float, float]:
    scenario = wedge(agents, DURATION_S, EIGHT_IN_RANGE_M)
    rows = list(_flight(scenario))
    with TemporaryDirectory() as folder:
        path = Path(folder) / "run.rrd"
        recorder = RunRecorder(path, scenario, "bench", mode="virtual")
        started_s = process_time()
        for tick, figures in rows:
            recorder.event(SlotChanged(t_s=tick.time_s, agent=0, place=(0, 1), before=None))
            recorder.tick(tick, figures)
        recorder.close()
        spent_s = process_time() - started_s
        return 1e6 * spent_s / len(rows), path.stat().st_size * 60 / DURATION_S / 1e6


def _flight(scenario: Scenario) -> Iterator[tuple[Tick, Figures]]:
    """Yield ticks of agents that sway about fixed slots and hear about eight others.

    All other values change at every tick and are no round numbers, so they compress badly.
    """
    agents, tick_hz = scenario.fleet.agents, scenario.fleet.tick_hz
    generator = np.random.default_rng(scenario.seed)
    side = round(agents ** (1.0 / 3.0) + 0.49)
    lattice = LATTICE_M * np.stack(np.unravel_index(np.arange(agents), (side,) * 3), axis=1)
    phase = generator.uniform(0.0, 2.0 * np.pi, (agents, 3))
    for index in range(round(DURATION_S * tick_hz)):
        time_s = index / tick_hz
        position = lattice + SWAY_M * np.sin(time_s + phase)
        error = generator.uniform(0.0, 2.0, (4, agents))
        changed = index // round(tick_hz)
        tick = Tick(
            index=index,
            time_s=time_s,
            position=position,
            attitude=np.outer(time_s + phase[:, 0], (1.0, 0.0, 0.0)).astype(np.float32),
            target=lattice.astype(np.float32),
            place=_places(agents, changed),
            force=error[2].astype(np.float32),
            turn_deg=error[3],
            alive=np.ones(agents, dtype=np.bool_),
            links=_links(position),
            mission=np.zeros(agents, dtype=np.int64),
            packets={"sent": agents * index, "delivered": 8 * agents * index},
            hierarchy=_hierarchy_rows(agents, changed),
        )
        figures = Figures(
            separation=error[0],
            slot_error=error[1],
            converged=False,
            queue_residual=error[0, :QUEUES],
        )
        yield tick, figures


def _links(position: np.ndarray) -> np.ndarray:
    away = np.linalg.norm(position[:, None] - position[None, :], axis=2)
    return np.argwhere((away < EIGHT_IN_RANGE_M) & (away > 0.0)).astype(np.int32)


def _places(agents: int, shift: int) -> np.ndarray:
    number = (np.arange(agents) + _moves(agents, shift)) % agents
    return np.stack((number % QUEUES, number // QUEUES), axis=1).astype(np.int16)


def _hierarchy_rows(agents: int, shift: int) -> HierarchyRows:
    number = np.arange(agents)
    tier = ((number + _moves(agents, shift)) % 7).astype(np.int16)
    role = np.array(ROLES, dtype=np.int8)[np.minimum(tier, len(ROLES) - 1)]
    parent = np.where(number < QUEUES, -1, number - QUEUES).astype(np.int32)
    return HierarchyRows(
        tier=tier,
        parent=parent,
        role=role,
        record_age_s=np.linspace(0.1, 0.9, agents, dtype=np.float32),
    )


def _moves(agents: int, shift: int) -> np.ndarray:
    return np.where(np.arange(agents) % UNSETTLED == 0, shift, 0)
