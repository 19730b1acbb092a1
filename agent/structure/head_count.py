"""One agent's part in counting the team: its own label, and what all labels say."""

from typing import Final

from agent.structure.census import Census, Population
from agent.structure.claim import NO_QUEUE, Claim
from agent.structure.label_code import UNPLACED, LabelCodes, codes_of, of_vertex, queue_of_code
from agent.structure.queue_map import QueueMap
from agent.structure.view import View

ORDER_S: Final = 0.5
"""The order along a queue is found anew after this time, or when a member is new there."""


class HeadCount:
    """The census of one agent. ids: number of agent ids of the run.

    code: of the own label, for the beacon.
    """

    def __init__(self, own_id: int, formation: QueueMap, ids: int) -> None:
        self._own_id, self._map = own_id, formation
        self.census = Census(own_id, ids)
        self._codes = LabelCodes(formation, self.census.most)
        self.code = UNPLACED
        self._queue_code = UNPLACED
        """The own code in the queue joined last."""
        self._ordered: tuple[int, int] | None = None
        """The queue, and the version of the census, for which the order was found."""
        self._ordered_s = 0.0
        self._order: list[int] = []

    def note(self, view: View, claim: Claim) -> None:
        """Bring the census up to date with the members heard directly."""
        for heard in view.heard:
            code = heard.standing.code if heard.standing is not None else UNPLACED
            self.census.hear(heard.id, view.now_s - heard.age_s, code)
        self.note_own(view, claim)
        self.census.ask(view.now_s, view.timing.lost_s)

    def note_own(self, view: View, claim: Claim) -> None:
        """Bring the own label up to date."""
        self.code = self._own_code(view, claim)
        self.census.hear(self._own_id, view.now_s, self.code)

    def _own_code(self, view: View, claim: Claim) -> int:
        """Return the own code; a leader that stands in its queue counts in its queue."""
        if claim.leads and claim.number < 1:
            return of_vertex(claim.vertex)
        if claim.queue == NO_QUEUE:
            return UNPLACED
        if queue_of_code(self._queue_code, self._map.queues) != claim.queue:
            self._queue_code = self._codes.of_queue(claim.queue, view.origin)
        return self._queue_code

    def population(self, view: View, heard: int, *, all_hear_the_same: bool) -> Population:
        """Return the members that are there. heard: how many the own agent hears, itself included.

        Where all those left hear each other, none could answer for more: then the agent does not
        wait for an answer.
        """
        found = self._within(view, view.timing.lost_s + view.timing.answer_s)
        if found.total <= heard or not all_hear_the_same:
            return found
        at_once = self._within(view, view.timing.lost_s)
        return at_once if at_once.total == heard else found

    def _within(self, view: View, lost_s: float) -> Population:
        return self.census.population(view.now_s, lost_s, self._map.queues, self._map.vertices)

    def order(self, view: View, queue: int) -> list[int]:
        """Return the known members of a queue, in their order along it."""
        wanted = queue, self.census.version
        if wanted != self._ordered or view.now_s - self._ordered_s >= ORDER_S:
            self._ordered, self._ordered_s = wanted, view.now_s
            lost_s = view.timing.lost_s + view.timing.answer_s
            codes = codes_of(queue, self._map.queues)
            self._order = self.census.present(view.now_s, lost_s, codes)
        return self._order
