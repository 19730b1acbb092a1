"""Which conditions hold on which link: the narrower table wins, field by field."""

from hypothesis import given, settings
from hypothesis import strategies as st

from netem.link import LinkModel
from netem.messages import Conditions, DirectedLink, LinkKeys
from netem.schedule import Schedule
from netem.wire.frame import LOCAL, MULTIHOP

FIELDS = LinkKeys.__struct_fields__
tables = st.fixed_dictionaries(
    {}, optional={field: st.floats(0.5, 99.0, allow_nan=False) for field in FIELDS}
)


def conditions(both, local, multihop, link=()):
    return Conditions(**both, local=LinkKeys(**local), multihop=LinkKeys(**multihop), link=link)


@settings(derandomize=True, deadline=None)
@given(tables, tables, tables, tables)
def test_a_links_own_table_wins_over_its_channels_and_that_over_both(both, local, multihop, own):
    schedule = Schedule(conditions(both, local, multihop, (DirectedLink(source=2, to=5, **own),)))
    for channel, table in ((LOCAL, local), (MULTIHOP, multihop)):
        assert schedule.model(channel, 2, 5) == LinkModel(**(both | table | own))
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
