"""One agent, whole: it hears, believes or doubts, decides, commands and speaks.

A pure state machine: time comes with the observation. The shells around it (a process on Zenoh,
the virtual clock) only carry bytes.
"""

from collections import Counter
from collections.abc import Callable
from math import inf
from typing import NamedTuple

from agent.codec import RejectedError, decode_beacon, decode_gossip
from agent.comms.broadcast import LOCAL, Broadcast, OwnState
from agent.comms.gossip import Table
from agent.comms.neighbours import Neighbours
from agent.controller import Intent, Peer, Senses
from agent.guidance.cone import cone_of
from agent.guidance.safety import PromiseFilter, RangingFilter, Told, limited, shortened
from agent.messages import Beacon, Command, Gossip, Observation, Place, Telemetry, Vector
from agent.pilot import Pilot
from agent.setup import AgentSetup

TIDY_S = 0.2
"""How often those who fell silent are looked for."""
MAX_TOLD = 256
"""So many neighbours are told of at most: a longer array makes a command that is refused."""


class Outbox(NamedTuple):
    """What an agent says at the end of a step: to its vehicle, and (channel, payload) to all."""

    command: Command
    frames: tuple[tuple[int, bytes], ...]


class Decoders(NamedTuple):
    """How payloads become messages; memoising ones may stand in where one process feeds many."""

    beacon: Callable[[bytes], Beacon] = decode_beacon
    gossip: Callable[[bytes], Gossip] = decode_gossip


class Agent:
    """One agent of the team. Raises ControllerError if its controller cannot be had."""

    def __init__(self, setup: AgentSetup, decoders: Decoders = Decoders()) -> None:  # noqa: B008
        tick_s = 1.0 / setup.tick_hz
        comms, limits = setup.comms, setup.vehicle
        self.id = setup.id
        self.rejected: Counter[str] = Counter()
        self._incarnation = setup.incarnation
        self._decoders = decoders
        self._slack_s = 2.0 * tick_s
        self._command_slots = setup.command_ticks * setup.slots_per_tick
        self._cone = cone_of(limits)
        self._controller = Pilot(setup)
        self._neighbours = Neighbours(setup.id, comms.local_hz, self._slack_s)
        self._table = Table(setup.id, comms.multihop_hz)
        round_s = 1.0 / comms.multihop_hz if comms.multihop_hz > 0.0 else inf
        self._broadcast = Broadcast(setup.id, setup.incarnation, 1.0 / comms.local_hz, round_s)
        filtered = (
            setup.control.separation_m,
            setup.fleet_max_speed_mps,
            setup.command_ticks * tick_s,
        )
        self._ranging = RangingFilter(*filtered) if "proximity" in limits.sensors else None
        self._promises = PromiseFilter(*filtered)
        self._speed_cap = limits.max_speed_mps
        self._place: Place | None = None
        self._tidy_at_s = 0.0

    def receive(self, source: int, channel: int, payload: bytes, now_s: float) -> None:
        """Take a frame heard from ``source``; what is not to be believed is counted, by cause."""
        try:
            if channel == LOCAL:
                self._hear_beacon(source, payload, now_s)
            else:
                self._hear_gossip(source, payload, now_s)
        except RejectedError as error:
            self.rejected[error.cause] += 1

    def step(self, observation: Observation) -> Outbox:
        """Decide one tick from what is sensed now and was heard so far."""
        senses = self._senses(observation)
        intent = self._controller.decide(senses)
        self._place = intent.place
        velocity = self._safe(intent, senses)
        command = self._command(observation.slot, senses, intent, velocity)
        own = OwnState(senses.position, velocity, intent.heading_for, intent.place, self._speed_cap)
        frames = self._broadcast.frames(senses.now_s, own, self._neighbours.echoes(), self._table)
        return Outbox(command, frames)

    def _hear_beacon(self, source: int, payload: bytes, now_s: float) -> None:
        beacon = self._decoders.beacon(payload)
        if beacon.id != source:
            raise RejectedError("spoofed", f"{source} says it is {beacon.id}")
        self._neighbours.hear(beacon, now_s, self._broadcast.sent_s)
        self._table.adopt_beacon(beacon)

    def _hear_gossip(self, source: int, payload: bytes, now_s: float) -> None:
        gossip = self._decoders.gossip(payload)
        if gossip.id != source:
            raise RejectedError("spoofed", f"{source} says it is {gossip.id}")
        self._table.adopt(gossip, now_s, self._slack_s)

    def _senses(self, observation: Observation) -> Senses:
        now_s = observation.time_s
        if now_s >= self._tidy_at_s:
            self._tidy_at_s = now_s + TIDY_S
            self._neighbours.forget_silent(now_s)
            self._table.forget_silent(now_s, self._neighbours.silences_s())
        return Senses(
            now_s,
            observation.position,
            observation.velocity,
            observation.yaw,
            observation.vehicles,
            self._neighbours.heard(now_s),
            lambda: self._table.team(Peer(self.id, observation.position, self._place)),
        )

    def _safe(self, intent: Intent, senses: Senses) -> Vector:
        """Return the velocity that is safe to fly [m/s]: the filter has the last word."""
        if self._ranging is not None:
            bounds = self._ranging.bounds(senses.vehicles)
            return limited(intent.velocity, bounds, senses.yaw, self._cone)
        told = self._told(senses)
        self._promises.promise(senses.now_s, told)
        self._speed_cap = self._promises.speed_cap
        velocity = limited(intent.velocity, self._promises.bounds(told), senses.yaw, self._cone)
        return shortened(velocity, self._speed_cap)

    def _told(self, senses: Senses) -> list[Told]:
        """Return what neighbours last told of themselves, not carried forward."""
        x, y, z = senses.position
        return [
            Told(
                (b.position[0] - x, b.position[1] - y, b.position[2] - z),
                max(0.0, senses.now_s - b.stamp_s),
                b.speed_cap,
            )
            for b in self._neighbours.beacons()
        ]

    def _command(self, slot: int, senses: Senses, intent: Intent, velocity: Vector) -> Command:
        telemetry = Telemetry(
            intent.wanted,
            intent.force,
            intent.target,
            intent.place,
            tuple(other.id for other in senses.neighbours[:MAX_TOLD]),
            self.rejected.total(),
        )
        return Command(
            slot,
            self._incarnation,
            slot + self._command_slots,
            velocity,
            intent.yaw,
            intent.tilt,
            telemetry,
        )
