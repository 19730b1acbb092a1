"""The trace of a run: one hash over the poses, commands and radio verdicts of every slot.

A log keeps checksums of the parts beside it, where two runs are to be compared slot by slot.
"""

from hashlib import sha256
from zlib import crc32

from worldsim.truth.vehicle import Vehicles

DOUBLE_B = 8


class TraceLog:
    """Checksums of what goes into a trace, slot by slot."""

    def __init__(self) -> None:
        self.poses: list[list[int]] = []
        """Of each agent's pose, at the start of each slot."""
        self.commands: list[dict[int, int]] = []
        """Of the commands that came in each slot, by agent."""
        self.verdicts: list[int] = []
        """Of the medium's digest at the end of each slot."""

    def begin_slot(self, pose_bytes: bytes) -> None:
        """Begin a slot with the vehicles' positions, then all yaws, then all tilts, as doubles."""
        agents = len(pose_bytes) // (6 * DOUBLE_B)
        checksums = []
        for agent in range(agents):
            checksum, start = 0, 0
            for doubles in (3, 1, 2):
                size = doubles * DOUBLE_B
                part = pose_bytes[start + agent * size : start + (agent + 1) * size]
                checksum = crc32(part, checksum)
                start += agents * size
            checksums.append(checksum)
        self.poses.append(checksums)
        self.commands.append({})


class Trace:
    """Hashes slot after slot; equal runs have equal traces in virtual time and in lockstep."""

    def __init__(self) -> None:
        self._hash = sha256()
        self.log: TraceLog | None = None
        """Set before the first slot to keep checksums of the parts."""

    def poses(self, slot: int, vehicles: Vehicles) -> None:
        """Add the poses at the start of a slot."""
        poses = vehicles.pose_bytes()
        self._hash.update(slot.to_bytes(8, "little") + poses)
        if self.log is not None:
            self.log.begin_slot(poses)

    def command(self, agent: int, command: bytes) -> None:
        """Add one agent's encoded command; agents come in ascending order."""
        self._hash.update(agent.to_bytes(4, "little") + command)
        if self.log is not None:
            self.log.commands[-1][agent] = crc32(command)

    def verdicts(self, digest: bytes) -> None:
        """Add the medium's digest of all verdicts so far."""
        self._hash.update(digest)
        if self.log is not None:
            self.log.verdicts.append(crc32(digest))

    @property
    def sha256(self) -> str:
        """The hash so far, as hexadecimal digits."""
        return self._hash.hexdigest()
