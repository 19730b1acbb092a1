"""Which conditions hold on which link: the narrower table wins, field by field."""

from hypothesis import given, settings
from hypothesis import strategies as st

from netem.link import LinkModel
from netem.link_keys import Conditions, DirectedLink, GilbertElliott, LinkKeys, PathLoss
from netem.medium import Medium
from netem.messages import Healed, MediumSetup, Parted
from netem.schedule import Schedule, overlaid
from netem.wire.frame import LOCAL, MULTIHOP, Outgoing, Transmission

FIELDS = LinkKeys.__struct_fields__
AIR = ("rate_kbit", "rate_overhead_b", "limit")
VALUES = {
    "distribution": st.sampled_from(["uniform", "normal", "pareto", "paretonormal"]),
    "gemodel": st.builds(GilbertElliott, p_percent=st.just(1.0), r_percent=st.floats(1.0, 99.0)),
    "path_loss": st.builds(
        PathLoss,
        exponent=st.floats(2.0, 4.0),
        reference_loss_db=st.just(40.0),
        budget_db=st.floats(60.0, 80.0),
    ),
    "rate_overhead_b": st.integers(0, 100),
    "limit": st.integers(1, 100),
}
measures = st.floats(0.5, 99.0, allow_nan=False)
tables = st.fixed_dictionaries(
    {}, optional={field: VALUES.get(field, measures) for field in FIELDS}
)


def conditions(both, local, multihop, link=()):
    return Conditions(**both, local=LinkKeys(**local), multihop=LinkKeys(**multihop), link=link)


@settings(derandomize=True, deadline=None)
@given(tables, tables, tables, tables)
def test_a_links_own_table_wins_over_its_channels_and_that_over_both(both, local, multihop, own):
    schedule = Schedule(conditions(both, local, multihop, (DirectedLink(source=2, to=5, **own),)))
    for channel, table in ((LOCAL, local), (MULTIHOP, multihop)):
        own_rate = any(key in own for key in AIR)
        assert schedule.model(channel, 2, 5) == LinkModel(**(both | table | own), own_rate=own_rate)
        assert schedule.model(channel, 5, 2) == LinkModel(**(both | table))
        assert schedule.model(channel, 0, 1) == LinkModel(**(both | table))


def test_without_conditions_the_radio_is_clean():
    schedule = Schedule(Conditions())
    assert schedule.model(LOCAL, 0, 1) == schedule.model(MULTIHOP, 1, 0) == LinkModel()


def test_a_value_of_nothing_is_a_value():
    """A channel without loss is without loss, whatever the table for both channels says."""
    schedule = Schedule(conditions({"loss_percent": 50.0}, {"loss_percent": 0.0}, {}))
    assert schedule.model(LOCAL, 0, 1).loss_percent == 0.0
    assert schedule.model(MULTIHOP, 0, 1).loss_percent == 50.0


@settings(derandomize=True, deadline=None)
@given(tables, tables, tables, tables)
def test_a_change_lies_over_what_was_table_by_table_and_key_by_key(both, own, change, other):
    before = conditions(both, {}, own, (DirectedLink(source=0, to=1, **own),))
    links = tuple(DirectedLink(source=a, to=b, **other) for a, b in ((0, 1), (1, 2)))
    after = overlaid(before, conditions(change, {}, other, links))
    assert after == conditions(
        both | change,
        {},
        own | other,
        (DirectedLink(source=0, to=1, **(own | other)), links[1]),
    )
    assert overlaid(before, Conditions()) == before


def radio(**keys):
    made = Medium(MediumSetup(1, 3, 4, 80.0, Conditions(**keys)))
    made.place(((0.0, 0.0, 0.0),) * 3)
    return made


def say(made, sent_s):
    made.transmit(0, sent_s, Transmission(0, 0, (Outgoing(LOCAL, b"x"),)))


def test_a_change_meets_later_frames_and_not_those_in_flight():
    made = radio(delay_ms=100.0)
    say(made, 0.0)
    made.change(Conditions(loss_percent=100.0))
    say(made, 0.05)
    assert [len(made.collect(who, 1.0)) for who in (1, 2)] == [1, 1]
    assert made.counters(0).fates["dropped_loss"] == 2


def test_a_partition_cuts_later_frames_and_a_heal_ends_it():
    made = radio(delay_ms=100.0)
    say(made, 0.0)
    made.obey(Parted(((0, 1),)))
    say(made, 0.05)
    made.obey(Healed())
    say(made, 0.06)
    assert [len(made.collect(who, 1.0)) for who in (1, 2)] == [3, 2]
    fates = made.counters(0).fates
    assert (fates["dropped_partition"], fates["delivered"]) == (1, 5)


def test_what_is_in_flight_to_a_radio_that_goes_is_dropped_by_the_medium():
    made = radio(delay_ms=100.0)
    say(made, 0.0)
    made.place(((0.0, 0.0, 0.0), None, (0.0, 0.0, 0.0)))
    say(made, 0.05)
    assert [len(made.collect(who, 1.0)) for who in (1, 2)] == [0, 2]
    told = made.counters(0)
    assert (told.fates["dropped_medium"], told.fates["dropped_range"]) == (1, 1)
    assert told.addressed == sum(told.fates.values()) + told.in_flight
