"""One agent's core: it receives frames, checks them, decides, commands and broadcasts.

A pure state machine: the time comes with each observation. The shells around it (a process on
Zenoh, or virtual time) only carry bytes. Where that time jumps, the agent begins anew: all that it
kept with a time counts no longer, its controller included. Its mission stays.
"""

from collections import Counter
from math import dist, hypot, inf
from typing import Final, assert_never, final

import msgspec

from agent.checked_controller import CheckedController
from agent.codec import RadioCodec, holds_datagram
from agent.comms.broadcast import Broadcast, OwnState
from agent.comms.datagrams import Datagrams
from agent.comms.gossip import RecordTable
from agent.comms.mission import Missions
from agent.comms.neighbours import MAX_AGE_S, Neighbours
from agent.comms.own_clock import OwnClock
from agent.comms.unidentified_vehicles import (
    SAME_VEHICLE_M,
    ReportsVehicle,
    Surroundings,
    UnidentifiedVehicles,
)
from agent.config import AgentSetup
from agent.controller import (
    UNHEARD,
    ControllerError,
    Decide,
    HeardSummary,
    Intent,
    Peer,
    Senses,
    load,
)
from agent.guidance.safety_filter import shortened
from agent.guidance.safety_monitor import SafetyMonitor
from agent.heard_beacon import HeardBeacon
from agent.messages import (
    CAUSES,
    MAX_COST_MM,
    MAX_HEARD,
    MAX_M,
    MAX_PLACES,
    NO_MISSION,
    ZERO,
    Command,
    Mission,
    Observation,
    Place,
    Report,
    Telemetry,
    Vector,
)
from agent.places.place_points import PlacePoints
from agent.rejection import RejectedError
from agent.sensing.obstacle_perception import ObstaclePerception
from agent.sensing.own_pose import OwnPose
from agent.services import Services, ServicesError, services_of
from netem.wire.channels import LOCAL, MULTIHOP, Channel

MAX_SUMMARIES: Final = 8
"""Most summaries of one sender taken in one step: its latest."""
HOUSEKEEPING_S: Final = 0.2
BELIEF_S: Final = 0.5
"""An agent tells so often where it takes its neighbours to be."""
BELIEFS_OF: Final = 50
"""In a larger fleet no agent does: they would say more of that than of anything else."""
"""Period of what need not be done every tick [s]."""
IMPLAUSIBLE_SPEEDS: Final = 4.0
"""A reported speed of more than so many times the fleet's limit is rejected. Reported speeds may
exceed the limit: a controller may ask for more than its vehicle then flies."""


@final
class Outbox:
    """An agent's output of one step: for its vehicle, and for its radio."""

    def __init__(
        self,
        command: Command,
        frames: tuple[tuple[Channel, bytes], ...],  # (channel, payload)
    ) -> None:
        self.command = command
        self.frames = frames


