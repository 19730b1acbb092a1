"""The tables of a formation, and the queues that they describe.

The ``...Spec`` structures are the format of a formation file, and of a formation in a mission.
"""

from itertools import pairwise
from math import dist
from typing import Annotated

import msgspec
from msgspec import Meta

from agent.messages import Metres, Vector
from agent.qstructure.curve import CurveError
from agent.qstructure.expression import ExpressionError
from agent.qstructure.orientation import Orientation, OrientationError, OrientationSpec
from agent.qstructure.queue import SEARCH_STEPS, Queue, QueueError
from agent.qstructure.shape import LEAST_M, ShapeError, ShapeSpec, Straight, is_measured, shape_of

Name = Annotated[str, Meta(min_length=1, max_length=64)]
MAX_PASSES = 256
"""Most vertices of all queues together, a shared one counted in each."""


class FormationError(ValueError):
    """A formation that cannot be flown; ``key`` is the offending key."""

    def __init__(self, key: str, detail: str) -> None:
        super().__init__(f"{key}: {detail}")
        self.key = key
        self.detail = detail


class QueueSpec(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """A queue's table: Q_j = (V_j, S_j, C_j, O_j) of Definition 4.

    vertices: names, one for an open queue, more for a closed one. shape: a closed queue without a
    shape runs straight from vertex to vertex. capacity: share of the team; left out: equal shares.
    orientation: left out: free.
    """

    name: Name
    vertices: Annotated[tuple[Name, ...], Meta(min_length=1, max_length=64)]
    shape: ShapeSpec | None = None
    capacity: Annotated[float, Meta(gt=0, le=1)] | None = None
    orientation: OrientationSpec | None = None


class FormationSpec(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """A formation file: F = (Q, V_F) of Definition 3; vertices [m; target's frame]."""

    name: Name
    vertices: Annotated[
        dict[Name, tuple[Metres, Metres, Metres]], Meta(min_length=1, max_length=64)
    ]
    queue: Annotated[tuple[QueueSpec, ...], Meta(min_length=1, max_length=64)]

    @property
    def oriented(self) -> bool:
        """Whether any queue sets an angle."""
        return any(queue.orientation not in (None, OrientationSpec()) for queue in self.queue)


def queues_of(spec: FormationSpec, spacing: float) -> tuple[Queue, ...]:
    """Return every queue's geometry, with an equal share of the work that measuring may take."""
    curves = sum(is_measured(table.shape) for table in spec.queue)
    passes = sum(len(table.vertices) for table in spec.queue)
    if passes > MAX_PASSES:
        detail = f"they pass through {passes} vertices in all; at most {MAX_PASSES}"
        raise FormationError("queue", detail)
    steps = SEARCH_STEPS // passes
    return tuple(_queue(table, spec.vertices, spacing, curves, steps) for table in spec.queue)


def _queue(
    table: QueueSpec, vertices: dict[str, Vector], spacing: float, curves: int, steps: int
) -> Queue:
    """Return a queue's geometry; raise FormationError with the queue's name."""
    through = [vertices[name] for name in table.vertices]
    label = f"queue {table.name!r}"
    if table.shape is None:
        _check_legs(table, through, label)
    try:
        shape = shape_of(table.shape, curves) if table.shape is not None else Straight(through)
        orientation = Orientation(table.orientation) if table.orientation is not None else None
        queue = Queue(table.name, through, shape, spacing, orientation, steps)
        if not queue.closed:
            queue.point(queue.behind(1))  # it has room for one member at least
        return queue
    except (ShapeError, OrientationError, QueueError) as error:
        part = {ShapeError: "shape", OrientationError: "orientation"}.get(type(error))
        key = ".".join(each for each in (part, error.key) if each)
        raise FormationError(f"{label}, {key}", str(error)) from error
    except (CurveError, ExpressionError) as error:
        raise FormationError(f"{label}, shape", str(error)) from error


def _check_legs(table: QueueSpec, through: list[Vector], label: str) -> None:
    """Raise FormationError unless a queue without a shape runs from vertex to vertex."""
    if len(through) == 1:
        raise FormationError(f"{label}, shape", "an open queue needs a shape")
    for index, (a, b) in enumerate(pairwise(through)):
        if dist(a, b) < LEAST_M:
            first, second = table.vertices[index : index + 2]
            detail = (
                f"{first!r} and {second!r} are {dist(a, b):.3g} m apart; at least {LEAST_M:g} m"
            )
            raise FormationError(f"{label}, vertices", detail)


def check_names(spec: FormationSpec) -> None:
    """Raise FormationError for a name that is used twice, unknown or not used."""
    seen: set[str] = set()
    for index, queue in enumerate(spec.queue):
        if queue.name in seen:
            raise FormationError(f"queue[{index}].name", f"{queue.name!r} is used twice")
        seen.add(queue.name)
        for vertex in queue.vertices:
            if vertex not in spec.vertices:
                known = ", ".join(spec.vertices)
                raise FormationError(
                    f"queue[{index}].vertices", f"no vertex {vertex!r}; there are {known}"
                )
        if len(set(queue.vertices)) < len(queue.vertices):
            raise FormationError(f"queue[{index}].vertices", "a vertex is named twice")
    used = {vertex for queue in spec.queue for vertex in queue.vertices}
    for name in spec.vertices:
        if name not in used:
            raise FormationError(f"vertices.{name}", "no queue passes through it")


def capacities_of(spec: FormationSpec) -> tuple[float, ...]:
    """Return each queue's share; queues without a capacity share the rest equally."""
    given = [queue.capacity for queue in spec.queue]
    total = sum(share for share in given if share is not None)
    missing = given.count(None)
    if missing and total < 1.0 - 1e-6:
        return tuple((1.0 - total) / missing if share is None else share for share in given)
    if missing or abs(total - 1.0) > 1e-6:
        raise FormationError("queue.capacity", f"the sum must be 1 within 1e-6; it is {total:g}")
    return tuple(share for share in given if share is not None)
