"""Runs to record: a fleet that flies straight from random starts to its slots."""

from collections.abc import Iterator

import numpy as np

from agent.qstructure.formation import Formation, FormationSpec, QueueSpec
from agent.qstructure.shape import Ray
from worldsim.judge.finding import Expectation
from worldsim.judge.tick import Tick
from worldsim.judge.verdict import Figures, Judge
from worldsim.recording.recorder import RunRecorder
from worldsim.scenario.tables import Expectations, Fleet, Scenario

EDGES = ((-1, -1, -1), (-1, -1, 1), (-1, 1, -1), (-1, 1, 1))
SPEED_MPS = 0.5


def wedge(agents: int, duration_s: float = 8.0) -> Scenario:
    """Return the scenario of a pyramidal wedge."""
    queues = tuple(
        QueueSpec(name=f"Q{index}", vertices=("V1",), shape=Ray(direction=edge))
        for index, edge in enumerate(EDGES)
    )
    formation = FormationSpec(name="wedge", vertices={"V1": (0.0, 0.0, 0.0)}, queue=queues)
    return Scenario(
        fleet=Fleet(agents=agents),
        formation=formation,
        name="straight",
        duration_s=duration_s,
        expect=Expectations(min_separation_m=0.0),
    )


def straight_flight(scenario: Scenario) -> Iterator[Tick]:
    """Yield the ticks of a fleet that has its slots from the start and flies straight there."""
    agents, tick_hz = scenario.fleet.agents, scenario.fleet.tick_hz
    formation = Formation(scenario.formation, scenario.control.spacing_m)
    filled = formation.layout(agents)
    places = filled.places
    slots = np.array([filled.slots[place].point for place in places])
    generator = np.random.default_rng(scenario.seed)
    position = slots + generator.uniform(-1.5, 1.5, (agents, 3))
    pairs = [(a, b) for a in range(agents) for b in range(agents) if a != b]
    for index in range(round(scenario.duration_s * tick_hz) + 1):
        away = slots - position
        force = np.linalg.norm(away, axis=1)
        yield Tick(
            index=index,
            time_s=index / tick_hz,
            position=position,
            attitude=_level(np.arctan2(away[:, 1], away[:, 0])),
            target=slots.astype(np.float32),
            place=np.array(places, dtype=np.int16),
            force=force.astype(np.float32),
            turn_deg=generator.uniform(-60, 60, agents),
            alive=np.ones(agents, dtype=np.bool_),
            links=np.array(pairs, dtype=np.int32).reshape(-1, 2),
            mission=np.zeros(agents, dtype=np.int64),
            packets=_packets(index),
        )
        step = np.minimum(1.0, SPEED_MPS / tick_hz / np.maximum(force, 1e-9))
        position = position + step[:, None] * away


def _packets(index: int) -> dict[str, int]:
    """Each tick sends one frame to eight others; of those that do not arrive, a third is lost."""
    delivered, lost = 7 * index, index // 3
    fates = {"delivered": delivered, "dropped_loss": lost, "in_flight": index - lost}
    return {"sent": index, "addressed": 8 * index, **fates}


def _level(yaw: np.ndarray) -> np.ndarray:
    return np.column_stack((yaw, np.zeros((len(yaw), 2)))).astype(np.float32)


def record(recorder: RunRecorder, scenario: Scenario, ticks: list[Tick]) -> Judge:
    """Judge and record ticks as a run does, and close the recording; return the judge."""
    judge = Judge(scenario)
    for tick in ticks:
        figures: Figures = judge.see(tick)
        recorder.tick(tick, figures)
    recorder.close()
    return judge


def verdict_parts(judge: Judge) -> tuple[object, ...]:
    """Return everything that a verdict consists of."""
    phases = [(phase.converge_s, phase.residual_m) for phase in judge.phases]
    rows: list[Expectation] = judge.expectations()
    return (
        judge.ticks,
        judge.min_separation_m,
        judge.turns_over_limit_fraction,
        judge.invariants(),
        phases,
        rows,
    )