class Agent:
    """One agent of the team. Raises ControllerError if its controller cannot be loaded.

    codec: shared by the agents that a process feeds. decide: how its controller is asked; None:
    directly.
    """

    def __init__(
        self,
        setup: AgentSetup,
        codec: RadioCodec | None = None,
        decide: Decide | None = None,
    ) -> None:
        tick_s = 1.0 / setup.tick_hz
        comms = setup.comms
        self.id = setup.id
        self.rejected: Counter[str] = Counter()
        self._setup, self._decide_with = setup, decide
        self._incarnation = setup.incarnation
        self._codec = codec if codec is not None else RadioCodec()
        self._slack_s = 2.0 * tick_s
        self._implausible2 = (IMPLAUSIBLE_SPEEDS * setup.fleet_max_speed_mps) ** 2
        self._command_slots = setup.command_ticks * setup.slots_per_tick
        self._slots_per_tick = setup.slots_per_tick
        ticks = max(1, round(BELIEF_S * setup.tick_hz)) if setup.ids <= BELIEFS_OF else 0
        self._slots_per_belief = ticks * setup.slots_per_tick  # 0: it tells nothing of them
        round_s = 1.0 / comms.multihop_hz if comms.multihop_hz > 0.0 else inf
        self._services = services = _services_of(setup)
        self._broadcast = Broadcast(
            setup.id,
            setup.incarnation,
            comms,
            self._codec,
            setup.relays and services.records,
        )
        self._datagrams = Datagrams(self._slack_s, round_s)
        self._missions = Missions(
            setup.id,
            setup.formation,
            setup.control.spacing_m,
            setup.frame,
            setup.ids,
            setup.control.allocation,
        )
        self._points = PlacePoints(setup.control.spacing_m)
        self._blocks_within_m = 0.5 * setup.control.spacing_m + SAME_VEHICLE_M
        self._pose = OwnPose(setup.vehicle, tick_s / setup.slots_per_tick)
        self._clock = OwnClock(tick_s / setup.slots_per_tick, self._slack_s)
        self._filters = setup.control.safety_filter == "on"
        self._begin(setup.incarnation > 0)

    def _begin(self, restarted: bool) -> None:
        """Know nothing of others, and of no time before now: at the start and after a clock's jump.

        restarted: whether the agent may have made promises before.
        """
        setup, comms = self._setup, self._setup.comms
        self._controller = CheckedController(setup, self._decide_with)
        self._neighbours = Neighbours(setup.id, comms.local_hz, self._slack_s)
        self._table = RecordTable(setup.id, comms.multihop_hz, setup.ids)
        self._safety_monitor = SafetyMonitor(setup, restarted)
        self._forget_positions()
        self._summaries: dict[int, list[HeardSummary]] = {}
        self._blocked: frozenset[Place] = frozenset()
        self._blocked_in = NO_MISSION  # key of the mission whose places these are
        self._intent: Intent | None = None
        self._neighbour_lacks_mission = False
        self._housekeeping_at_s = 0.0
        self._record_age_s = 0.0
        self._link = UNHEARD

    def _forget_positions(self) -> None:
        """Know nothing of what was found where, nor of what that says of the sensors."""
        self._perception = ObstaclePerception(self._setup)
        self._unidentified_vehicles = UnidentifiedVehicles(self._setup.fleet_max_speed_mps)
        self._unidentified: tuple[Vector, ...] = ()

    def receive(self, source: int, channel: Channel, payload: bytes, now_s: float) -> None:
        """Take a frame heard from ``source``; a rejected one is counted by its cause."""
        try:
            if holds_datagram(payload):
                self._datagrams.receive(source, channel, payload, now_s)
                self._clock.confirm(now_s)
            elif not self._services.beacons:
                return
            elif channel == LOCAL:
                self._receive_beacon(source, payload, now_s)
            elif channel == MULTIHOP:
                self._receive_gossip(source, payload, now_s)
            else:
                assert_never(channel)
        except RejectedError as error:
            self.rejected[error.cause] += 1
            if error.cause == "future":
                self._clock.contradict(source, now_s)

    def step(self, observation: Observation) -> Outbox:
        """Decide one tick from the observation and the frames received so far.

        An agent that knows its clock to be wrong stands still and says nothing.
        """
        if self._clock.jumps(observation.slot, observation.time_s):
            self._missions.forget_times()
            self._broadcast.forget_times()
            self._begin(restarted=True)
        if self._pose.jumps(observation.slot, observation.position):
            self._forget_positions()
        for mission in observation.orders:
            self._accept_order(mission)
        senses = self._senses(observation)
        intent = self._intent = self._decide(senses)
        safe = self._safe_velocity(observation, senses, intent.velocity)
        velocity = safe if self._filters else intent.velocity
        wrong_clock = self._clock.is_behind(senses.now_s)
        if wrong_clock:
            velocity = ZERO
        command = self._command(senses, observation.slot, intent, velocity, safe)
        if wrong_clock:
            return Outbox(command, ())
        return Outbox(command=command, frames=self._frames(senses, velocity, intent))

    def _safe_velocity(self, observation: Observation, senses: Senses, wanted: Vector) -> Vector:
        """Return the velocity that the safety filter allows [m/s; world frame]."""
        trusted = self._perception.sensor_health.update(observation)
        if self._setup.control.safety_filter == "off":
            return wanted
        safe = self._safety_monitor.safe_velocity(wanted, senses)
        return safe if trusted else shortened(safe, self._perception.sensor_health.probing_mps)

    def _frames(
        self, senses: Senses, velocity: Vector, intent: Intent
    ) -> tuple[tuple[Channel, bytes], ...]:
        """Return what the agent says now: by itself, and for its controller."""
        said = self._datagrams.frames(senses.now_s, intent.messages) if intent.messages else ()
        if not self._services.beacons:
            return said
        own = self._own_state(senses, velocity, intent)
        lacking = self._neighbour_lacks_mission and self._services.missions
        pieces = self._missions.pieces() if lacking else ()
        echoes = self._neighbours.echoes()
        return self._broadcast.frames(senses.now_s, own, echoes, self._table, pieces) + said

    def _decide(self, senses: Senses) -> Intent:
        """Return the controller's intent; without a mission there is no place to claim."""
        intent = self._controller.decide(senses)
        if senses.mission is None and (intent.place is not None or intent.blocked):
            return msgspec.structs.replace(intent, place=None, vertex=False, blocked=())
        return intent

    def _own_state(self, senses: Senses, velocity: Vector, intent: Intent) -> OwnState:
        missions = self._missions
        frame, drift = missions.frame_report(senses.now_s)
        return OwnState(
            position=senses.position,
            velocity=velocity,
            heading_for=intent.heading_for,
            place=intent.place,
            speed_cap=self._speed_cap(),
            mission=missions.key,
            frame_key=missions.frame_key,
            frame=frame,
            drift=drift,
            blocked=intent.blocked,
            cost_mm=min(round(1000.0 * intent.cost_m), MAX_COST_MM),
            standing=intent.words.standing if self._services.hierarchy else None,
            summary=intent.words.summary if self._services.hierarchy else None,
        )

    def _speed_cap(self) -> float:
        """Return the speed that the agent promises [m/s]; no filter keeps it unless it is on."""
        if self._filters:
            return self._safety_monitor.speed_cap
        return self._setup.vehicle.max_speed_mps

    def _accept_order(self, mission: Mission) -> None:
        try:
            self._missions.accept_order(mission)
        except RejectedError as error:
            self.rejected[error.cause] += 1

    def _receive_beacon(self, source: int, payload: bytes, now_s: float) -> None:
        beacon = self._codec.beacon(payload)
        if beacon.id != source:
            raise RejectedError("spoofed", f"a beacon of agent {source} with the id {beacon.id}")
        u, v, w = beacon.velocity
        if u * u + v * v + w * w > self._implausible2:
            raise RejectedError("speed", f"agent {source} reports {hypot(u, v, w):.1f} m/s")
        self._neighbours.receive(beacon, now_s, self._broadcast.sent_s)
        self._clock.confirm(now_s)
        self._table.adopt_beacon(beacon)
        self._safety_monitor.hear(beacon)
        if beacon.drift is not None or beacon.frame_key != self._missions.frame_key:
            self._missions.receive_frame(beacon)

    def _receive_gossip(self, source: int, payload: bytes, now_s: float) -> None:
        gossip = self._codec.gossip(payload)
        if gossip.id != source:
            raise RejectedError("spoofed", f"gossip of agent {source} with the id {gossip.id}")
        if gossip.stamp_s > now_s + self._slack_s:
            raise RejectedError("future", f"the stamp is {gossip.stamp_s - now_s:.3f} s ahead")
        if now_s - gossip.stamp_s > MAX_AGE_S:
            raise RejectedError("old", f"the stamp is {now_s - gossip.stamp_s:.3f} s old")
        self._table.adopt(gossip, now_s, self._slack_s)
        if gossip.summary is not None:
            heard = self._summaries.get(source)
            if heard is None:
                heard = self._summaries[source] = []
            elif len(heard) == MAX_SUMMARIES:
                del heard[0]
            heard.append(HeardSummary(source, gossip.stamp_s, gossip.summary))
        if gossip.piece is not None and self._services.missions:
            self._missions.receive(gossip.piece, source, now_s)

    def _senses(self, observation: Observation) -> Senses:
        now_s = observation.time_s
        mission, key = self._missions.flown_at(now_s), self._missions.key
        if now_s >= self._housekeeping_at_s and self._services.beacons:
            self._housekeeping_at_s = now_s + HOUSEKEEPING_S
            self._do_housekeeping(observation)
        if key != self._blocked_in:
            self._note_blocked(key)
        place = self._intent.place if self._intent is not None else None
        cost_m = self._intent.cost_m if self._intent is not None else None
        position = observation.position
        summaries, self._summaries = self._summaries, {}
        return Senses(
            now_s=now_s,
            position=position,
            velocity=observation.velocity,
            yaw=observation.yaw,
            vehicles=observation.vehicles,
            neighbours=self._neighbours.heard(now_s, key),
            team=lambda: self._table.team(Peer(self.id, position, place, cost_m), key),
            mission=mission,
            silent=self._unidentified,
            blocked=self._blocked,
            link=self._link,
            summaries=tuple([each for heard in summaries.values() for each in heard]),
            obstacles=self._obstacles(observation),
            heard_frame=self._missions.heard_frame_at(now_s),
            inbox=self._datagrams.take(now_s),
        )

    def _obstacles(self, observation: Observation) -> tuple[Vector, ...]:
        """Return the known points of near obstacles, without neighbours' vehicles."""
        if not self._perception.scanning:
            return observation.obstacles
        heard = [beacon.position for beacon in self._neighbours.beacons()]
        return self._perception.near_points(observation, heard)

    def _do_housekeeping(self, observation: Observation) -> None:
        """Update what need not be updated every tick: departures, blocked places, hierarchy."""
        now_s = observation.time_s
        lost = self._neighbours.forget_silent(now_s)
        departed = self._table.forget_silent(now_s, self._neighbours.ids, lost)
        beacons = self._neighbours.beacons()
        team = self._table.members(now_s)
        counted = self._intent.words.agents if self._intent is not None else 0
        self._record_age_s = 0.0
        for member in team:
            self._record_age_s = max(self._record_age_s, member.age_s)
        self._unidentified = self._unidentified_vehicles.update(
            Surroundings(
                now_s=now_s,
                position=observation.position,
                sensed=observation.vehicles,
                beacons=beacons,
                team=team,
                departed=departed,
                reports_vehicle=self._reports_vehicle(counted or 1 + len(team)),
            )
        )
        self._safety_monitor.relay(self._table.newest())
        self._perception.sensor_health.compare(observation, beacons)
        self._neighbour_lacks_mission = self._neighbours.any_behind(self._missions.key)
        self._note_blocked(self._missions.key)
        self._link = self._neighbours.link(observation.position)

    def _note_blocked(self, mission: int) -> None:
        self._blocked, self._blocked_in = self._table.blocked(mission), mission

    def _reports_vehicle(self, agents: int) -> ReportsVehicle:
        """Return a function: whether a neighbour reports an unidentified vehicle at a position.

        agents: size of the team. A beacon names places, each taken by a vehicle within d_ir / 2,
        and at most MAX_PLACES of them. A neighbour that flies another mission contradicts nothing,
        nor does one while the vehicle takes no place: it cannot report it.
        """
        mission = self._missions.flown

        def reports_vehicle(witness: HeardBeacon, vehicle: Vector) -> bool:
            if mission is None or witness.mission != mission.key:
                return True
            if len(witness.blocked) >= MAX_PLACES:
                return True
            slots = [mission.formation.slot(Place(*place), agents) for place in witness.blocked]
            reported = any(
                slot is None
                or dist(mission.frame.to_world(slot.point), vehicle) <= self._blocks_within_m
                for slot in slots
            )
            return reported or not self._points.taken_by(mission, agents, (vehicle,), self._blocked)

        return reports_vehicle

    def _believed(self, senses: Senses, slot: int) -> tuple[tuple[int, Vector], ...]:
        """Return where the agent takes its neighbours to be, at the ticks at which it tells."""
        if self._slots_per_belief == 0 or slot % self._slots_per_belief >= self._slots_per_tick:
            return ()
        near = [each for each in senses.neighbours[:MAX_HEARD] if _is_sendable(each.position)]
        return tuple([(each.id, each.position) for each in near])

    def _heard(self, now_s: float) -> tuple[int, ...]:
        """Return the ids of those heard directly: by beacons, or by datagrams where it has none."""
        if self._services.beacons:
            return self._neighbours.sorted_ids
        return self._datagrams.senders(now_s)

    def _report(self, senses: Senses, intent: Intent) -> Report | None:
        """Return what the controller has to tell, and count its datagrams; None for nothing."""
        log = self._controller.log(senses.now_s)
        inbox, messages = senses.inbox, intent.messages
        if not (log or inbox or messages or intent.signals):
            return None
        oldest_s = 0.0
        for each in inbox:
            oldest_s = max(oldest_s, each.age_s)
        return Report(
            signals=tuple(intent.signals.items()),
            log=log,
            sent=(len(messages), sum([len(data) for _, data in messages])),
            received=(len(inbox), sum([len(each.data) for each in inbox])),
            oldest_s=oldest_s,
        )

    def _command(
        self, senses: Senses, slot: int, intent: Intent, velocity: Vector, safe: Vector
    ) -> Command:
        """Return the command. safe: the velocity that the safety filter allows."""
        rejected: tuple[tuple[int, int], ...] = ()
        if self.rejected:
            counts = sorted(self.rejected.items())
            rejected = tuple([(CAUSES.index(cause), count) for cause, count in counts])
        telemetry = Telemetry(
            wanted=intent.wanted,
            force=intent.force,
            target=intent.target,
            place=intent.place,
            heard=self._heard(senses.now_s)[:MAX_HEARD],
            rejected=rejected,
            mission=self._missions.key,
            tier=intent.words.tier,
            parent=intent.words.parent,
            role=intent.words.role,
            record_age_s=self._record_age_s,
            believed=self._believed(senses, slot),
            filter_mps=dist(safe, intent.velocity),
            report=self._report(senses, intent),
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


def _services_of(setup: AgentSetup) -> Services:
    """Return the services that an agent's controller asks for. Raises ControllerError."""
    control = setup.control
    try:
        return services_of(load(control.controller), control.services)
    except ServicesError as error:
        raise ControllerError(f"services of {control.controller!r}: {error}") from error


def _is_sendable(position: Vector) -> bool:
    """Return whether a message may hold a position: one far off may be extrapolated beyond."""
    x, y, z = position
    return abs(x) <= MAX_M and abs(y) <= MAX_M and abs(z) <= MAX_M
