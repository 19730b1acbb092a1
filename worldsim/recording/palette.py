"""Colours: one for each queue and each tier, so that a viewer sees what belongs together."""

import numpy as np
from numpy.typing import NDArray

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
TIERS = np.array([0xFFD54FFF, 0x7BE0ADFF, 0x4FC3F7FF, 0x7E8CFFFF, 0xC77DFFFF], dtype=np.uint32)
"""From tier 1 on; deeper ones have the last."""
SHARED = np.uint32(0xFFD54FFF)
UNPLACED = np.uint32(0xC8CDD6FF)
DISTRESS = np.uint32(0xFF3B30FF)
DEAD = np.uint32(0x5A5F69FF)
ROLES = {
    "vertex": 0xFFD54FFF,
    "sub-vertex": 0x4FC3F7FF,
    "member": 0x3A5A78FF,
    "distress": 0xFF3B30FF,
    "absent": 0x2A2F38FF,
}
LINK = np.uint32(0x333D4DFF)
LIMIT = np.uint32(0xFF5252FF)
OBSTACLE = np.uint32(0x6F6256FF)


def of_places(place: NDArray[np.int16], shared: NDArray[np.int16]) -> Colours:
    """Return the colours (N,) of agents that mean to hold places (N, 2): queue and rank.

    shared: (K, 2), the places that queues have in common, which have a colour of their own.
    """
    queue = place[:, 0]
    colours = np.where(queue >= 0, QUEUES[queue % len(QUEUES)], UNPLACED)
    at_shared = np.any(np.all(place[:, None, :] == shared[None, :, :], axis=2), axis=1)
    return np.where(at_shared, SHARED, colours).astype(np.uint32)


def of_tiers(tier: NDArray[np.int16]) -> Colours:
    """Return the colours (K,) of agents of tiers 1 and more."""
    return TIERS[np.clip(tier - 1, 0, len(TIERS) - 1)]


def faint(colours: Colours, alpha: int) -> Colours:
    """Return colours with another opacity, 0 to 255."""
    return (colours & np.uint32(0xFFFFFF00)) | np.uint32(alpha)
