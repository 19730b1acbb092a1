#!/usr/bin/env python3
"""A foreign agent in one file: it speaks qswarm's wire by itself (docs/wire.md).

It imports nothing of qswarm: only the standard library, eclipse-zenoh and msgpack. It flies
free-running and in lockstep, tells its neighbours where it is, takes a free place of the formation,
keeps its distance from what its vehicle senses, and gives its place up to whoever else claims it.
It learns missions by radio, but knows only straight queues that begin at one vertex.
"""

import argparse
import json
import queue
import sys
import time
from contextlib import suppress
from math import atan2, cos, dist, hypot, pi, radians, sin, sqrt
from pathlib import Path
from zlib import crc32

import msgpack
import zenoh

LOCAL, MULTIHOP = 0, 1  # the radio's channels: beacons on one, missions on the other
DATAGRAM_FIELDS = 2
MALFORMED = (ValueError, TypeError, LookupError, msgpack.UnpackException)
BRIEFED = 0  # key of the mission of the briefing
PIECE_B = 900  # longest part of a mission in one frame
VERSION = 65536  # a newer mission's key is at least so much higher
NONE = -1
REST = (0.0, 0.0, 0.0, 0.0)
MEMBER, DISTRESS = 0, 3  # roles
UNPLACED, FIRST_QUEUE = 1, 2  # codes by which the team counts its members
SILENT_S = 1.5  # who is silent for longer is gone
PATIENCE_S = 2.0  # so long it waits for others to take their places first
SETTLE_S = 1.0  # so long a better place must be free until it changes
YIELD_S = 0.3  # so long it claims nothing after it has yielded
GAIN = 1.2  # speed for a distance [1/s]
MARGIN_M = 0.2  # kept beyond the least distances


def add(a, b, factor=1.0):
    """Return a + factor * b."""
    return [x + factor * y for x, y in zip(a, b, strict=True)]


def dot(a, b):
    """Return the scalar product."""
    return sum(x * y for x, y in zip(a, b, strict=True))


def payload_of(fields):
    """Return a radio payload: fields in the order of the wire, and their checksum."""
    data = msgpack.packb(fields)
    return data + crc32(data).to_bytes(4, "little")


class Beacon:
    """What a neighbour says: the fields that are used here, by their positions on the wire."""

    def __init__(self, fields):
        self.id, self.sequence, self.stamp_s = fields[0], fields[2], fields[3]
        self.place = (fields[7], fields[8]) if fields[7] >= 0 and fields[8] >= 0 else None
        self.mission, self.frame_key, self.frame, self.drift = fields[12:16]
        self.standing = fields[17]

    @property
    def leads(self):
        """Whether it leads a vertex, and so counts the team."""
        return self.standing is not None and self.standing[1] >= 0


class Formation:
    """The places of straight queues: (queue, rank), rank 0 is the vertex. Raises ValueError."""

    def __init__(self, tables, spacing_m):
        self.vertices = tables["vertices"]
        self.queues = tables["queue"]
        self.spacing_m = spacing_m
        for each in self.queues:
            if (each.get("shape") or {}).get("kind") != "ray" or len(each["vertices"]) != 1:
                raise ValueError(f"queue {each['name']!r}: only straight queues of one vertex")

    def point(self, place):
        """Return where a place is in the formation's frame [m]."""
        table = self.queues[place[0]]
        way = table["shape"]["direction"]
        along_m = place[1] * self.spacing_m / sqrt(dot(way, way))
        return add(self.vertices[table["vertices"][0]], way, along_m)

    def free(self, queue_index, claimed):
        """Return the first free place of a queue behind its vertex."""
        rank = 1
        while (queue_index, rank) in claimed:
            rank += 1
        return queue_index, rank

    def best(self, claimed, distance_m):
        """Return the free place of the queue that lacks most; of several, the nearest."""

        def lack(place):
            members = sum(q == place[0] and rank > 0 for q, rank in claimed)
            share = self.queues[place[0]].get("capacity") or 1.0 / len(self.queues)
            return round((members + 1) / share, 6), distance_m(place)

        return min((self.free(k, claimed) for k in range(len(self.queues))), key=lack)


