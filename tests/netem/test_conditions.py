"""Conditions in force: models of links, faults that cut them, their composition and their end."""

from itertools import permutations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netem.conditions import LinkModels, NetworkConditions, overlaid
from netem.faults import Flap, Heal, Jam, Partition
from netem.link_model import LinkModel
from netem.link_parameters import Conditions, DirectedLink, GilbertElliott, LinkKeys, PathLoss
from netem.medium import Medium
from netem.messages import MediumCounters, MediumSetup
from netem.wire.channels import LOCAL, MULTIHOP
from netem.wire.frame import Outgoing, Transmission, pack, unpack
from tests.netem.fault_orders import begin, end

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
def test_a_links_table_overrides_its_channels_and_that_overrides_the_common_one(
    both, local, multihop, own
):
    models = LinkModels(conditions(both, local, multihop, (DirectedLink(source=2, to=5, **own),)))
    for channel, table in ((LOCAL, local), (MULTIHOP, multihop)):
        own_rate = any(key in own for key in AIR)
        assert models.of_link(channel, 2, 5) == LinkModel(**(both | table | own), own_rate=own_rate)
        assert models.of_link(channel, 5, 2) == LinkModel(**(both | table))
        assert models.of_link(channel, 0, 1) == LinkModel(**(both | table))


def test_without_conditions_the_radio_is_clean():
    models = LinkModels(Conditions())
    assert models.of_link(LOCAL, 0, 1) == models.of_link(MULTIHOP, 1, 0) == LinkModel()


def test_a_value_of_zero_overrides():
    """A channel with zero loss has no loss, whatever the table of both channels sets."""
    models = LinkModels(conditions({"loss_percent": 50.0}, {"loss_percent": 0.0}, {}))
    assert models.of_link(LOCAL, 0, 1).loss_percent == 0.0
    assert models.of_link(MULTIHOP, 0, 1).loss_percent == 50.0


@settings(derandomize=True, deadline=None)
@given(tables, tables, tables, tables)
def test_a_change_overrides_the_keys_that_it_sets_table_by_table(both, own, change, other):
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
    medium = Medium(MediumSetup(1, 3, 4, 80.0, Conditions(**keys)))
    medium.place(((0.0, 0.0, 0.0),) * 3)
    return medium


def send(medium, sent_s):
    medium.transmit(0, sent_s, Transmission(0, 0, (Outgoing(LOCAL, b"x"),)))


def test_a_change_affects_later_frames_and_none_in_flight():
    medium = radio(delay_ms=100.0)
    send(medium, 0.0)
    medium.apply(begin(1, Conditions(loss_percent=100.0)))
    send(medium, 0.05)
    assert [len(medium.collect(agent, 1.0)) for agent in (1, 2)] == [1, 1]
    assert medium.counters(0).fates["dropped_loss"] == 2


def test_a_partition_cuts_later_frames_and_a_heal_ends_it():
    medium = radio(delay_ms=100.0)
    send(medium, 0.0)
    medium.apply(begin(1, Partition(((0, 1),))))
    send(medium, 0.05)
    medium.apply(end(1))
    send(medium, 0.06)
    assert [len(medium.collect(agent, 1.0)) for agent in (1, 2)] == [3, 2]
    fates = medium.counters(0).fates
    assert (fates["dropped_partition"], fates["delivered"]) == (1, 5)


def test_each_fault_counts_the_frames_that_it_cuts():
    medium = radio()
    medium.apply(begin(1, Partition(((0, 1),))))
    send(medium, 0.0)
    medium.apply(begin(2, Partition(((0,), (1,)))))
    send(medium, 0.05)
    medium.apply(end(1))
    medium.apply(begin(3, Jam((50.0, 0.0, 0.0), 1.0)))
    medium.apply(begin(4, Flap(1.0, ((0, 1),))))
    send(medium, 0.1)
    counters = medium.counters(0)
    assert counters.struck == ((1, 2), (2, 4), (4, 1))
    assert counters.fates["dropped_partition"] == 5
    assert unpack(pack(counters), MediumCounters, 4096) == counters


