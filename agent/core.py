"""One agent, whole: it hears, believes or doubts, decides, commands and speaks.

A pure state machine: time comes with the observation. The shells around it (a process on Zenoh,
the virtual clock) only carry bytes.
"""

from collections import Counter
from collections.abc import Callable
from math import dist, hypot, inf
from typing import NamedTuple, assert_never

import msgspec

from agent.checked_controller import CheckedController
from agent.codec import RejectedError, decode_beacon, decode_gossip
from agent.comms.broadcast import Broadcast, OwnState
from agent.comms.gossip import Table
from agent.comms.hierarchy import ALONE, Hierarchy
from agent.comms.mission import Missions
from agent.comms.neighbours import Neighbours
from agent.comms.unidentified_vehicles import SAME_BODY_M, TellsOf, UnidentifiedVehicles
from agent.config import AgentSetup
from agent.controller import Intent, Peer, Senses
from agent.guidance.safety_filter import TelemetryRow
from agent.guidance.safety_monitor import Guard
from agent.messages import (
    CAUSES,
    MAX_COST_MM,
    MAX_HEARD,
    MAX_PLACES,
    ZERO,
    Beacon,
    Command,
    Gossip,
    Mission,
    Observation,
    Place,
    Telemetry,
    Vector,
)
from agent.sensing.obstacle_perception import ObstaclePerception
from netem.wire import channels
from netem.wire.channels import Channel

TIDY_S = 0.2
"""How often those who fell silent are looked for."""
IMPLAUSIBLE = 4.0
"""Who says it flies so many times faster than any vehicle can is not believed: what a controller
asks for may exceed a limit that the vehicle then keeps."""


class Outbox(msgspec.Struct, frozen=True, gc=False):
    """What an agent says at the end of a step: to its vehicle, and (channel, payload) to all."""

    command: Command
    frames: tuple[tuple[Channel, bytes], ...]


class Decoders(NamedTuple):
    """How payloads become messages; memoising ones may stand in where one process feeds many."""

    beacon: Callable[[bytes], Beacon] = decode_beacon
    gossip: Callable[[bytes], Gossip] = decode_gossip