class Agent:
    """Decides: frames and an observation in, a command and a transmission out."""

    def __init__(self, setup):
        self.setup, self.id = setup, setup["id"]
        control = setup["control"]
        self.mission, self.formation = NONE, None
        self.pieces = {}  # of missions, by sender and key
        self.encoded, self.next_round_s = b"", 0.0  # the own mission, for who lacks it
        self.held = []  # frames of a step that is to take long, in lockstep
        self.place, self.cost_m = None, 0.0
        if setup["formation"] is not None:
            self.adopt(BRIEFED, setup["frame"], msgpack.packb(setup["formation"]))
        self.least_m = (control["separation_m"] + MARGIN_M, control["clearance_m"] + MARGIN_M)
        self.heard = {}  # beacons by id
        self.sequence, self.next_beacon_s = 0, 0.0
        self.alone_s = self.yielded_s = -1e9
        self.better_s = None

    def receive(self, batches):
        """Take the frames of some batches, without damaged ones."""
        for batch in batches:
            for source, _, channel, _, payload in batch[1]:
                data, checksum = payload[:-4], payload[-4:]
                if crc32(data).to_bytes(4, "little") == checksum:
                    # A hostile radio may send anything.
                    with suppress(*MALFORMED):
                        self.take_frame(source, channel, msgpack.unpackb(data))

    def take_frame(self, source, channel, fields):
        """Take a neighbour's message. Raises one of MALFORMED."""
        if len(fields) == DATAGRAM_FIELDS:
            return  # controllers of another make talk to each other
        if channel == LOCAL:
            self.hear(source, Beacon(fields))
        elif fields[3] is not None:
            self.learn(source, *fields[3][:4])

    def hear(self, source, beacon):
        """Keep a neighbour's newest beacon, and follow the frame that it tells of."""
        known = self.heard.get(source)
        if beacon.id != source or (known is not None and known.stamp_s >= beacon.stamp_s):
            return
        self.heard[source] = beacon
        if beacon.frame_key == self.mission:
            since_s, *velocity = beacon.drift or (beacon.stamp_s, *REST)
            self.frame, self.frame_s, self.frame_velocity = beacon.frame, since_s, velocity

    def learn(self, source, key, index, count, data):
        """Take a piece of a mission; with the last one of a sender, fly it."""
        if key <= self.mission:
            return
        parts = self.pieces.setdefault((source, key, count), {})
        parts[index] = data
        if len(parts) == count:
            self.pieces.clear()
            self.adopt(key, *msgpack.unpackb(b"".join(parts[k] for k in range(count)))[:2])

    def obey(self, key, path, formation):
        """Take an operator's order; without a formation, only the frame's path is another one."""
        formation = formation or msgpack.unpackb(self.encoded)[1]
        version = max(self.mission, 0) // VERSION + 1
        self.adopt(key or version * VERSION + self.id, path, formation)

    def adopt(self, key, path, formation):
        """Fly another mission, if its formation (as msgpack) is one that this agent knows."""
        try:
            tables = msgpack.unpackb(formation)
            self.formation = Formation(tables, self.setup["control"]["spacing_m"])
        except ValueError as error:
            print(f"mission {key} is left to the others: {error}", file=sys.stderr)
            return
        waypoints, _, _, yaw, *_ = path
        self.mission, self.place, self.encoded = key, None, msgpack.packb([path, formation])
        self.frame, self.frame_s, self.frame_velocity = [*waypoints[0], yaw], 0.0, REST

    def world_point(self, place, now_s):
        """Return where a place is in the world now [m], and how it moves [m/s]."""
        since_s = now_s - self.frame_s
        x, y, z, yaw = add(self.frame, self.frame_velocity, since_s)
        u, v, w = self.formation.point(place)
        c, s = cos(yaw), sin(yaw)
        point = [x + c * u - s * v, y + s * u + c * v, z + w]
        vx, vy, vz, rate = self.frame_velocity
        return point, [vx - rate * (point[1] - y), vy + rate * (point[0] - x), vz]

    def choose(self, here, now_s):
        """Keep a place, give it up, or take another one; return the members that are heard."""
        self.heard = {k: b for k, b in self.heard.items() if now_s - b.stamp_s < SILENT_S}
        members = [b for b in self.heard.values() if b.mission == self.mission and b.standing]
        if self.mission == NONE or not any(each.leads for each in members):
            self.alone_s, self.place = now_s, None
            return None  # nobody counts the team yet: it is no part of it, and claims nothing
        claimed = {each.place for each in members if each.place is not None}
        if self.place in claimed:
            self.place, self.yielded_s = None, now_s  # it yields to everybody
        if self.place is None and not self.waits(members, now_s):
            self.take(self.formation.best(claimed, self.away_m(here, now_s)), here, now_s)
        elif self.place is not None:
            nearer = self.formation.free(self.place[0], claimed)
            if nearer[1] >= self.place[1] or self.better_s is None:
                self.better_s = now_s
            elif now_s - self.better_s > SETTLE_S:
                self.take(nearer, here, now_s)  # the queue closes up
        return members

    def waits(self, members, now_s):
        """Return whether others choose before this agent; later, only those of lower ids do."""
        without = [each.id for each in members if each.place is None]
        if now_s - self.alone_s > PATIENCE_S:
            without = [each for each in without if each < self.id]
        return bool(without) or now_s - self.yielded_s < YIELD_S

    def away_m(self, here, now_s):
        """Return a function: how far a place is [m]."""
        return lambda place: dist(here, self.world_point(place, now_s)[0])

    def take(self, place, here, now_s):
        """Claim a place."""
        self.place, self.better_s = place, None
        self.cost_m = self.away_m(here, now_s)(place)

    def wanted(self, here, yaw, now_s):
        """Return the wanted velocity [m/s] and heading [rad]: to the place, turning first."""
        vehicle = self.setup["vehicle"]
        if self.place is None:
            return [0.0, 0.0, 0.0], yaw
        point, drift = self.world_point(self.place, now_s)
        velocity = add(drift, add(point, here, -1.0), GAIN)
        fastest = vehicle["max_speed_mps"]
        length = sqrt(dot(velocity, velocity))
        velocity = [each * min(1.0, fastest / max(length, 1e-9)) for each in velocity]
        climb = vehicle["max_climb_mps"]
        velocity[2] = min(max(velocity[2], -climb), climb)
        if hypot(velocity[0], velocity[1]) < 0.05:
            return velocity, yaw
        heading = atan2(velocity[1], velocity[0])
        turn = heading - yaw - 2.0 * pi * round((heading - yaw) / (2.0 * pi))
        if abs(turn) > radians(0.9 * vehicle["max_turn_deg"]):
            velocity = [0.0, 0.0, velocity[2]]
        return velocity, heading

    def safe(self, velocity, vehicles, obstacles):
        """Return a velocity that comes no nearer to what is sensed than it may; it slides past."""
        near = [(each, self.least_m[0]) for each in vehicles]
        near += [(each, self.least_m[1]) for each in obstacles]
        for away, least_m in sorted(near, key=lambda each: -dot(each[0], each[0])):
            away_m = max(sqrt(dot(away, away)), 1e-6)
            towards = [each / away_m for each in away]
            too_fast = dot(velocity, towards) - 0.5 * (away_m - least_m)
            if too_fast > 0.0:
                velocity = add(velocity, towards, -too_fast)
                side = [-towards[1], towards[0], 0.0]  # who stands in the way is passed on one side
                velocity = add(velocity, side, min(0.5 * too_fast, 0.1))
        length = sqrt(dot(velocity, velocity))
        fastest = self.setup["vehicle"]["max_speed_mps"]
        return [each * min(1.0, fastest / max(length, 1e-9)) for each in velocity]

    def step(self, observation):
        """Return the encoded command and transmission for an observation."""
        slot, now_s, here, _, yaw, vehicles, obstacles, orders = observation[:8]
        late_slots, takes_s = (*observation[9:11], 0, 0.0)[:2]
        setup = self.setup
        for order in orders:
            if order[0] == 0 or order[0] > self.mission:
                self.obey(*order[:3])
        members = self.choose(here, now_s)
        wanted, heading = self.wanted(here, yaw, now_s)
        velocity = self.safe(wanted, vehicles, obstacles)
        target = None if self.place is None else self.world_point(self.place, now_s)[0]
        force = sqrt(dot(wanted, wanted))
        role = DISTRESS if self.place is None else MEMBER
        heard = sorted(self.heard)
        telemetry = [wanted, force, target, self.place, heard, [], self.mission, NONE, NONE, role]
        until = slot + setup["command_ticks"] * setup["slots_per_tick"]
        command = [slot, setup["incarnation"], until, velocity, heading, [0.0, 0.0], telemetry]
        frames = []
        if now_s >= self.next_beacon_s:
            self.next_beacon_s = now_s + 1.0 / setup["comms"]["local_hz"] - 1e-9
            frames.append([LOCAL, self.beacon(now_s, here, velocity, target or here, members)])
        if now_s >= self.next_round_s and any(
            b.mission < self.mission for b in self.heard.values()
        ):
            self.next_round_s = now_s + 0.25 / max(setup["comms"]["multihop_hz"], 0.1)
            frames += [[MULTIHOP, payload] for payload in self.mission_pieces(now_s)]
        if not setup["lockstep"]:
            time.sleep(takes_s)  # the fault "slow"; where time waits, only its frames are late
            slot += late_slots
        elif late_slots:
            frames, self.held = self.held, frames
        else:
            frames, self.held = self.held + frames, []
        transmission = [slot, setup["incarnation"], frames]
        return msgpack.packb(command), msgpack.packb(transmission)

    def mission_pieces(self, now_s):
        """Return the payloads that carry the own mission."""
        parts = [self.encoded[k : k + PIECE_B] for k in range(0, len(self.encoded), PIECE_B)]
        for index, part in enumerate(parts):
            piece = [self.mission, index, len(parts), part]
            yield payload_of([self.id, now_s, [], piece])

    def beacon(self, now_s, here, velocity, target, members):
        """Return the payload of a beacon."""
        self.sequence += 1
        queue_index, rank = self.place or (NONE, NONE)
        standing = None
        if members is not None:
            code = UNPLACED if self.place is None else FIRST_QUEUE + queue_index
            standing = [[], NONE, queue_index, len(members) + 1, False, None, None, code]
        identity = [self.id, self.setup["incarnation"], self.sequence, now_s]
        motion = [here, velocity, target]
        claim = [queue_index, rank, round(1000.0 * self.cost_m)]
        promise = self.setup["vehicle"]["max_speed_mps"]
        turn = self.sequence % max(1, len(self.heard))
        echoes = [[b.id, b.sequence] for _, b in sorted(self.heard.items())]
        frame = [NONE, REST, None]  # it tells others of no frame
        echoes = (echoes + echoes)[turn : turn + 8][: len(echoes)]
        fields = [*identity, *motion, *claim, promise, echoes, self.mission, *frame, [], standing]
        return payload_of(fields)


