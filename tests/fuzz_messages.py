"""Malformed and mutated messages into every decoder and into the core, as many as asked for.

``python -m tests.fuzz_messages --count 10000000``: nothing may be raised but a refusal, and what an
agent says afterwards is finite. The suite flies a small share of it.
"""

import argparse
import time
from collections import Counter
from collections.abc import Callable
from math import isfinite
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

import msgspec

from agent.codec import (
    add_checksum,
    decode_beacon,
    decode_command,
    decode_gossip,
    decode_observation,
    encode,
    strip_checksum,
)
from agent.core import Agent, Outbox
from agent.messages import Beacon, Gossip, Observation
from agent.rejection import RejectedError
from netem.fault_queue import FaultQueue
from netem.messages import SlotInput, SlotResult, Truth, unpack_slot_input, unpack_slot_result
from netem.saboteur import garbage
from netem.wire.frame import (
    Batch,
    Delivery,
    Frame,
    Inbox,
    Outgoing,
    Transmission,
    WireError,
    pack,
    unpack_batch,
    unpack_delivery,
    unpack_inbox,
    unpack_transmission,
)
from netem.wire.latency import LatencyHistogram, unpack_report
from tests.random_flights.lies import Lies, liars_senses
from worldsim.engine.virtual import VirtualFleet
from worldsim.fleet.control import RequestError, _request
from worldsim.scenario.file import load

WEDGE = Path(__file__).parents[1] / "deploy/scenarios/wedge-9.toml"
WARM_SLOTS, WARM_S = 200, 2.5
LIES = 100
TICKS = 20
STEP_EVERY = 500
SABOTAGE_FROM = 0.95
"""The rest of the radio's messages is what a saboteur calls garbage."""
REFUSALS = (RejectedError, WireError, RequestError)
ORDERS = b'{"slot":3,"orders":[{"type":"jam","number":1,"jam":{"centre_m":[0,0,0],"radius_m":2}}]}'
REQUEST = b'{"event":{"kill":[2,"vertex:V1"],"for_s":3.0},"to":1,"version":4}'


class Target(NamedTuple):
    """Something that takes bytes, and whole messages to begin with."""

    name: str
    take: Callable[[bytes], Any]
    whole: list[bytes]
    checksum: bool = False


class Fuzz:
    """A flying agent, and everything that decodes, under mutated messages."""

    def __init__(self, seed: int) -> None:
        self.counts: Counter[str] = Counter()
        self._random = Random(seed)
        fleet = VirtualFleet(load(WEDGE))
        for _ in range(WARM_SLOTS):
            fleet.slot()
        opened = fleet.loop.open()
        self._observation = opened.observations[0][1]
        self._core: Agent = fleet._agents[opened.observations[0][0]]
        self._targets = _targets(fleet, opened.observations, opened.positions, self._core)

    def run(self, count: int) -> None:
        """Throw ``count`` messages."""
        for number in range(count):
            target = self._targets[number % len(self._targets)]
            self._throw(target, self._mutated(target))
            if number % STEP_EVERY == 0:
                self._step()

    def _throw(self, target: Target, data: bytes) -> None:
        try:
            target.take(data)
        except REFUSALS:
            self.counts["refused"] += 1
        else:
            self.counts["taken"] += 1

    def _step(self) -> None:
        outbox = self._core.step(self._observation)
        said = [msgspec.to_builtins(outbox.command)]
        said += [msgspec.to_builtins(_radio(channel)(data)) for channel, data in outbox.frames]
        assert all(isfinite(number) for number in _numbers(said)), outbox
        later = self._observation.slot + 4
        self._observation = msgspec.structs.replace(
            self._observation, slot=later, time_s=later / 80.0
        )

    def _mutated(self, target: Target) -> bytes:
        random = self._random
        kind = random.random()
        if target.checksum and kind > SABOTAGE_FROM:
            return garbage(random.choice(target.whole), random)
        if kind < 0.1:
            return random.randbytes(random.randrange(0, 120))
        data = bytearray(random.choice(target.whole))
        if target.checksum:
            data = bytearray(strip_checksum(bytes(data)))
        for _ in range(random.randrange(1, 5)):
            data[random.randrange(len(data))] = random.randrange(256)
        if kind < 0.2:
            del data[random.randrange(len(data)) :]
        elif kind < 0.3:
            data += random.choice(target.whole)
        whole = bytes(data)
        return add_checksum(whole) if target.checksum and kind < 0.9 else whole