class Agent:
    """One agent of the team. Raises ControllerError if its controller cannot be had."""

    def __init__(self, setup: AgentSetup, decoders: Decoders = Decoders()) -> None:  # noqa: B008
        tick_s = 1.0 / setup.tick_hz
        comms = setup.comms
        self.id = setup.id
        self.rejected: Counter[str] = Counter()
        self._incarnation = setup.incarnation
        self._decode_beacon, self._decode_gossip = decoders.beacon, decoders.gossip
        self._slack_s = 2.0 * tick_s
        self._implausible2 = (IMPLAUSIBLE * setup.fleet_max_speed_mps) ** 2
        self._command_slots = setup.command_ticks * setup.slots_per_tick
        self._controller = CheckedController(setup)
        self._neighbours = Neighbours(setup.id, comms.local_hz, self._slack_s)
        self._table = Table(setup.id, comms.multihop_hz)
        round_s = 1.0 / comms.multihop_hz if comms.multihop_hz > 0.0 else inf
        self._broadcast = Broadcast(setup.id, setup.incarnation, 1.0 / comms.local_hz, round_s)
        self._guard = Guard(setup)
        self._obstacle_perception = ObstaclePerception(setup)
        self._missions = Missions(setup.id, setup.formation, setup.control.spacing_m, setup.frame)
        self._hierarchy = Hierarchy(setup.id)
        self._standing = ALONE
        self._bodies = UnidentifiedVehicles(setup.fleet_max_speed_mps)
        self._silent: tuple[Vector, ...] = ()
        self._blocked: frozenset[Place] = frozenset()
        self._intent: Intent | None = None
        self._lagging = False
        self._beside_m = 0.5 * setup.control.spacing_m + SAME_BODY_M
        self._tidy_at_s = 0.0
        self._record_age_s = 0.0

    def receive(self, source: int, channel: Channel, payload: bytes, now_s: float) -> None:
        """Take a frame heard from ``source``; what is not to be believed is counted, by cause."""
        try:
            match channel:
                case channels.LOCAL:
                    self._hear_beacon(source, payload, now_s)
                case channels.MULTIHOP:
                    self._hear_gossip(source, payload, now_s)
                case _:
                    assert_never(channel)
        except RejectedError as error:
            self.rejected[error.cause] += 1

    def step(self, observation: Observation) -> Outbox:
        """Decide one tick from what is sensed now and was heard so far."""
        for mission in observation.orders:
            self._obey(mission)
        senses = self._senses(observation)
        intent = self._intent = self._controller.decide(senses)
        velocity = self._guard.safe(intent.velocity, senses, lambda: self._told(senses))
        if not self._obstacle_perception.trust.note(observation):
            velocity = ZERO
        command = self._command(observation.slot, senses, intent, velocity)
        own = self._own_state(senses, velocity, intent)
        pieces = self._missions.pieces() if self._lagging else ()
        echoes = self._neighbours.echoes()
        frames = self._broadcast.frames(senses.now_s, own, echoes, self._table, pieces)
        return Outbox(command=command, frames=frames)

    def _own_state(self, senses: Senses, velocity: Vector, intent: Intent) -> OwnState:
        missions = self._missions
        frame, drift = missions.told(senses.now_s)
        return OwnState(
            position=senses.position,
            velocity=velocity,
            heading_for=intent.heading_for,
            place=intent.place,
            speed_cap=self._guard.speed_cap,
            mission=missions.flown.key,
            frame_key=missions.frame_key,
            frame=frame,
            drift=drift,
            standing=self._standing,
            blocked=intent.blocked,
            cost_mm=min(round(1000.0 * intent.cost_m), MAX_COST_MM),
        )

    def _obey(self, mission: Mission) -> None:
        try:
            self._missions.order(mission)
        except RejectedError as error:
            self.rejected[error.cause] += 1

    def _hear_beacon(self, source: int, payload: bytes, now_s: float) -> None:
        beacon = self._decode_beacon(payload)
        if beacon.id != source:
            raise RejectedError("spoofed", f"{source} says it is {beacon.id}")
        u, v, w = beacon.velocity
        if u * u + v * v + w * w > self._implausible2:
            raise RejectedError("speed", f"{source} says it flies at {hypot(u, v, w):.1f} m/s")
        self._neighbours.hear(beacon, now_s, self._broadcast.sent_s)
        self._table.adopt_beacon(beacon)
        if beacon.drift is not None or beacon.frame_key != self._missions.frame_key:
            self._missions.glimpse(beacon)

    def _hear_gossip(self, source: int, payload: bytes, now_s: float) -> None:
        gossip = self._decode_gossip(payload)
        if gossip.id != source:
            raise RejectedError("spoofed", f"{source} says it is {gossip.id}")
        self._table.adopt(gossip, now_s, self._slack_s)
        if gossip.piece is not None:
            self._missions.hear(gossip.piece)

    def _senses(self, observation: Observation) -> Senses:
        now_s = observation.time_s
        mission = self._missions.flown_at(now_s)
        if now_s >= self._tidy_at_s:
            self._tidy_at_s = now_s + TIDY_S
            self._tidy(observation)
        place = self._intent.place if self._intent is not None else None
        cost_m = self._intent.cost_m if self._intent is not None else None
        own = Peer(id=self.id, position=observation.position, place=place, cost_m=cost_m)
        return Senses(
            now_s=now_s,
            position=observation.position,
            velocity=observation.velocity,
            yaw=observation.yaw,
            vehicles=observation.vehicles,
            neighbours=self._neighbours.heard(now_s, mission.key),
            team=lambda: self._table.team(own, mission.key),
            mission=mission,
            silent=self._silent,
            blocked=self._blocked,
            obstacles=self._obstacles(observation),
        )

    def _obstacles(self, observation: Observation) -> tuple[Vector, ...]:
        """Return what is known of obstacles near by; neighbours' bodies are none."""
        if not self._obstacle_perception.scanning:
            return observation.obstacles
        heard = [beacon.position for beacon in self._neighbours.beacons()]
        return self._obstacle_perception.near(observation, heard)

    def _tidy(self, observation: Observation) -> None:
        """Look after what need not be looked at every tick: who is gone, and one's standing."""
        now_s = observation.time_s
        lost = self._neighbours.forget_silent(now_s)
        departed = self._table.forget_silent(now_s, self._neighbours.ids, lost)
        beacons = self._neighbours.beacons()
        here, team = observation.position, self._table.members(now_s)
        self._record_age_s = max((member.age_s for member in team), default=0.0)
        sensed = observation.vehicles
        self._silent = self._bodies.look(
            now_s, here, sensed, beacons, team, departed, self._teller(1 + len(team))
        )
        self._obstacle_perception.trust.compare(observation, beacons)
        self._lagging = self._neighbours.behind(self._missions.flown.key)
        self._blocked = self._table.blocked(self._missions.flown.key)
        vertex = self._intent is not None and self._intent.vertex
        queue = self._on_my_queue()
        self._standing = self._hierarchy.stand(now_s, self._broadcast.sequence, vertex, queue)

    def _teller(self, agents: int) -> TellsOf:
        """Return what says whether a neighbour tells of a silent body, in a team of that size.

        It tells of places, each taken by a body within d_ir / 2, and of a few at most; one who
        flies another mission cannot be asked.
        """
        mission = self._missions.flown

        def tells_of(witness: Beacon, body: Vector) -> bool:
            if witness.mission != mission.key or len(witness.blocked) >= MAX_PLACES:
                return True
            slots = [mission.formation.slot(Place(*told), agents) for told in witness.blocked]
            return any(
                slot is None or dist(mission.frame.to_world(slot.point), body) <= self._beside_m
                for slot in slots
            )

        return tells_of

    def _on_my_queue(self) -> list[Beacon]:
        """Return the last beacons of those heard on the own queue, its vertex agents included."""
        mission = self._missions.flown
        if self._intent is None or self._intent.place is None:
            return []
        mine, formation = mission.formation.queues_of(self._intent.place), mission.formation
        return [
            beacon
            for beacon in self._neighbours.beacons()
            if beacon.mission == mission.key
            and (
                beacon.queue in mine
                or not mine.isdisjoint(formation.queues_of((beacon.queue, beacon.rank)))
            )
        ]

    def _told(self, senses: Senses) -> list[TelemetryRow]:
        """Return what neighbours last told of themselves, not carried forward."""
        x, y, z = senses.position
        return [
            TelemetryRow(
                relative=(b.position[0] - x, b.position[1] - y, b.position[2] - z),
                age_s=max(0.0, senses.now_s - b.stamp_s),
                speed_cap=b.speed_cap,
            )
            for b in self._neighbours.beacons()
        ]

    def _command(self, slot: int, senses: Senses, intent: Intent, velocity: Vector) -> Command:
        rejected = [(CAUSES.index(cause), count) for cause, count in sorted(self.rejected.items())]
        telemetry = Telemetry(
            wanted=intent.wanted,
            force=intent.force,
            target=intent.target,
            place=intent.place,
            heard=self._neighbours.sorted_ids[:MAX_HEARD],
            rejected=tuple(rejected),
            mission=self._missions.flown.key,
            tier=self._standing.tier,
            parent=self._standing.parent,
            role=self._standing.role,
            record_age_s=self._record_age_s,
        )
        return Command(
            slot=slot,
            incarnation=self._incarnation,
            expires_slot=slot + self._command_slots,
            velocity=velocity,
            yaw=intent.yaw,
            tilt=intent.tilt,
            telemetry=telemetry,
        )
