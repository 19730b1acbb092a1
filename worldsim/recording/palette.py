"""Colours of the viewer, as 0xRRGGBBAA: one for each queue, tier and role."""

from colorsys import hsv_to_rgb
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agent.messages import DISTRESS, MEMBER, ROLES, SUB_VERTEX, VERTEX

Colours = NDArray[np.uint32]

QUEUES = np.array(
    [
        0x4DA3FFFF,
        0xFF8A4CFF,
        0x3DDC97FF,
        0xE86BFFFF,
        0x41E0E6FF,
        0xFF6B81FF,
        0xB6E34BFF,
        0x9D8CFFFF,
    ],
    dtype=np.uint32,
)
QUEUE_COLOUR_NAMES = ("blue", "orange", "green", "magenta", "cyan", "pink", "lime", "violet")
"""The colours of QUEUES in words."""
_GOLD, _BLUE, _RED = 0xFFD54FFF, 0x4FC3F7FF, 0xFF3B30FF
TIERS = np.array([_GOLD, 0xFFF0B8FF, 0xE4E7ECFF, 0xA9B4C4FF], dtype=np.uint32)
"""Tier 1 first; all deeper tiers have the last colour. None is the colour of a queue."""
SHARED_VERTEX = np.uint32(_GOLD)
UNPLACED = np.uint32(0xC8CDD6FF)
IN_DISTRESS = np.uint32(_RED)
NOT_RUNNING = np.uint32(0x8A909CFF)
LINK = np.uint32(0x5B6B82FF)
LINK_LOST = np.uint32(0xD9A441FF)
LINK_CUT = np.uint32(0x9E3040FF)
LINK_OUT_OF_RANGE = np.uint32(0x55406EFF)
JAM = np.uint32(0xFF5C8A60)
PAUSED = np.uint32(0xA8AFBAFF)
DEAD = np.uint32(0x0B0C0EFF)
DEAD_CROSS = np.uint32(0xF2F4F7FF)
SIDES = np.array([0xFFFFFFFF, 0x77839AFF, 0xFFE0C2FF, 0xBCEBF2FF], dtype=np.uint32)
"""Of partitions, A first: pale, so that none is taken for a queue."""
HEADING = np.uint32(0xE6EAF0FF)
GUIDANCE = np.uint32(0x9BA8B8FF)
BOBBER = np.uint32(0xFFF176FF)
CONSTELLATION = np.uint32(0x80CBC4FF)
BELIEF = np.uint32(0xD7B8F5FF)
SENSED = np.uint32(0x4DD0E1FF)
LIMIT = np.uint32(0xFF5252FF)
OBSTACLE = np.uint32(0x6F6256FF)
GROUND = np.uint32(0x222A37FF)

ABSENT = "absent"
"""The role shown of an agent that is not running (dead, paused or booting)."""
NO_PLACE = "no place"
"""The role shown of an agent in a team that forms nothing."""
ROLE_COLOURS = {
    ROLES[VERTEX]: _GOLD,
    ROLES[SUB_VERTEX]: _BLUE,
    ROLES[MEMBER]: 0x3A5A78FF,
    ROLES[DISTRESS]: _RED,
    ABSENT: 0x2A2F38FF,
    NO_PLACE: int(UNPLACED),
}


def queue_colours(queues: NDArray[np.integer[Any]]) -> Colours:
    """Return the colours (Q,) of queues, given by their indices; they repeat after the last."""
    colours: Colours = QUEUES[queues % len(QUEUES)]
    return colours


def agent_colours(agents: int) -> Colours:
    """Return a colour for each of N agents (N,): hues by the golden angle, as far apart as any."""
    colours = [
        hsv_to_rgb((0.58 + 0.618034 * agent) % 1.0, (0.62, 0.38)[agent // 8 % 2], 1.0)
        for agent in range(agents)
    ]
    red, green, blue = np.rint(255.0 * np.array(colours)).astype(np.uint32).T
    packed: Colours = (red << 24) | (green << 16) | (blue << 8) | np.uint32(0xFF)
    return packed


def place_colours(place: NDArray[np.int16], shared: NDArray[np.int16]) -> Colours:
    """Return the colours (N,) of agents that claim places (N, 2): queue and rank.

    shared: (K, 2), the places that belong to several queues; they have a colour of their own.
    """
    queue = place[:, 0]
    colours = np.where(queue >= 0, queue_colours(queue), UNPLACED)
    at_shared = np.isin(_numbers(place), _numbers(shared))
    return np.where(at_shared, SHARED_VERTEX, colours).astype(np.uint32)


def _numbers(place: NDArray[np.int16]) -> NDArray[np.int32]:
    """Return a number for each place (N,), no two the same: they are compared faster."""
    wide = place.astype(np.int32)
    numbers: NDArray[np.int32] = wide[:, 0] * 2**16 + wide[:, 1]
    return numbers


def tier_colours(tier: NDArray[np.int16]) -> Colours:
    """Return the colours (K,) of agents in tiers of 1 and more."""
    return TIERS[np.clip(tier - 1, 0, len(TIERS) - 1)]


def side_colours(side: NDArray[np.integer[Any]]) -> Colours:
    """Return the colours (K,) of sides of a partition; they repeat after the last."""
    colours: Colours = SIDES[side % len(SIDES)]
    return colours


def with_opacity(colours: Colours, alpha: int) -> Colours:
    """Return colours with another opacity, 0 to 255."""
    return (colours & np.uint32(0xFFFFFF00)) | np.uint32(alpha)
