"""Each equation as printed breaks a law: whoever writes it back in is told by a failing test."""

import pytest

from agent.comms import allocation
from agent.guidance import bobber as bobber_room
from agent.guidance.potential import Potential
from agent.qstructure.formation import Formation
from agent.qstructure.queue import Queue
from tests.laws import literal
from tests.laws.laws import LAWS

LITERAL = {
    "E1": ("E1", Potential, {"at_targets": literal.at_targets}),
    "E1 floor": (
        "E1 floor",
        Potential,
        {"at_targets": literal.at_targets_without_floor, "_push": literal.push_two_sided},
    ),
    "E2": ("E2", Potential, {"omega": literal.omega}),
    "E3": (
        "E3",
        Potential,
        {
            "value": literal.value_two_sided,
            "slope": literal.slope_two_sided,
            "_push": literal.push_two_sided,
        },
    ),
    "E3 (b)": ("(a)-(e)", Potential, {"slope": literal.slope_two_sided}),
    "E7": ("E7", bobber_room, {"bobber": literal.bobber}),
    "E13": ("E13", Queue, {"_behind": literal.members_by_chord}),
    "E16": ("E16", Formation, {"_holders": literal.holders_queue_by_queue}),
    "E17": ("E17", allocation, {"allot": literal.allot_by_distance}),
}


@pytest.mark.parametrize(("law", "room", "forms"), LITERAL.values(), ids=LITERAL)
def test_the_literal_form_breaks_its_law(monkeypatch, law, room, forms):
    for name, form in forms.items():
        monkeypatch.setattr(room, name, form)
    with pytest.raises(AssertionError):
        LAWS[law]()
