"""Missions: the formation that the team forms, and the path of its frame. The highest key wins.

Who is briefed flies the mission of key 0 from the start. Everybody else flies none until it has
heard one: it knows neither formation nor frame. An operator gives a mission to one agent; it
spreads from there. A key is version * KEYS_PER_VERSION
+ origin, the id of the agent that numbered it (the world's origin is 0), so two missions of one
version are ordered alike in all agents. Every beacon says which mission its sender flies, and where
the frame is. The mission itself follows in pieces on the multihop channel, as long as a neighbour
flies an older one or none.

An agent that has the mission computes the frame from its path, and reports the frame at the time of
each beacon. An agent of an older mission that has only heard of the frame passes on the report
unchanged, with its stamp, down the tiers. The newest stamp wins, and each agent extrapolates the
frame from there. An agent without a mission only keeps pace with a frame that it hears from a
neighbour with a tier, and passes nothing on.

A key heard by radio may not run ahead of the time (``is_plausible``), so whatever key a member
invents, the operator's next mission has a higher one. Every mission passes the one check of
``mission_check`` before it is flown. The pieces of one sender make a mission, so no other member
can spoil it.
"""

from __future__ import annotations

from typing import Final, NamedTuple, assert_never

from agent.codec import decode, decode_formation, encode, encode_formation
from agent.comms.reported_frame import FrameFromTiers, ReportedFrame, check_stamp
from agent.controller import Flown, HeardFrame
from agent.heard_beacon import HeardBeacon
from agent.messages import (
    AGENT_IDS,
    AT_HOME,
    HOME,
    MAX_TEAM,
    NO_MISSION,
    PIECE_B,
    AllocationKind,
    Drift,
    FramePath,
    Mission,
    MissionData,
    Piece,
    Pose,
)
from agent.qstructure.formation import Formation, FormationError, FormationSpec, formation_of
from agent.qstructure.frame_path import Track
from agent.qstructure.mission_check import MissionError, check_drift, check_mission
from agent.qstructure.target_frame import Frame
from agent.rejection import RejectedError

KEYS_PER_VERSION = AGENT_IDS
MAX_MISSION_B = 4 * PIECE_B
FIRST_VERSIONS: Final = 1000
VERSIONS_PER_S: Final = 10.0
"""Most versions that a team can have had by a time: so many at once, and so many in a second."""
FRAME_VERSIONS_AHEAD: Final = 16
"""A frame whose mission has not arrived is at most so many missions ahead. An invented one spreads
as a true one does, so few versions must be enough to supersede it."""
DEAF_S: Final = 0.5
DEAF_AFTER_REJECTION_S: Final = 10.0
"""How long the pieces of a sender are ignored after a mission of it was taken, or rejected: it may
not occupy a receiver with one mission after the other."""


def last_version(time_s: float) -> int:
    """Return the highest version that a team can have had by a time [s; Observation time]."""
    return FIRST_VERSIONS + int(VERSIONS_PER_S * time_s)


def is_plausible(key: int, time_s: float) -> bool:
    """Whether a team can have a mission with this key at a time [s; Observation time]."""
    return key // KEYS_PER_VERSION <= last_version(time_s)


def _check_key(key: int, time_s: float) -> None:
    if not is_plausible(key, time_s):
        raise RejectedError("mission", f"no team can have had so many missions: {key}")


class _Pieces(NamedTuple):
    """The pieces of a mission that have arrived from one sender."""

    key: int
    number: int  # of pieces in all
    parts: dict[int, bytes]