@pytest.mark.parametrize(
    ("change", "links"),
    [
        (Conditions(loss_percent=100.0), 2),
        (Conditions(loss_percent=20.0), 0),  # as before
        (Conditions(local=LinkKeys(delay_ms=5.0)), 2),
        (Conditions(multihop=LinkKeys(delay_ms=5.0)), 0),  # nothing is sent there
        (Conditions(link=(DirectedLink(source=0, to=2, delay_ms=5.0),)), 1),
        (Conditions(link=(DirectedLink(source=2, to=0, delay_ms=5.0),)), 0),
        (Conditions(range_m=0.5), 2),
        (Conditions(range_m=100.0), 0),  # they were in range already
    ],
)
def test_a_change_counts_frames_on_the_links_that_it_makes_differ(change, links):
    medium = radio(loss_percent=20.0, range_m=4.0)
    medium.place(((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (3.0, 0.0, 0.0)))
    medium.apply(begin(7, change))
    send(medium, 0.0)
    medium.apply(end(7))
    send(medium, 0.05)
    assert medium.counters(0).struck == (((7, links),) if links else ())


def test_a_change_of_links_out_of_range_counts_nothing():
    medium = radio(range_m=2.0)
    medium.place(((0.0, 0.0, 0.0), (3.0, 0.0, 0.0), None))
    link = DirectedLink(source=0, to=1, delay_ms=5.0)
    medium.apply(begin(1, Conditions(loss_percent=50.0, link=(link,))))
    send(medium, 0.0)
    assert medium.counters(0).struck == ()


def test_frames_in_flight_to_a_radio_that_disappears_are_dropped_by_the_medium():
    medium = radio(delay_ms=100.0)
    send(medium, 0.0)
    medium.place(((0.0, 0.0, 0.0), None, (0.0, 0.0, 0.0)))
    send(medium, 0.05)
    assert [len(medium.collect(agent, 1.0)) for agent in (1, 2)] == [0, 2]
    counters = medium.counters(0)
    assert (counters.fates["dropped_medium"], counters.fates["dropped_range"]) == (1, 1)
    assert counters.addressed == sum(counters.fates.values()) + counters.in_flight


AGENTS = range(7)


def in_force(**faults):
    """Return conditions after faults began in order, with the numbers 1, 2, ..."""
    network = NetworkConditions(Conditions())
    for number, fault in enumerate(faults.values(), 1):
        network.apply(begin(number, fault))
    return network


def open_links(network, now_s=0.0):
    return {pair for pair in permutations(AGENTS, 2) if not network.cutters(*pair, now_s)}


def within(*groups):
    return {pair for group in groups for pair in permutations(group, 2)}


def cut_by_partition(*arguments):
    network = in_force(partition=Partition(*arguments))
    assert network.obstructed
    return open_links(network)


def test_unnamed_agents_form_one_more_group():
    assert cut_by_partition(((0, 1), (2,))) == within((0, 1), (2,), (3, 4, 5, 6))


def test_in_a_one_way_partition_a_group_hears_all_and_only_itself_hears_it():
    heard = within((0, 1), (2,), (3, 4, 5, 6))
    heard |= {(others, group) for others in (3, 4, 5, 6) for group in (0, 1, 2)}
    assert cut_by_partition(((0, 1), (2,)), "one_way") == heard


def test_a_bridge_hears_both_sides_and_is_heard_by_both():
    through = {pair for pair in permutations(AGENTS, 2) if 6 in pair}
    assert (
        cut_by_partition(((0, 1, 2), (3, 4, 5)), "bridge", (6,))
        == within((0, 1, 2), (3, 4, 5)) | through
    )


def test_in_a_ring_each_agent_hears_its_two_neighbours():
    ring = (4, 0, 2, 1, 3)
    neighbours = set(zip(ring, (*ring[1:], ring[0]), strict=True))
    assert cut_by_partition((ring,), "ring") == neighbours | {
        (b, a) for a, b in neighbours
    } | within((5, 6))


@pytest.mark.parametrize("ring", [(0,), (0, 1), (0, 1, 2)])
def test_in_a_ring_of_up_to_three_all_agents_are_neighbours(ring):
    rest = tuple(agent for agent in AGENTS if agent not in ring)
    assert cut_by_partition((ring,), "ring") == within(ring, rest)


def test_a_heal_ends_every_partition_and_no_other_fault():
    network = in_force(one=Partition(((0,),)), other=Partition(((1,),)), jam=Jam((0, 0, 0), 1.0))
    network.apply(begin(4, Heal()))
    assert network.obstructed
    assert open_links(network) == within(AGENTS)
    network.apply(end(3))
    assert not network.obstructed


def test_a_jam_is_a_sphere_and_ends_by_its_number():
    network = in_force(one=Jam((0.0, 0.0, 0.0), 1.0), other=Jam((5.0, 0.0, 0.0), 2.0))
    places = [(1.0, 0.0, 0.0), (0.8, 0.8, 0.0), (2.9, 0.0, 0.0), (3.0, 0.0, 0.0), (5.0, 1.4, 1.4)]
    assert [network.jammed(position) for position in places] == [True, False, False, True, True]
    network.apply(end(2))
    assert [network.jammed(position) for position in places] == [True, False, False, False, False]


def test_a_flap_is_down_for_the_first_half_of_each_period():
    network = NetworkConditions(Conditions())
    network.apply(begin(3, Flap(2.0), at_s=10.0))
    assert network.flapping
    down = [10.0, 10.5, 10.99, 12.0, 30.9]
    up = [11.0, 11.5, 11.99, 13.0, 31.0]
    assert all(open_links(network, now_s) == set() for now_s in down)
    assert all(open_links(network, now_s) == within(AGENTS) for now_s in up)


def test_a_flap_of_some_links_does_not_affect_the_others():
    network = in_force(flap=Flap(2.0, ((0, 1), (2, 3))))
    assert open_links(network) == within(AGENTS) - {(0, 1), (2, 3)}
    network.apply(end(1))
    assert not network.obstructed
    assert not network.flapping


faults = st.one_of(
    st.lists(st.sampled_from(AGENTS), min_size=1, max_size=3, unique=True).map(
        lambda group: Partition((tuple(group),))
    ),
    st.tuples(st.sampled_from([(0, 0, 0), (1, 0, 0)]), st.floats(0.5, 2.0)).map(lambda j: Jam(*j)),
    st.sets(st.sampled_from([(0, 1), (1, 2), (5, 6)])).map(lambda ls: Flap(1.0, tuple(ls))),
    st.floats(0.0, 100.0).map(lambda loss: Conditions(loss_percent=loss)),
    st.floats(1.0, 99.0).map(lambda delay: Conditions(delay_ms=delay)),
)


@settings(derandomize=True, deadline=None, max_examples=50)
@given(st.lists(faults, min_size=1, max_size=6), st.randoms(use_true_random=False))
def test_faults_compose_and_end_independently_in_any_order(begun, random):
    """After some faults have ended, the others act as if they alone had begun."""
    network = NetworkConditions(Conditions(range_m=6.0))
    numbers = list(range(len(begun)))
    for number in numbers:
        network.apply(begin(number, begun[number]))
    random.shuffle(numbers)
    while numbers:
        network.apply(end(numbers.pop()))
        alone = NetworkConditions(Conditions(range_m=6.0))
        for number in sorted(numbers):
            alone.apply(begin(number, begun[number]))
        assert network.in_force == alone.in_force
        assert network.conditions == alone.conditions
        assert open_links(network, 0.2) == open_links(alone, 0.2)
        places = [(0.0, 0.0, 0.0), (1.4, 0.0, 0.0)]
        assert [network.jammed(at) for at in places] == [alone.jammed(at) for at in places]
    assert not network.obstructed


def test_an_inner_partition_that_ends_leaves_the_outer_one_in_force():
    network = in_force(outer=Partition(((0, 1),)), inner=Partition(((0,),)))
    assert open_links(network) == within((0,), (1,), AGENTS[2:])
    network.apply(end(2))
    assert open_links(network) == within((0, 1), AGENTS[2:])


def test_the_end_of_a_fault_that_is_not_in_force_changes_nothing():
    network = in_force(jam=Jam((0, 0, 0), 1.0))
    assert not network.ends(end(7))
    network.apply(end(7))
    assert list(network.in_force) == [1]
