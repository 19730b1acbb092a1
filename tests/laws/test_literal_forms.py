"""Each equation as printed breaks a law, so a test fails if it is written back in."""

import pytest

from agent.assignment import allocation
from agent.comms.gossip import RecordTable
from agent.guidance import bobber as bobber_room
from agent.guidance import movement
from agent.guidance.potential import Potential
from agent.qstructure.formation import Formation
from agent.qstructure.queue import Queue
from agent.structure.tree import Tree
from tests.laws import literal
from tests.laws.laws import LAWS

ON_BOTH_SIDES = {"_push": literal.push_two_sided, "_is_surely_apart": literal.pushes_far_away}
LITERAL = {
    "E1": ("E1", Potential, {"gap_at_targets": literal.gap_at_targets}),
    "E1 floor": (
        "E1 floor",
        Potential,
        {"gap_at_targets": literal.gap_at_targets_without_floor, **ON_BOTH_SIDES},
    ),
    "E2": ("E2", Potential, {"omega": literal.omega}),
    "E3": (
        "E3",
        Potential,
        {
            "value": literal.value_two_sided,
            "slope": literal.slope_two_sided,
            **ON_BOTH_SIDES,
        },
    ),
    "E3 (b)": ("(a)-(c)", Potential, {"slope": literal.slope_two_sided}),
    "E3 (e)": (
        "(e)",
        Potential,
        {"value": literal.value_two_sided, "slope": literal.slope_two_sided},
    ),
    "E3 Lemma 6": ("Lemma 6 (ii)", Potential, ON_BOTH_SIDES),
    "E1 Lemma 6": ("Lemma 6 (i)", Potential, {"gap_at_targets": literal.gap_at_targets}),
    "E2 (29)": ("(29)", Potential, {"omega": literal.omega}),
    "E4": ("E4 flown", Potential, {"__init__": literal.unit_weight}),
    "E4 (29)": ("(29)", Potential, {"__init__": literal.unit_weight}),
    "E7": ("E7", bobber_room, {"bobber": literal.bobber}),
    "E7 Lemma 9": ("Lemma 9", bobber_room, {"bobber": literal.bobber}),
    "E8": ("E8", bobber_room, {"bobber": literal.bobber_of_angle_alone}),
    "E9": ("Lemma 9", bobber_room, {"bobber": literal.bobber_from_d_c1_on}),
    "E9 reach": ("E7", bobber_room, {"bobber": literal.bobber_from_d_c1_on}),
    "E10 climb": ("E10 climb", movement, {"steer": literal.steer_in_a_pyramid}),
    "E10 dead band": ("E10 dead band", movement, {"steer": literal.steer_in_a_pyramid}),
    "E11": ("E7", bobber_room, {"bobber": literal.bobber_never_head_on}),
    "E11 Lemma 9": ("Lemma 9", bobber_room, {"bobber": literal.bobber_never_head_on}),
    "E13": ("E13", Queue, {"members": literal.members_by_chord}),
    "E14": ("E14", RecordTable, {"adopt": literal.adopt_nothing}),
    "E14 tree": ("E14", Tree, {"_compare": literal.adopt_nothing}),
    "E16": ("E16", Formation, {"_holders": literal.holders_queue_by_queue}),
    "E20": ("Lemma 7 far", bobber_room, {"cast_reach": literal.cast_reach_given}),
    "E20 pair": ("Lemma 7 pair", bobber_room, {"cast_reach": literal.cast_reach_given}),
    "E17": ("E17", allocation, {"allocate": literal.allot_by_distance}),
}


@pytest.mark.parametrize(("law", "room", "forms"), LITERAL.values(), ids=LITERAL)
def test_the_literal_form_breaks_its_law(monkeypatch, law, room, forms):
    for name, form in forms.items():
        monkeypatch.setattr(room, name, form)
    with pytest.raises(AssertionError):
        LAWS[law]()