class Missions:
    """The mission that one agent flies, and those that it is receiving.

    formation, path: of the frame, both as briefed; without a formation it flies none until it hears
    one. spacing: d_ir of the formation [m]; ids: number of agent ids.
    """

    def __init__(
        self,
        own_id: int,
        formation: FormationSpec | None,
        spacing: float,
        path: FramePath = AT_HOME,
        ids: int = MAX_TEAM,
        allocation: AllocationKind = "structure",
    ) -> None:
        self._own_id = own_id
        self._allocation: AllocationKind = allocation
        self._spacing = spacing
        self._team = min(ids, MAX_TEAM)
        self._deaf_until_s: dict[int, float] = {}
        """Until when the pieces of each sender are ignored [s]."""
        self._encoded = encode_formation(formation) if formation is not None else b""
        self._pieces: dict[int, _Pieces] = {}
        """What has arrived from each sender."""
        self._path = path
        self._frame: Track | ReportedFrame = Track(path)
        self._resting: tuple[Frame, Pose] | None = None
        self._from_tiers = FrameFromTiers()
        self.frame_key = NO_MISSION
        self.flown: Flown | None = None
        if formation is not None:
            self.frame_key = 0
            self.flown = Flown(0, formation_of(formation, spacing), self._frame.at(0.0))

    def forget_times(self) -> None:
        """Begin anew after a jump of the own clock; the mission flown stays."""
        self._deaf_until_s = {}
        self._pieces = {}
        self._from_tiers = FrameFromTiers()

    @property
    def key(self) -> int:
        """The key of the mission flown; NO_MISSION for none."""
        return self.flown.key if self.flown is not None else NO_MISSION

    def flown_at(self, time_s: float) -> Flown | None:
        """Return the mission flown, with its frame at a time [s; Observation time]."""
        if self.flown is not None and not self._frame.rests:
            self.flown = self.flown._replace(frame=self._frame.at(time_s))
        return self.flown

    def heard_frame_at(self, time_s: float) -> HeardFrame | None:
        """Return the frame that an agent without a mission keeps pace with at a time [s]."""
        return self._from_tiers.at(time_s) if self.flown is None else None

    def accept_order(self, mission: Mission) -> None:
        """Take an operator's order; raise RejectedError for an old key or an invalid formation."""
        version = max(self.key, 0) // KEYS_PER_VERSION + 1
        key = mission.key or version * KEYS_PER_VERSION + self._own_id
        encoded = mission.formation or self._encoded
        if not encoded:
            raise RejectedError("mission", "a frame alone, for an agent without a formation")
        self._adopt(key, mission.frame, encoded)

    def receive(self, piece: Piece, sender: int, now_s: float) -> None:
        """Take a piece of a mission; with the sender's last piece, fly it. Raises RejectedError."""
        if piece.key <= self.key or piece.index >= piece.count:
            return
        if now_s < self._deaf_until_s.get(sender, 0.0):
            return
        _check_key(piece.key, now_s)
        collected = self._pieces.get(sender)
        if collected is None or collected.key != piece.key or collected.number != piece.count:
            collected = self._pieces[sender] = _Pieces(piece.key, piece.count, {})
        collected.parts[piece.index] = piece.data
        if len(collected.parts) == piece.count:
            del self._pieces[sender]
            self._deaf_until_s[sender] = now_s + DEAF_AFTER_REJECTION_S
            encoded = b"".join(collected.parts[k] for k in sorted(collected.parts))
            data = decode(encoded, MissionData, MAX_MISSION_B)
            self._adopt(piece.key, data.frame, data.formation)
            self._deaf_until_s[sender] = now_s + DEAF_S

    def pieces(self) -> list[Piece]:
        """Return the present mission in pieces, for neighbours that fly an older one or none."""
        data = encode(MissionData(frame=self._path, formation=self._encoded))
        parts = [data[at : at + PIECE_B] for at in range(0, len(data), PIECE_B)]
        return [
            Piece(key=self.key, index=index, count=len(parts), data=part)
            for index, part in enumerate(parts)
        ]

    def receive_frame(self, beacon: HeardBeacon) -> None:
        """Take the frame from a beacon if it is newer, before its mission has arrived.

        So a moving frame spreads down the tiers at the local channel's rate. An agent without a
        mission keeps it apart: it reports no frame. Raises RejectedError for a frame with a stamp
        later than the beacon's, or of an impossible mission.
        """
        if self.flown is None:
            _check_key(beacon.frame_key, beacon.stamp_s)
            self._from_tiers.receive(beacon)
            return
        if not self._is_newer(beacon):
            return
        check_stamp(beacon)
        ahead = beacon.frame_key // KEYS_PER_VERSION - self.flown.key // KEYS_PER_VERSION
        if ahead > FRAME_VERSIONS_AHEAD:
            detail = f"a frame {ahead} missions ahead of the one flown; the mission comes first"
            raise RejectedError("mission", detail)
        self._check_drift(self.flown.formation, beacon.drift)
        self.frame_key = beacon.frame_key
        self._set_frame(self.flown, ReportedFrame(beacon.frame, beacon.drift), beacon.stamp_s)

    def _is_newer(self, beacon: HeardBeacon) -> bool:
        """Whether a beacon's frame is of a newer mission, or of the same one with a newer stamp."""
        key, drift = beacon.frame_key, beacon.drift
        if key != self.frame_key or drift is None:
            return key > self.frame_key
        own = self._frame
        match own:
            case Track():
                return False
            case ReportedFrame():
                return own.drift is not None and drift.stamp_s > own.drift.stamp_s
            case _:
                assert_never(own)

    def frame_report(self, now_s: float) -> tuple[Pose, Drift | None]:
        """Return the frame as a beacon reports it now."""
        if self.flown is None:
            return HOME, None
        match self._frame:
            case ReportedFrame(pose=pose, drift=drift):
                return pose, drift
            case Track(rests=True):
                return self._resting_pose(self.flown.frame), None
            case Track():
                frame = self.flown.frame
                x, y, z = frame.velocity
                drift = Drift(stamp_s=now_s, x=x, y=y, z=z, yaw_rate=frame.yaw_rate)
                return Pose(*frame.origin, frame.yaw), drift
            case _:
                assert_never(self._frame)

    def _resting_pose(self, frame: Frame) -> Pose:
        if self._resting is None or self._resting[0] is not frame:
            self._resting = frame, Pose(*frame.origin, frame.yaw)
        return self._resting[1]

    def _adopt(self, key: int, path: FramePath, encoded: bytes) -> None:
        if key <= self.key:
            raise RejectedError("mission", f"key {key} is not newer than {self.key}")
        flown = self.flown
        known = flown is not None and encoded == self._encoded
        formation = flown.formation if flown is not None and known else self._formation(encoded)
        try:
            check_mission(formation, path, self._team, self._allocation)
        except MissionError as error:
            raise RejectedError("mission", str(error)) from error
        if key < self.frame_key and isinstance(self._frame, ReportedFrame):
            self._check_drift(formation, self._frame.drift)
        self._encoded, self._path = encoded, path
        frame = flown.frame if flown is not None else Track(path).at(path.start_s)
        self.flown = Flown(key, formation, frame, self.frame_key)
        if key >= self.frame_key:
            self.frame_key = key
            self._set_frame(self.flown, Track(path), path.start_s)

    def _set_frame(self, flown: Flown, frame: Track | ReportedFrame, time_s: float) -> None:
        """Fly by another frame from now on; a resting frame that is equal stays the same object."""
        self._frame = frame
        here, now = flown.frame, frame.at(time_s)
        if here.moves or now.moves or (here.origin, here.yaw) != (now.origin, now.yaw):
            here = now
        self.flown = flown._replace(frame=here, frame_key=self.frame_key)

    def _check_drift(self, formation: Formation, drift: Drift | None) -> None:
        try:
            if drift is not None:
                check_drift(formation, drift, self._team)
        except MissionError as error:
            raise RejectedError("mission", str(error)) from error

    def _formation(self, encoded: bytes) -> Formation:
        try:
            return formation_of(decode_formation(encoded), self._spacing)
        except FormationError as error:
            raise RejectedError("mission", str(error)) from error