def _targets(
    fleet: VirtualFleet,
    observations: list[tuple[int, Observation]],
    positions: tuple[Any, ...],
    core: Agent,
) -> list[Target]:
    outboxes = _said(fleet, observations)
    frames = [frame for outbox in outboxes for frame in outbox.frames]
    beacons, gossips = ([data for channel, data in frames if channel == c] for c in (0, 1))
    lies = _lies([decode_beacon(data) for data in beacons[:LIES]])
    sent = Transmission(3, 0, tuple(Outgoing(*frame) for frame in frames))
    heard = tuple(Frame(1, 0, c, 5, data) for c, data in frames)
    batch = pack(Batch(3, heard))
    tally = LatencyHistogram(0.0125)
    tally.add(heard, tuple(range(len(heard))), 0)
    slot_input = SlotInput(
        truth=Truth(slot=3, time_s=0.0375, positions=positions),
        participants=(3, 7),
        observations=(b"observation", b""),
        incarnations=(0,) * len(positions),
    )
    slot_result = SlotResult(slot=3, pages=((1, b"page"),), counters=fleet.medium_counters)
    return [
        Target("observation", decode_observation, [encode(each) for _, each in observations]),
        Target("command", decode_command, [encode(outbox.command) for outbox in outboxes]),
        Target(
            "beacon",
            lambda data: core.receive(3, 0, data, WARM_S),
            beacons + lies[0],
            checksum=True,
        ),
        Target(
            "gossip",
            lambda data: core.receive(3, 1, data, WARM_S),
            gossips + lies[1],
            checksum=True,
        ),
        Target("transmission", unpack_transmission, [pack(sent)]),
        Target("batch", unpack_batch, [batch]),
        Target("delivery", unpack_delivery, [pack(Delivery(3, heard, tuple(range(len(heard)))))]),
        Target("arrivals", unpack_report, [pack(tally.report(0))]),
        Target("inbox", unpack_inbox, [pack(Inbox(3, b"observation", (batch,)))]),
        Target("slot input", unpack_slot_input, [pack(slot_input)]),
        Target("slot result", unpack_slot_result, [pack(slot_result)]),
        Target("orders", lambda data: FaultQueue().put(data), [ORDERS]),
        Target("request", _request, [REQUEST]),
    ]


def _said(fleet: VirtualFleet, observations: list[tuple[int, Observation]]) -> list[Outbox]:
    """Return what all agents say in a second: each channel has its own rate."""
    outboxes = []
    for tick in range(TICKS):
        for agent, seen in observations:
            slot = seen.slot + 4 * tick
            later = msgspec.structs.replace(seen, slot=slot, time_s=slot / 80.0)
            outboxes.append(fleet._agents[agent].step(later))
    return outboxes


def _lies(beacons: list[Beacon]) -> tuple[list[bytes], list[bytes]]:
    """Return beacons and gossip that say anything of the Q-structure."""
    lies, first = Lies(3), {beacon.id: beacon for beacon in reversed(beacons)}
    senses = liars_senses(3, [each for each in first.values() if each.id != 3], WARM_S)
    false = [msgspec.structs.replace(each, standing=lies.standing(senses)) for each in beacons]
    told = [Gossip(3, WARM_S, (), None, lies.summary(senses)) for _ in beacons]
    return [add_checksum(encode(each)) for each in false], [
        add_checksum(encode(each)) for each in told
    ]


def _radio(channel: int) -> Callable[[bytes], msgspec.Struct]:
    return decode_gossip if channel else decode_beacon


def _numbers(value: Any) -> list[float]:
    if isinstance(value, float):
        return [value]
    if isinstance(value, list | tuple):
        return [number for inner in value for number in _numbers(inner)]
    return []


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    fuzz, begun = Fuzz(options.seed), time.perf_counter()
    fuzz.run(options.count)
    print(f"{options.count} messages, {dict(fuzz.counts)}, {time.perf_counter() - begun:.0f} s")


if __name__ == "__main__":
    main()
