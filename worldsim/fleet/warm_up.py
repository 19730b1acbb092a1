"""Runs the code of an agent before agents are forked, so that they share what its first steps make.

A first step fills caches, and the interpreter adapts the code that it runs. An agent that does this
by itself does it on memory pages of its own, and when all agents start.
"""

from math import sin

import msgspec

from agent.codec import decode_observation, encode
from agent.core import Agent, Outbox
from agent.messages import Command, Observation
from agent.process import checked_setup
from agent.qstructure.formation import FormationSpec, QueueSpec
from agent.qstructure.shape import Ray
from netem.wire.channels import Channel
from netem.wire.frame import (
    Batch,
    Frame,
    Inbox,
    Outgoing,
    Transmission,
    pack,
    unpack_batch,
    unpack_inbox,
)
from worldsim.scenario.tables import SLOTS_PER_TICK, Fleet, Scenario

AGENTS = 3
STEPS = 12
"""The interpreter adapts what has run eight times."""
TICK_S = 0.05
QUEUES = tuple(
    QueueSpec(name, ("V1",), Ray((-1.0, side, 0.0))) for name, side in (("Q1", 1.0), ("Q2", -1.0))
)
FORMATION = FormationSpec("warm-up", {"V1": (0.0, 0.0, 0.0)}, QUEUES)


def warm_up() -> list[Command]:
    """Fly a few agents of the built-in controller for some steps; return their last commands."""
    scenario = Scenario(
        name="warm-up", fleet=Fleet(agents=AGENTS), formation=FORMATION, duration_s=1.0
    )
    setups = [msgspec.json.encode(scenario.agent_setup(agent, 0, 1)) for agent in range(AGENTS)]
    agents = [Agent(checked_setup(setup)) for setup in setups]
    outboxes: list[Outbox] = []
    for step in range(STEPS):
        frames = [
            Frame(source, 0, channel, step, data)
            for source, outbox in enumerate(outboxes)
            for channel, data in outbox.frames
        ]
        batch = pack(Batch(SLOTS_PER_TICK * step, tuple(frames)))
        outboxes = [_step(agent, step, batch) for agent in agents]
    return [outbox.command for outbox in outboxes]


def _step(agent: Agent, step: int, batch: bytes) -> Outbox:
    """Step as an agent's shell does, with all messages encoded and decoded."""
    data = pack(Inbox(SLOTS_PER_TICK * step, encode(_observation(agent.id, step)), (batch,)))
    inbox = unpack_inbox(data)
    observation = decode_observation(inbox.observation)
    for each in inbox.batches:
        for frame in unpack_batch(each).frames:
            if frame.source != agent.id:
                agent.receive(frame.source, frame.channel, frame.payload, observation.time_s)
    outbox = agent.step(observation)
    encode(outbox.command)
    pack(Transmission(observation.slot, 0, _outgoing(outbox.frames)))
    return outbox


def _outgoing(frames: tuple[tuple[Channel, bytes], ...]) -> tuple[Outgoing, ...]:
    return tuple([Outgoing(channel, payload) for channel, payload in frames])


def _observation(agent: int, step: int) -> Observation:
    """Return what an agent senses in a row of agents one metre apart, which sways a little."""
    time_s = TICK_S * step
    return Observation(
        slot=SLOTS_PER_TICK * step,
        time_s=time_s,
        position=(1.0 * agent, 0.3 * sin(time_s), 0.0),
        velocity=(0.0, 0.3, 0.0),
        yaw=0.0,
        vehicles=((1.0, 0.0, 0.0),) if agent < AGENTS - 1 else ((-1.0, 0.0, 0.0),),
        obstacles=(),
        orders=(),
        scans=(),
    )
