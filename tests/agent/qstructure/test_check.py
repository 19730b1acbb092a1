"""Formations that cannot be flown are rejected, with the queue's name and the key."""

from time import process_time

import pytest

from agent.messages import Place
from agent.qstructure.formation import Formation, FormationError, FormationSpec, QueueSpec
from agent.qstructure.orientation import OrientationSpec
from agent.qstructure.shape import Arc, Curve, Polyline, Ray

LEAST_M = 0.5
AWAY = Ray((0.0, 0.0, 1.0))
VERTICES = {"V1": (0.0, 0.0, 0.0), "V2": (6.0, 0.0, 0.0)}


def checked(queue, agents=6, spacing=1.0, vertices=VERTICES, others=()):
    """Check a formation of one queue, and of other queues if given."""
    used = {name for each in (queue, *others) for name in each.vertices}
    kept = {name: at for name, at in vertices.items() if name in used}
    Formation(FormationSpec("f", kept, (queue, *others)), spacing).check(agents, LEAST_M)


def curve(x, y="0", z="0", **more):
    return QueueSpec("bent", ("V1",), Curve(x, y, z), **more)


def oriented(**angles):
    return QueueSpec("bent", ("V1",), AWAY, None, OrientationSpec(**angles))


REJECTED = {
    "a pole on the way": (curve("1/(2-s)"), "shape"),
    "a pole that no step meets": (curve("s", "1/(s-pi)"), "shape"),
    "a pole at the vertex": (curve("1/s"), "shape"),
    "zero length": (curve("1", "2", "3"), "shape"),
    "standing still": (curve("min(s, 2)"), "shape"),
    "an end that is never reached": (curve("tanh(s)"), "shape"),
    "a jump": (curve("s", "2*floor(s/3)"), "shape"),
    "not real on the way": (curve("s", "sqrt(3-s)"), "shape"),
    "not real at the vertex": (curve("s", "log(s)"), "shape"),
    "an unknown name": (curve("s", "t"), "shape.y"),
    "an attempt at code": (curve("s", "0", "__import__('os').getpid()"), "shape.z"),
    "a comparison": (curve("s", "s < 1"), "shape.y"),
    "a power that fills memory": (curve("s", "9**9**9**9"), "shape"),
    "a ray without direction": (
        QueueSpec("bent", ("V1",), Ray((0.0, 0.0, 0.0))),
        "shape.direction",
    ),
    "no shape": (QueueSpec("bent", ("V1",)), "shape"),
    "a closed queue too short": (
        QueueSpec("bent", ("V1", "V3")),
        "vertices",
    ),
    "a shape that misses its vertex": (QueueSpec("bent", ("V1", "V2"), AWAY), "shape"),
    "a yaw that is no number at slot 3": (oriented(yaw_deg="1/(d-3)"), "orientation.yaw_deg"),
    "a pitch that is not real behind slot 4": (
        oriented(pitch_deg="sqrt(4.5-d)"),
        "orientation.pitch_deg",
    ),
    "a roll of an unknown variable": (oriented(roll_deg="5*s"), "orientation.roll_deg"),
    "a yaw that is code": (oriented(yaw_deg="(lambda: 1)()"), "orientation.yaw_deg"),
}


@pytest.mark.parametrize(("queue", "key"), REJECTED.values(), ids=REJECTED)
def test_a_queue_that_cannot_be_flown_is_rejected_by_name(queue, key):
    with pytest.raises(FormationError) as rejected:
        checked(queue, vertices={**VERTICES, "V3": (0.9, 0.0, 0.0)})
    assert "'bent'" in rejected.value.key
    assert rejected.value.key.endswith(key)
    assert "\n" not in str(rejected.value)


def test_a_spacing_under_the_floor_is_rejected():
    with pytest.raises(FormationError, match=r"two of its slots are 0\.450 m apart") as rejected:
        checked(QueueSpec("bent", ("V1",), AWAY), spacing=0.45)
    assert rejected.value.key == "queue 'bent'"
    checked(QueueSpec("bent", ("V1",), AWAY), spacing=0.5)


def test_slots_that_are_near_by_the_chord_are_rejected():
    folded = Polyline(((0.0, 0.0, 0.0), (3.0, 0.0, 0.0), (3.0, 0.3, 0.0), (0.0, 0.3, 0.0)))
    with pytest.raises(FormationError, match="two of its slots") as rejected:
        checked(QueueSpec("bent", ("V1",), folded))
    assert "'bent'" in rejected.value.key


