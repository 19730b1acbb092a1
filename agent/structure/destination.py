"""Where one agent flies now: to its place, or to where it waits until it has one."""

from typing import Final

from agent.places.place_points import OwnTarget
from agent.structure.claim import NO_QUEUE, Claim
from agent.structure.direct_rule import DirectRule
from agent.structure.likely_slot import nearest_slot, slot_by_order, standing_slot
from agent.structure.view import View

PATIENCE_S: Final = 0.3
"""So long an agent without a number stays where it is: most have one by then, and need not turn."""
FAR_M: Final = 2.5
"""Within this distance of its place an agent flies there even if it lies beyond the tail."""


class Destination:
    """One agent's choice of where to fly, in one mission.

    most_members: so many places of a queue are looked at. started_s: when the mission began [s].
    """

    def __init__(
        self, own_id: int, direct: DirectRule, most_members: int, started_s: float
    ) -> None:
        self._own_id, self._direct = own_id, direct
        self._most_members, self._started_s = most_members, started_s

    def choose(self, view: View, claim: Claim) -> OwnTarget | None:
        """Return where to fly. An agent without a claim waits by the nearest place of its queue.

        An agent that stands in any place of it waits there.
        """
        if claim.leads or claim.number > 0:
            return self._shortened(view, claim)
        if claim.queue == NO_QUEUE:
            return None
        slot = standing_slot(view, claim.queue, self._most_members)
        slot = slot or self._direct.guess(view)
        slot = slot or slot_by_order(view, claim.queue, self._own_id)
        if slot is None and view.now_s - self._started_s < PATIENCE_S:
            return None
        slot = slot or nearest_slot(view, claim.queue)
        return OwnTarget(None, slot, False) if slot is not None else None

    def _shortened(self, view: View, claim: Claim) -> OwnTarget | None:
        """Return the target for now: a push may lead past the tail, which is no place to fly to."""
        own = view.target(claim)
        count = view.counts[claim.queue] if claim.number > 0 else 0
        if self._direct.applies or not 0 < count < claim.number:
            return own
        if view.distance(claim.queue, claim.number) <= FAR_M:
            return own
        slot = view.map.slot(claim.queue, count, view.extent(claim.queue, count))
        if own is None or slot is None:
            return own
        return OwnTarget(own.place, slot, own.vertex)
