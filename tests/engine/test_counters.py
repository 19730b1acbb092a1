"""Whom an agent hears directly, and how much it says."""

import numpy as np

from netem.messages import MediumCounters
from worldsim.engine.counters import RadioUse

SPOKEN = MediumCounters(
    slot=0,
    sent=0,
    addressed=0,
    fates={},
    in_flight=0,
    rejected={},
    sent_b=(100, 10, 400, 40, 0, 0),
)


def radio_use():
    made = RadioUse(3, tick_hz=20.0)
    for tick in range(40):
        made.tick(np.array([True, tick < 20, False]))
        made.note(0, 2 if tick < 10 else 1)
    made.note(1, 1)
    return made


def test_links_are_told_as_mean_and_most_of_who_stepped():
    assert radio_use().links() == {"mean": [1.25, 1.0, None], "most": [2, 1, None]}


def test_bytes_are_told_by_the_time_in_which_an_agent_took_part():
    assert radio_use().bytes_per_s(SPOKEN) == {
        "local": [50.0, 400.0, None],
        "multihop": [5.0, 40.0, None],
    }


def test_without_the_radios_word_no_bytes_are_told():
    assert radio_use().bytes_per_s(None) is None
