"""The radio's two channels and its payload limit: the one declaration for the medium and agents.

It imports only the standard library, so that the agent's pure core may import it.
"""

from typing import Final, Literal

Channel = Literal[0, 1]
LOCAL: Final = 0
"""High-frequency, short-term channel: heard directly, never forwarded (paper, Sec. 3 (ii))."""
MULTIHOP: Final = 1
"""Low-frequency, long-term channel: records that agents pass on (paper, Sec. 3 (i))."""
NUMBERS: tuple[Channel, ...] = (LOCAL, MULTIHOP)
ChannelName = Literal["local", "multihop"]
CHANNELS: tuple[ChannelName, ChannelName] = ("local", "multihop")
"""Names of the channels, by channel number."""

MAX_PAYLOAD_B = 1200
"""Longest payload of one frame [B], the checksum of agent.codec included."""
