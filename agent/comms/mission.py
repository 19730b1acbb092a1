"""Missions: what the team shall form. Given to one agent, they spread; the highest key wins.

A key is version * 65536 + origin, so two missions of the same version are ordered too, everywhere
alike. Every beacon tells which mission its sender flies, and where the frame stands; the formation
itself follows in pieces on the multihop channel, as long as somebody who is heard lags behind.
"""

import msgspec

from agent.codec import RejectedError, decode_formation, encode_formation
from agent.controller import Flown
from agent.messages import HOME, Beacon, Mission, Piece, Pose
from agent.qstructure.formation import Formation, FormationError, FormationSpec
from agent.qstructure.frame import Frame

ORIGINS = 2**16
PIECE_B = 900


class Missions:
    """The mission of one agent, and those it is about to learn.

    spacing: d_ir [m], which a formation's geometry needs.
    """

    def __init__(self, own_id: int, formation: FormationSpec, spacing: float) -> None:
        self._own_id = own_id
        self._spacing = spacing
        self._encoded = encode_formation(formation)
        self._pieces: dict[int, dict[int, bytes]] = {}
        self.frame_key = 0
        self.pose = HOME
        self.flown = Flown(0, Formation(formation, spacing), Frame())

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
            self._adopt(piece.key, piece.frame, b"".join(have[k] for k in sorted(have)))

    def pieces(self) -> list[Piece]:
        """Return the present mission in pieces, for those who lag behind."""
        count = max(1, -(-len(self._encoded) // PIECE_B))
        return [
            Piece(
                self.flown.key,
                self.pose,
                index,
                count,
                self._encoded[index * PIECE_B : (index + 1) * PIECE_B],
            )
            for index in range(count)
        ]

    def glimpse(self, beacon: Beacon) -> None:
        """Take the frame of a newer mission from a beacon, before its formation has come.

        So a frame that moves comes down the tiers at the local channel's rate.
        """
        if beacon.frame_key > self.frame_key:
            self.frame_key = beacon.frame_key
            self._move(beacon.frame)

    def _adopt(self, key: int, pose: Pose, encoded: bytes) -> None:
        if key <= self.flown.key:
            raise RejectedError("mission", f"key {key} is not newer than {self.flown.key}")
        formation = self.flown.formation
        if encoded != self._encoded:
            formation = self._formation(encoded)
        self._encoded = encoded
        self.flown = Flown(key, formation, self.flown.frame)
        if key >= self.frame_key:
            self.frame_key = key
            self._move(pose)

    def _move(self, pose: Pose) -> None:
        if pose != self.pose:
            self.pose = pose
            self.flown = self.flown._replace(frame=Frame(pose[:3], pose.yaw))

    def _formation(self, encoded: bytes) -> Formation:
        try:
            return Formation(decode_formation(encoded), self._spacing)
        except (FormationError, msgspec.ValidationError) as error:
            raise RejectedError("mission", str(error)) from error
