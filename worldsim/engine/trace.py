"""The trace of a run: one hash over poses, commands and the radio's verdicts of every slot."""

from hashlib import sha256

from worldsim.truth.vehicle import Vehicles


class Trace:
    """Grows slot by slot; equal runs have equal traces, in whichever clock they ran."""

    def __init__(self) -> None:
        self._hash = sha256()

    def poses(self, slot: int, vehicles: Vehicles) -> None:
        """Take the poses at the start of a slot."""
        rows = vehicles.position.tobytes() + vehicles.yaw.tobytes() + vehicles.tilt.tobytes()
        self._hash.update(slot.to_bytes(8, "little") + rows)

    def command(self, agent: int, command: bytes) -> None:
        """Take one agent's command, as it was encoded; agents come in order of their ids."""
        self._hash.update(agent.to_bytes(4, "little") + command)

    def verdicts(self, digest: bytes) -> None:
        """Take the digest of all the medium's verdicts so far."""
        self._hash.update(digest)

    @property
    def sha256(self) -> str:
        """The hash so far, in hexadecimal."""
        return self._hash.hexdigest()
