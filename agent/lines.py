"""Lines of JSON between an agent and a controller in any language: what is said, and its types.

The agent writes one line of setup, then a line of senses a tick; the controller answers each line
of senses with a line of intent. docs/lines.md tells it to people. JSON has no infinity: a number
that is not finite is null.
"""

from collections.abc import Mapping
from math import isfinite, sqrt
from typing import Annotated, Any

import msgspec
from msgspec import Meta

from agent.child import ProgramError
from agent.config import AgentSetup
from agent.controller import NO_SIGNALS, Intent, Outgoing, Received, Senses
from agent.messages import Place, Vector
from agent.qstructure.formation import Formation
from agent.senses import Flown, Heard
from netem.wire.channels import ChannelName

PROTOCOL = 1
"""The version of these lines; it grows when a controller has to change."""

Triple = tuple[float, float, float]


class SetupLine(msgspec.Struct, frozen=True):
    """The first line."""

    protocol: int
    setup: AgentSetup


class NeighbourRow(msgspec.Struct, frozen=True):
    """A neighbour heard directly, extrapolated to now; see agent.senses.Heard."""

    id: int
    age_s: float  # age of its last beacon [s]
    position: Triple  # [m; world frame]
    velocity: Triple  # [m/s; world frame]
    target: Triple  # where it is heading [m; world frame]
    place: tuple[int, int] | None  # the queue and rank that it claims
    hears_me: bool


class SlotRow(msgspec.Struct, frozen=True):
    """A slot of the formation, for a team of the size of the start."""

    place: tuple[int, int]  # queue and rank
    point: Triple  # [m; target's frame]


class MissionRow(msgspec.Struct, frozen=True):
    """The mission that the agent flies."""

    key: int
    origin: Triple  # of the target's frame [m; world frame]
    yaw: float  # of the target's frame [rad]
    velocity: Triple  # of its origin [m/s; world frame]
    formation: str  # its name
    slots: list[SlotRow] | None  # told once, where the key is new; else null


class ReceivedRow(msgspec.Struct, frozen=True):
    """A datagram of another agent's controller; see agent.senses.Received."""

    source: int
    channel: ChannelName
    age_s: float
    text: str | None  # null where the bytes are no text in UTF-8
    data: bytes | None  # in base64; null where they are


class SensesLine(msgspec.Struct, frozen=True):
    """What the agent senses; see agent.senses.Senses."""

    now_s: float  # simulated time [s]
    position: Triple  # own [m; world frame]
    velocity: Triple  # own [m/s; world frame]
    yaw: float  # own [rad; world frame]
    vehicles: list[Triple]  # sensed, without identity, relative [m; world axes]
    obstacles: list[Triple]  # near points of surfaces, relative [m; world axes]
    neighbours: list[NeighbourRow]  # sorted by id
    mission: MissionRow | None
    loss: float  # share of beacons lost
    latency_s: float  # mean delay of beacons [s]
    reach_m: float | None  # from how far two neighbours were heard [m]; null before any
    inbox: list[ReceivedRow]  # datagrams heard since the last line


