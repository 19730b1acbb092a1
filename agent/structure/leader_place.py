"""Where a leader stands: in its vertex, or in its queue while a vehicle has taken that (E18).

In a team that is smaller than the number of vertices some leaders have no place in theirs.
"""

from math import inf

from agent.structure.claim import Claim
from agent.structure.direct_rule import DirectRule
from agent.structure.numbers import Numbers
from agent.structure.view import View

CERTAIN_S, CERTAIN_HOPS = 0.5, 2.0
"""A leader leaves its vertex, or returns to it, once it has been taken, or free, for so long, and
for as long as news of it takes over so many hops."""


class LeaderPlace:
    """One agent's choice between its vertex and a number in its queue, while it leads."""

    def __init__(self, numbers: Numbers, direct: DirectRule) -> None:
        self._numbers, self._direct = numbers, direct
        self._misplaced_since_s: float | None = None
        """Since when the leader stands in a vertex that is taken, or beside a free one [s]."""
        self._spare_since_s = inf
        """Since when the vertex is to stay empty [s]."""

    def is_spare(self, view: View, claim: Claim) -> bool:
        """Whether the own vertex is to stay empty, and has been for long enough.

        Who hears nobody keeps its lead: the others may be out of reach, and come back.
        """
        if not view.heard or not view.is_spare(claim.vertex):
            self._spare_since_s = inf
        else:
            self._spare_since_s = min(self._spare_since_s, view.now_s)
        return view.now_s - self._spare_since_s > view.timing.resettle_s

    def choose(self, view: View, claim: Claim) -> None:
        """Keep the place, or change it once it has been the wrong one for long enough."""
        taken = view.map.vertex_places[claim.vertex] in view.blocked
        in_queue = claim.number > 0
        if taken == in_queue:
            self._misplaced_since_s = None
            if in_queue:
                self._keep_number(view, claim)
            return
        # What is seen flickers while teams meet again; a leader that followed it would too.
        if self._misplaced_since_s is None:
            self._misplaced_since_s = view.now_s
        certain_s = CERTAIN_S + CERTAIN_HOPS * view.timing.hop_s
        if view.now_s - self._misplaced_since_s >= certain_s:
            self._misplaced_since_s = None
            if taken:
                self._numbers.take_first(view, claim)
            else:
                claim.lead(claim.vertex, view.to_vertex(claim.vertex), view.now_s)

    def _keep_number(self, view: View, claim: Claim) -> None:
        if self._direct.applies:
            self._direct.choose(view, claim)
        else:
            self._numbers.keep_up(view, claim)
