"""Missions: what the team shall form, and where its frame goes. The highest key wins everywhere.

Given to one agent, they spread. A key is version * 65536 + origin, so two missions of the same
version are ordered too, everywhere alike. Every beacon tells which mission its sender flies, and
where the frame is; the mission itself follows in pieces on the multihop channel, as long as
somebody who is heard lags behind.

Who has the mission knows the frame's path, and says where the frame is at the time of each beacon.
Who has only heard where the frame was passes that on as it was said, stamp and all, down the tiers:
the newest stamp wins, and everybody carries the frame forward from there by itself.
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

ORIGINS = AGENT_IDS
MAX_TOLD_B = 4 * PIECE_B
FORWARD_S = 5.0
"""So long a frame that was only heard of is carried forward; then it is taken to stand."""


class _Told(Message, frozen=True):
    """What travels in pieces: where the frame goes, and the formation as msgpack."""

    frame: FramePath
    formation: bytes


class Glimpse:
    """A frame that was heard of: where it was at a stamp, and how it moved then."""

    def __init__(self, pose: Pose, drift: Drift | None) -> None:
        self.pose = pose
        self.drift = drift
        self.rests = drift is None

    def at(self, time_s: float) -> Frame:
        """Return the frame at a time [s]."""
        pose, drift = self.pose, self.drift
        age_s = time_s - drift.stamp_s if drift is not None else 0.0
        if drift is None or age_s > FORWARD_S:
            return Frame(pose[:3], pose.yaw)
        t, velocity = max(0.0, age_s), (drift.x, drift.y, drift.z)
        origin = (pose.x + t * drift.x, pose.y + t * drift.y, pose.z + t * drift.z)
        return Frame(origin, pose.yaw + t * drift.yaw_rate, velocity, drift.yaw_rate)


class Missions:
    """The mission of one agent, and those it is about to learn.

    spacing: d_ir [m], which a formation's geometry needs; path: the frame's, to begin with.
    """

    def __init__(
        self, own_id: int, formation: FormationSpec, spacing: float, path: FramePath = AT_HOME
    ) -> None:
        self._own_id = own_id
        self._spacing = spacing
        self._encoded = encode_formation(formation)
        self._pieces: dict[int, dict[int, bytes]] = {}
        self._path = path
        self._frame: Track | Glimpse = Track(path)
        self._resting: tuple[Frame, Pose] | None = None
        self.frame_key = 0
        self.flown = Flown(0, Formation(formation, spacing), self._frame.at(0.0))

    def flown_at(self, time_s: float) -> Flown:
        """Return what is flown, with the frame as it is at a time [s; of Observations]."""
        if not self._frame.rests:
            self.flown = self.flown._replace(frame=self._frame.at(time_s))
        return self.flown

    def order(self, mission: Mission) -> None:
        """Take an operator's order, or raise RejectedError: an old key, or no formation."""
        key = mission.key or (self.flown.key // ORIGINS + 1) * ORIGINS + self._own_id
        self._adopt(key, mission.frame, mission.formation or self._encoded)

    def hear(self, piece: Piece) -> None:
        """Take a piece of a mission; once all are there, fly it. Raises RejectedError."""
        if piece.key <= self.flown.key or piece.index >= piece.count:
            return
        self._pieces = {key: have for key, have in self._pieces.items() if key >= piece.key}
        have = self._pieces.setdefault(piece.key, {})
        have[piece.index] = piece.data
        if len(have) == piece.count:
            del self._pieces[piece.key]
            told = decode(b"".join(have[k] for k in sorted(have)), _Told, MAX_TOLD_B)
            self._adopt(piece.key, told.frame, told.formation)

    def pieces(self) -> list[Piece]:
        """Return the present mission in pieces, for those who lag behind."""
        told = encode(_Told(frame=self._path, formation=self._encoded))
        parts = [told[at : at + PIECE_B] for at in range(0, len(told), PIECE_B)]
        key = self.flown.key
        return [
            Piece(key=key, index=index, count=len(parts), data=part)
            for index, part in enumerate(parts)
        ]

    def _is_news(self, beacon: Beacon) -> bool:
        """Whether a beacon knows better where the frame is: by a newer mission, or a newer look."""
        key, drift = beacon.frame_key, beacon.drift
        if key != self.frame_key or drift is None:
            return key > self.frame_key
        mine = self._frame
        match mine:
            case Track():
                return False
            case Glimpse():
                return mine.drift is not None and drift.stamp_s > mine.drift.stamp_s
            case _:
                assert_never(mine)

    def glimpse(self, beacon: Beacon) -> None:
        """Take the frame from a beacon where that is news, before its mission has come.

        So a frame that moves comes down the tiers at the local channel's rate. Raises
        RejectedError for a look at it that is newer than the beacon.
        """
        if not self._is_news(beacon):
            return
        if beacon.drift is not None and beacon.drift.stamp_s > beacon.stamp_s:
            raise RejectedError("future", "a frame seen after the beacon that tells of it")
        self.frame_key = beacon.frame_key
        self._follow(Glimpse(beacon.frame, beacon.drift), beacon.stamp_s)

    def told(self, now_s: float) -> tuple[Pose, Drift | None]:
        """Return what a beacon says of the frame."""
        if isinstance(self._frame, Glimpse):
            return self._frame.pose, self._frame.drift
        frame = self.flown.frame
        if self._frame.rests:
            if self._resting is None or self._resting[0] is not frame:
                self._resting = frame, Pose(*frame.origin, frame.yaw)
            return self._resting[1], None
        pose = Pose(*frame.origin, frame.yaw)
        x, y, z = frame.velocity
        return pose, Drift(stamp_s=now_s, x=x, y=y, z=z, yaw_rate=frame.yaw_rate)

    def _adopt(self, key: int, path: FramePath, encoded: bytes) -> None:
        if key <= self.flown.key:
            raise RejectedError("mission", f"key {key} is not newer than {self.flown.key}")
        formation = self.flown.formation
        if encoded != self._encoded:
            formation = self._formation(encoded)
        self._encoded, self._path = encoded, path
        self.flown = Flown(key, formation, self.flown.frame)
        if key >= self.frame_key:
            self.frame_key = key
            self._follow(Track(path), path.start_s)

    def _follow(self, frame: Track | Glimpse, time_s: float) -> None:
        """Fly by another frame from now on; one that stands as before stays the same object."""
        self._frame = frame
        here, now = self.flown.frame, frame.at(time_s)
        if here.moves or now.moves or (here.origin, here.yaw) != (now.origin, now.yaw):
            self.flown = self.flown._replace(frame=now)

    def _formation(self, encoded: bytes) -> Formation:
        try:
            return Formation(decode_formation(encoded), self._spacing)
        except (FormationError, msgspec.ValidationError) as error:
            raise RejectedError("mission", str(error)) from error
