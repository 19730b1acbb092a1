"""Where an agent without a number waits: in the nearest slot, if it is in one by chance."""

import pytest

from agent.qstructure.formation import Formation, FormationSpec, QueueSpec
from agent.qstructure.shape import Ray
from agent.structure.likely_slot import standing_slot
from agent.structure.queue_map import QueueMap
from tests.agent.structure.builders import view

QUEUE = QueueSpec("Q0", ("V0",), Ray((-1.0, 0.0, 0.0)))
NARROW = QueueMap(Formation(FormationSpec("line", {"V0": (0.0, 0.0, 0.0)}, (QUEUE,)), 0.6))


@pytest.mark.parametrize(
    ("x", "slot_x"), [(-0.2, 0.0), (-0.4, -0.6), (-1.3, -1.2), (0.49, 0.0), (0.51, None)]
)
def test_it_waits_in_the_nearest_slot_be_it_a_vertex(x, slot_x):
    """Where slots are 0.6 m apart it is within reach of two."""
    slot = standing_slot(view(NARROW, 0.0, at=(x, 0.0, 0.0)), 0, 9)
    assert (slot.point[0] if slot is not None else None) == pytest.approx(slot_x)