class MessageRow(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A datagram to send; see agent.controller.Outgoing. It has a text or data, not both."""

    channel: ChannelName
    text: str | None = None  # sent in UTF-8
    data: bytes | None = None  # in base64


class IntentLine(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What the controller wants; only ``velocity`` must be given. See agent.controller.Intent."""

    velocity: Triple  # to fly now [m/s; world frame]
    wanted: Triple | None = None  # whatever the heading [m/s; world frame]; null: velocity
    yaw: float | None = None  # heading to turn to [rad]; null: as it is
    force: Annotated[float, Meta(ge=0)] | None = None  # null: the length of ``wanted``
    heading_for: Triple | None = None  # [m; world frame]; null: a second ahead
    target: Triple | None = None  # [m; world frame]
    place: tuple[int, int] | None = None  # the queue and rank that it claims
    cost_m: Annotated[float, Meta(ge=0)] = 0.0
    tilt: tuple[float, float] = (0.0, 0.0)  # pitch and roll [rad]
    messages: list[MessageRow] = []  # to send now
    signals: dict[str, float] = {}  # numbers to record, by name
    log: list[str] = []  # lines for the agent's log


class LineError(ProgramError):
    """A line that is no intent; the text says why."""


_encode = msgspec.json.Encoder().encode
_decode_intent = msgspec.json.Decoder(IntentLine).decode


def setup_line(setup: AgentSetup) -> bytes:
    """Return the first line, without its end."""
    return _encode(SetupLine(PROTOCOL, setup))


class SensesLines:
    """Writes one agent's lines of senses. team: size of the team at the start."""

    def __init__(self, team: int) -> None:
        self._team = team
        self._told: int | None = None
        """The key of the mission whose slots were told last."""

    def line(self, senses: Senses) -> bytes:
        """Return a tick's line, without its end."""
        return _encode(
            SensesLine(
                now_s=senses.now_s,
                position=senses.position,
                velocity=senses.velocity,
                yaw=senses.yaw,
                vehicles=list(senses.vehicles),
                obstacles=list(senses.obstacles),
                neighbours=[_neighbour(each) for each in senses.neighbours],
                mission=None if senses.mission is None else self._mission(senses.mission),
                loss=senses.link.loss,
                latency_s=senses.link.latency_s,
                reach_m=senses.link.reach_m if isfinite(senses.link.reach_m) else None,
                inbox=[_received(each) for each in senses.inbox],
            )
        )

    def _mission(self, flown: Flown) -> MissionRow:
        frame, new = flown.frame, flown.key != self._told
        self._told = flown.key
        return MissionRow(
            key=flown.key,
            origin=frame.origin,
            yaw=frame.yaw,
            velocity=frame.velocity,
            formation=flown.formation.name,
            slots=_slots(flown.formation, self._team) if new else None,
        )


def intent_of(line: bytes, senses: Senses) -> tuple[Intent, list[str]]:
    """Return the intent that a line asks for, and its lines for the log. Raises LineError."""
    if not line.strip():
        raise LineError("an empty line instead of an intent")
    try:
        said = _decode_intent(line)
    except msgspec.DecodeError as error:  # of which a ValidationError is one
        raise LineError(f"{error}; the line: {_shown(line)}") from error
    wanted = said.velocity if said.wanted is None else said.wanted
    x, y, z = senses.position
    u, v, w = wanted
    intent = Intent(
        wanted=wanted,
        velocity=said.velocity,
        yaw=senses.yaw if said.yaw is None else said.yaw,
        force=sqrt(u * u + v * v + w * w) if said.force is None else said.force,
        heading_for=(x + u, y + v, z + w) if said.heading_for is None else said.heading_for,
        target=said.target,
        place=None if said.place is None else Place(*said.place),
        cost_m=said.cost_m,
        tilt=said.tilt,
        messages=tuple(map(_outgoing, said.messages)),
        signals=said.signals or NO_SIGNALS,
    )
    return intent, said.log


def hover(senses: Senses) -> Intent:
    """Return the intent to stop and stay, for an agent whose controller has not answered."""
    still: Vector = (0.0, 0.0, 0.0)
    return Intent(still, still, senses.yaw, force=0.0, heading_for=senses.position)


def line_schema() -> Mapping[str, Any]:
    """Return the JSON Schema of all lines: SetupLine, SensesLine and IntentLine."""
    kinds = [SetupLine, SensesLine, IntentLine]
    _, tables = msgspec.json.schema_components(kinds, ref_template="#/$defs/{name}")
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "qswarm controller lines",
        "oneOf": [{"$ref": f"#/$defs/{kind.__name__}"} for kind in kinds],
        "$defs": tables,
    }


def _neighbour(heard: Heard) -> NeighbourRow:
    return NeighbourRow(
        id=heard.id,
        age_s=heard.age_s,
        position=heard.position,
        velocity=heard.velocity,
        target=heard.target,
        place=heard.place,
        hears_me=heard.hears_me,
    )


def _received(received: Received) -> ReceivedRow:
    source, channel, age_s, data = received
    try:
        return ReceivedRow(source, channel, age_s, text=data.decode(), data=None)
    except UnicodeDecodeError:
        return ReceivedRow(source, channel, age_s, text=None, data=data)


def _outgoing(row: MessageRow) -> Outgoing:
    """Return the datagram of a row. Raises LineError where it has not one of text and data."""
    if row.text is not None and row.data is None:
        return Outgoing(row.channel, row.text.encode())
    if row.data is not None and row.text is None:
        return Outgoing(row.channel, row.data)
    raise LineError("a message has either a text or data")


def _slots(formation: Formation, team: int) -> list[SlotRow]:
    layout = formation.layout(team)
    return [SlotRow(place, layout.slots[place].point) for place in layout.places]


def _shown(line: bytes) -> str:
    """Return the beginning of a line, in letters that any terminal shows."""
    return ascii(line[:80].decode("utf-8", "replace"))
