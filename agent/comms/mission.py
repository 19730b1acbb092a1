"""Missions: the formation that the team forms, and the path of its frame. The highest key wins.

An operator gives a mission to one agent; it spreads from there. A key is version * KEYS_PER_VERSION
+ origin, the id of the agent that numbered it (the world's origin is 0), so two missions of one
version are ordered alike in all agents. Every beacon says which mission its sender flies, and where
the frame is. The mission itself follows in pieces on the multihop channel, as long as a neighbour
flies an older one.

An agent that has the mission computes the frame from its path, and reports the frame at the time of
each beacon. An agent that has only heard of the frame passes on the report unchanged, with its
stamp, down the tiers. The newest stamp wins, and each agent extrapolates the frame from there.
"""

from __future__ import annotations

from typing import assert_never

import msgspec

from agent.codec import RejectedError, decode, decode_formation, encode, encode_formation
from agent.controller import Flown
from agent.messages import (
    AGENT_IDS,
    AT_HOME,
    PIECE_B,
    Beacon,
    Drift,
    FramePath,
    Message,
    Mission,
    Piece,
    Pose,
)
from agent.qstructure.formation import Formation, FormationError, FormationSpec
from agent.qstructure.frame_path import Track
from agent.qstructure.target_frame import Frame

KEYS_PER_VERSION = AGENT_IDS
MAX_MISSION_B = 4 * PIECE_B
MAX_EXTRAPOLATION_S = 5.0
"""A reported frame is extrapolated for this long; then it counts as at rest."""


class _MissionData(Message, frozen=True):
    """What travels in pieces."""

    frame: FramePath
    formation: bytes  # a FormationSpec as msgpack


class ReportedFrame:
    """A frame known only from a beacon: its pose at a stamp, and its velocity then."""

    def __init__(self, pose: Pose, drift: Drift | None) -> None:
        self.pose = pose
        self.drift = drift
        self.rests = drift is None

    def at(self, time_s: float) -> Frame:
        """Return the frame at a time [s]."""
        pose, drift = self.pose, self.drift
        age_s = time_s - drift.stamp_s if drift is not None else 0.0
        if drift is None or age_s > MAX_EXTRAPOLATION_S:
            return Frame(pose[:3], pose.yaw)
        t, velocity = max(0.0, age_s), (drift.x, drift.y, drift.z)
        origin = (pose.x + t * drift.x, pose.y + t * drift.y, pose.z + t * drift.z)
        return Frame(origin, pose.yaw + t * drift.yaw_rate, velocity, drift.yaw_rate)


class Missions:
    """The mission that one agent flies, and those that it is receiving.

    spacing: d_ir of the formation [m]; path: of the frame at the start.
    """

    def __init__(
        self, own_id: int, formation: FormationSpec, spacing: float, path: FramePath = AT_HOME
    ) -> None:
        self._own_id = own_id
        self._spacing = spacing
        self._encoded = encode_formation(formation)
        self._pieces: dict[int, dict[int, bytes]] = {}
        self._path = path
        self._frame: Track | ReportedFrame = Track(path)
        self._resting: tuple[Frame, Pose] | None = None
        self.frame_key = 0
        self.flown = Flown(
            key=0, formation=Formation(formation, spacing), frame=self._frame.at(0.0)
        )

    def flown_at(self, time_s: float) -> Flown:
        """Return the mission flown, with its frame at a time [s; Observation time]."""
        if not self._frame.rests:
            self.flown = self.flown._replace(frame=self._frame.at(time_s))
        return self.flown

    def accept_order(self, mission: Mission) -> None:
        """Take an operator's order; raise RejectedError for an old key or an invalid formation."""
        version = self.flown.key // KEYS_PER_VERSION + 1
        key = mission.key or version * KEYS_PER_VERSION + self._own_id
        self._adopt(key, mission.frame, mission.formation or self._encoded)

    def receive(self, piece: Piece) -> None:
        """Take a piece of a mission; with the last piece, fly it. Raises RejectedError."""
        if piece.key <= self.flown.key or piece.index >= piece.count:
            return
        self._pieces = {key: parts for key, parts in self._pieces.items() if key >= piece.key}
        parts = self._pieces.setdefault(piece.key, {})
        parts[piece.index] = piece.data
        if len(parts) == piece.count:
            del self._pieces[piece.key]
            data = decode(b"".join(parts[k] for k in sorted(parts)), _MissionData, MAX_MISSION_B)
            self._adopt(piece.key, data.frame, data.formation)

    def pieces(self) -> list[Piece]:
        """Return the present mission in pieces, for neighbours that fly an older one."""
        data = encode(_MissionData(frame=self._path, formation=self._encoded))
        parts = [data[at : at + PIECE_B] for at in range(0, len(data), PIECE_B)]
        return [
            Piece(key=self.flown.key, index=index, count=len(parts), data=part)
            for index, part in enumerate(parts)
        ]

    def receive_frame(self, beacon: Beacon) -> None:
        """Take the frame from a beacon if it is newer, before its mission has arrived.

        So a moving frame spreads down the tiers at the local channel's rate. Raises RejectedError
        for a frame with a stamp later than the beacon's.
        """
        if not self._is_newer(beacon):
            return
        if beacon.drift is not None and beacon.drift.stamp_s > beacon.stamp_s:
            raise RejectedError("future", "the frame's stamp is later than the beacon's")
        self.frame_key = beacon.frame_key
        self._set_frame(ReportedFrame(beacon.frame, beacon.drift), beacon.stamp_s)

    def _is_newer(self, beacon: Beacon) -> bool:
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
        if key <= self.flown.key:
            raise RejectedError("mission", f"key {key} is not newer than {self.flown.key}")
        formation = self.flown.formation
        if encoded != self._encoded:
            formation = self._formation(encoded)
        self._encoded, self._path = encoded, path
        self.flown = Flown(key=key, formation=formation, frame=self.flown.frame)
        if key >= self.frame_key:
            self.frame_key = key
            self._set_frame(Track(path), path.start_s)

    def _set_frame(self, frame: Track | ReportedFrame, time_s: float) -> None:
        """Fly by another frame from now on; a resting frame that is equal stays the same object."""
        self._frame = frame
        here, now = self.flown.frame, frame.at(time_s)
        if here.moves or now.moves or (here.origin, here.yaw) != (now.origin, now.yaw):
            self.flown = self.flown._replace(frame=now)

    def _formation(self, encoded: bytes) -> Formation:
        try:
            return Formation(decode_formation(encoded), self._spacing)
        except (FormationError, msgspec.ValidationError) as error:
            raise RejectedError("mission", str(error)) from error