class Wire:
    """The keys of one agent in one run."""

    def __init__(self, session, run, agent):
        self.session, self.run, self.agent = session, run, agent
        self.inputs = queue.SimpleQueue()

    def key(self, topic):
        """Return the key of one of the agent's topics."""
        return f"qswarm/{self.run}/{topic}/{self.agent}"

    def setup(self):
        """Return the setup that the world answers."""
        for _ in range(300):
            for reply in self.session.get(self.key("setup"), timeout=2.0):
                if reply.ok is not None:
                    return json.loads(reply.ok.payload.to_bytes())
                reason = reply.err.payload.to_string()
                if reason != "Timeout":
                    sys.exit(f"refused: {reason}")
            time.sleep(0.1)
        sys.exit(f"the world of run {self.run!r} did not answer")

    def listen(self, topics):
        """Let the messages of some topics, and the end of the run, come as inputs."""
        for each in topics:
            self.session.declare_subscriber(
                self.key(each), lambda s, topic=each: self.inputs.put((topic, s.payload.to_bytes()))
            )
        self.session.declare_subscriber(
            f"qswarm/{self.run}/over", lambda s: self.inputs.put(("over", s.payload.to_bytes()))
        )

    def publisher(self, topic, *, blocking):
        """Return a publisher of a topic."""
        control = zenoh.CongestionControl.BLOCK if blocking else zenoh.CongestionControl.DROP
        return self.session.declare_publisher(self.key(topic), congestion_control=control)

    def declare_alive(self):
        """Show the agent as present: the world waits for it."""
        key = f"qswarm/{self.run}/alive/agent-{self.agent}"
        return self.session.liveliness().declare_token(key)


