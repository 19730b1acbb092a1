"""A witness of foreign agents' frames: it says which of them no agent would take.

Who hears a frame rejects one that is malformed, of a wrong id, or of a wrong time; what is counted
there tells not whose fault that is, for a saboteur sends by an agent's radio as well. The witness
hears what an agent's own process sends, before the radio does anything to it.
"""

from typing import Final, assert_never

from agent.codec import decode_datagram, decode_gossip, hear_beacon, holds_datagram
from agent.comms.neighbours import MAX_AGE_S, Neighbours
from agent.core import IMPLAUSIBLE_SPEEDS
from agent.rejection import RejectedError
from agent.vectors import apart
from netem.wire.channels import LOCAL, MULTIHOP
from netem.wire.frame import Outgoing
from worldsim.scenario.tables import Scenario

NOBODY: Final = -1
"""The witness is no agent."""
ORIGIN: Final = (0.0, 0.0, 0.0)


class FrameWitness:
    """Hears each frame as a member of a scenario's team does that it reaches at once."""

    def __init__(self, scenario: Scenario) -> None:
        self._foreign = frozenset(scenario.commands)
        self._slack_s = 2.0 / scenario.fleet.tick_hz
        fastest_mps = max(vehicle.max_speed_mps for vehicle in scenario.vehicles)
        self._implausible_mps = IMPLAUSIBLE_SPEEDS * fastest_mps
        self._neighbours = Neighbours(NOBODY, scenario.comms.local_hz, self._slack_s)

    def watches(self, agent: int) -> bool:
        """Return whether an agent is a foreign one."""
        return agent in self._foreign

    def refusal(self, sender: int, frame: Outgoing, sent_s: float) -> str | None:
        """Return the cause for which a frame is rejected; None where it is accepted.

        sent_s: when it is sent [s; simulated time].
        """
        try:
            self._hear(sender, frame, sent_s)
        except RejectedError as error:
            return error.cause
        return None

    def _hear(self, sender: int, frame: Outgoing, now_s: float) -> None:
        """Raise RejectedError for a frame that an agent would reject."""
        channel, payload = frame.channel, frame.payload
        if holds_datagram(payload):
            self._check_stamp(decode_datagram(payload).stamp_s, now_s)
        elif channel == LOCAL:
            beacon = hear_beacon(payload)
            _check_id(beacon.id, sender)
            if apart(beacon.velocity, ORIGIN) > self._implausible_mps:
                raise RejectedError("speed", f"agent {sender} is too fast")
            self._neighbours.receive(beacon, now_s, {})
        elif channel == MULTIHOP:
            gossip = decode_gossip(payload)
            _check_id(gossip.id, sender)
            self._check_stamp(gossip.stamp_s, now_s)
        else:
            assert_never(channel)

    def _check_stamp(self, stamp_s: float, now_s: float) -> None:
        if stamp_s > now_s + self._slack_s:
            raise RejectedError("future", f"the stamp is {stamp_s - now_s:.3f} s ahead")
        if now_s - stamp_s > MAX_AGE_S:
            raise RejectedError("old", f"the stamp is {now_s - stamp_s:.3f} s old")


def _check_id(told: int, sender: int) -> None:
    if told != sender:
        raise RejectedError("spoofed", f"a frame of agent {sender} with the id {told}")
