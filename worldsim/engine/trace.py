"""The trace of a run: one hash over the poses, commands and radio verdicts of every slot."""

from hashlib import sha256

from worldsim.truth.vehicle import Vehicles


class Trace:
    """Hashes slot after slot; equal runs have equal traces in virtual time and in lockstep."""

    def __init__(self) -> None:
        self._hash = sha256()

    def poses(self, slot: int, vehicles: Vehicles) -> None:
        """Add the poses at the start of a slot."""
        self._hash.update(slot.to_bytes(8, "little") + vehicles.pose_bytes())

    def command(self, agent: int, command: bytes) -> None:
        """Add one agent's encoded command; agents come in ascending order."""
        self._hash.update(agent.to_bytes(4, "little") + command)

    def verdicts(self, digest: bytes) -> None:
        """Add the medium's digest of all verdicts so far."""
        self._hash.update(digest)

    @property
    def sha256(self) -> str:
        """The hash so far, as hexadecimal digits."""
        return self._hash.hexdigest()