def fly(wire, agent):
    """Answer observations until the run is over."""
    lockstep = agent.setup["lockstep"]
    wire.listen(["radio/rx"] if lockstep else ["radio/rx", "obs"])
    command, radio = (wire.publisher(each, blocking=lockstep) for each in ("cmd", "radio/tx"))
    while lockstep and not (command.matching_status.matching and radio.matching_status.matching):
        time.sleep(0.005)  # what is put before somebody listens is lost
    token = wire.declare_alive()
    print(f"agent-{wire.agent} flies in run {wire.run!r}", flush=True)
    while True:
        inputs = [wire.inputs.get()]
        while not wire.inputs.empty():
            inputs.append(wire.inputs.get())
        if ("over", b"the run is over") in inputs:
            token.undeclare()
            return
        radio_inputs = [msgpack.unpackb(data) for topic, data in inputs if topic == "radio/rx"]
        if lockstep:
            for _, observation, batches in radio_inputs:
                agent.receive(map(msgpack.unpackb, batches))
                answer(agent, msgpack.unpackb(observation), command, radio)
        else:
            agent.receive(radio_inputs)
            newest = [data for topic, data in inputs if topic == "obs"][-1:]
            for data in newest:
                answer(agent, msgpack.unpackb(data), command, radio)


def answer(agent, observation, command, radio):
    """Put one command and one transmission for an observation."""
    for publisher, data in zip((command, radio), agent.step(observation), strict=True):
        publisher.put(data)


