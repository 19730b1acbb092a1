"""Where an agent without a number flies meanwhile: to the slot that it is likely to get."""

from math import dist
from typing import Final

from agent.qstructure.formation import Slot
from agent.structure.queue_choice import likely_length
from agent.structure.view import View

WAITS_M: Final = 0.5
"""An agent nearer than this to a slot waits in it for a number. If it went on to where it stands in
the order of those known so far, a line of few links would break before all are known."""


def standing_slot(view: View, queue: int, members: int) -> Slot | None:
    """Return the nearest slot of a queue if the agent stands in it by chance, else None.

    members: so many are looked at.
    """
    number = view.number_near(queue, members, WAITS_M)
    slots = [view.map.slot(queue, number, view.extent(queue, number))] if number else []
    slots += [view.map.vertex_slot(v) for v in view.map.vertices_of[queue]]
    nearest, within_m = None, WAITS_M
    for each in slots:
        if each is not None and (away_m := dist(each.point, view.origin)) < within_m:
            nearest, within_m = each, away_m
    return nearest


def slot_by_order(view: View, queue: int, own_id: int) -> Slot | None:
    """Return the slot that the agent gets if no more members turn up; None where unknown."""
    if view.map.closed[queue] or own_id not in view.order:
        return None
    number = 1 + view.order.index(own_id)
    return view.map.slot(queue, number, view.extent(queue, number))


def nearest_slot(view: View, queue: int) -> Slot | None:
    """Return the nearest slot of a queue that is likely to have a member."""
    number = view.nearest_number(queue, likely_length(view))
    return view.map.slot(queue, number, view.extent(queue, number))