def test_queues_that_cross_too_near_name_both():
    others = (QueueSpec("other", ("V2",), Ray((-1.0, 0.0, 0.0))),)
    with pytest.raises(FormationError) as rejected:
        checked(QueueSpec("bent", ("V1",), Ray((1.0, 0.0, 0.0))), 14, others=others)
    assert rejected.value.key == "queue 'bent' and 'other'"


def test_a_closed_queue_whose_share_does_not_fit_is_rejected():
    others = (QueueSpec("other", ("V2",), AWAY),)
    with pytest.raises(FormationError, match="its capacity asks for 10 members, 6 fit") as rejected:
        checked(QueueSpec("bent", ("V1", "V2")), 20, others=others)
    assert rejected.value.key == "queue 'bent'"


def test_all_closed_and_full_says_how_many_are_left():
    with pytest.raises(FormationError, match="3 of 10 agents find no place"):
        checked(QueueSpec("bent", ("V1", "V2")), agents=10)
    checked(QueueSpec("bent", ("V1", "V2")), agents=7)


SOUND = {
    "a pole beyond the last slot": curve("s", "0.1/(30-s)"),
    "not real beyond the last slot": curve("s", "0.1*sqrt(30-s)"),
    "an arc that goes straight on": QueueSpec("bent", ("V1",), Arc(2.0, 90.0)),
    "a yaw that has a pole between slots": oriented(yaw_deg="1/(d-2.5)"),
    "angles as numbers": oriented(yaw_deg=90, pitch_deg=-5.0),
    "a corner": curve("s", "abs(s-2)"),
}


@pytest.mark.parametrize("queue", SOUND.values(), ids=SOUND)
def test_a_queue_that_can_be_flown_is_not_rejected(queue):
    checked(queue)


GROWN = {
    "a pole": curve("s", "1/(3.5-s)"),
    "a curve that ends": curve("s", "sqrt(3.5-s)"),
    "a yaw that is no number": oriented(yaw_deg="sqrt(3.5-d)"),
    "a pitch that no vehicle has": oriented(pitch_deg="30*d"),
}


@pytest.mark.parametrize("queue", GROWN.values(), ids=GROWN)
def test_a_team_that_grows_past_a_queues_end_meets_no_exception(queue):
    vertices = {"V1": VERTICES["V1"]}
    formation = Formation(FormationSpec("f", vertices, (queue,)), 1.0)
    formation.check(3, LEAST_M)
    for agents in range(12):
        layout = formation.layout(agents, frozenset({Place(0, 1)}))
        assert set(layout.places) == set(layout.slots)
        assert len(layout.places) + layout.unplaced == agents
        formation.slot(Place(0, agents), agents)
    with pytest.raises(FormationError):
        formation.check(12, LEAST_M)


def test_places_that_no_queue_has_are_not_followed():
    formation = Formation(FormationSpec("f", {"V1": VERTICES["V1"]}, (curve("2*s"),)), 1.0)
    assert formation.slot(Place(0, 2**15 - 1), 3) is None
    assert formation.slot(Place(7, 1), 3) is None


def test_work_is_shared_by_the_queues_of_a_formation():
    queues = tuple(QueueSpec(f"Q{k}", (f"V{k}",), Curve("s", "0.1*sin(s)", "0")) for k in range(64))
    vertices = {f"V{k}": (0.0, 3.0 * k, 0.0) for k in range(64)}
    began = process_time()
    Formation(FormationSpec("f", vertices, queues), 1.0).check(640, LEAST_M)
    assert process_time() - began < 3.0


def test_closed_queues_pass_through_a_limited_number_of_vertices():
    names = tuple(f"V{k}" for k in range(64))
    queues = tuple(QueueSpec(f"Q{k}", names) for k in range(64))
    vertices = {name: (5.0 * k, 0.0, 0.0) for k, name in enumerate(names)}
    with pytest.raises(FormationError, match="4096 vertices in all; at most 256"):
        Formation(FormationSpec("f", vertices, queues), 1.0)


def test_coincident_vertices_of_a_closed_queue_are_named():
    with pytest.raises(FormationError, match="'V1' and 'V3' are 0 m apart") as rejected:
        checked(QueueSpec("bent", ("V1", "V3")), vertices={**VERTICES, "V3": (0.0, 0.0, 0.0)})
    assert rejected.value.key == "queue 'bent', vertices"