def configuration(endpoint, agent, credentials):
    """Return a client's configuration: it knows the router and finds nobody else."""
    transport = {"link": {"tx": {"lease": 24 * 3600 * 1000}}}  # it may be paused for long
    if credentials is not None:
        lines = credentials.read_text().splitlines()
        passwords = dict(line.split(":", 1) for line in lines)
        user = f"agent-{agent}"
        transport["auth"] = {"usrpwd": {"user": user, "password": passwords[user]}}
    no = {"enabled": False}
    return {
        "mode": "client",
        "connect": {"endpoints": [endpoint], "timeout_ms": 30_000, "exit_on_failure": True},
        "scouting": {"delay": 0, "multicast": no, "gossip": no},
        "transport": transport,
    }


def main():
    """Fly one agent of a run."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--id", type=int, required=True)
    parser.add_argument("--run", required=True)
    parser.add_argument("--connect", required=True, help="the router, e.g. tcp/127.0.0.1:7447")
    parser.add_argument("--credentials", type=Path, help="file of passwords")
    told = parser.parse_args()
    config = configuration(told.connect, told.id, told.credentials)
    with zenoh.open(zenoh.Config.from_json5(json.dumps(config))) as session:
        wire = Wire(session, told.run, told.id)
        fly(wire, Agent(wire.setup()))


if __name__ == "__main__":
    main()
