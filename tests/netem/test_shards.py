"""Shards of the medium, each with some of the receivers, together decide what one medium would."""

from random import Random

from hypothesis import given, settings
from hypothesis import strategies as st

from netem.delivery_log import Digest, joined_pages
from netem.faults import Flap, Heal, Jam, Partition, Sabotage
from netem.link_parameters import Conditions, DirectedLink, GilbertElliott, LinkKeys, PathLoss
from netem.medium import Medium
from netem.messages import MediumSetup
from netem.wire.frame import Outgoing, Transmission
from tests.netem.fault_orders import begin, end

AGENTS = 6
SLOT_S = 0.0125
ROUGH = Conditions(
    range_m=6.0,
    delay_ms=30.0,
    jitter_ms=20.0,
    distribution="paretonormal",
    delay_correlation_percent=40.0,
    loss_percent=5.0,
    gemodel=GilbertElliott(10.0, 30.0),
    duplicate_percent=10.0,
    corrupt_percent=10.0,
    reorder_percent=10.0,
    path_loss=PathLoss(3.0, 40.0, 55.0),
    rate_kbit=60.0,
    rate_overhead_b=20,
    limit=3,
    multihop=LinkKeys(rate_kbit=20.0),
    link=(DirectedLink(source=0, to=1, rate_kbit=5.0), DirectedLink(source=2, to=3, range_m=9.0)),
)
LOSSY = Conditions(range_m=4.0, delay_ms=20.0, jitter_ms=10.0, loss_percent=20.0)
ORDERS = (
    begin(0, Partition(((0, 1), (2,)), "one_way")),
    begin(1, Jam((1.0, 1.0, 0.0), 1.5)),
    begin(2, Flap(0.3), at_s=0.1),
    begin(3, Heal()),
    begin(4, Sabotage("replay", (0, 2), delay_s=0.03)),
    begin(5, Sabotage("spoof", (1,), per_s=300.0)),
    end(1),
    end(2),
)
shares = st.lists(st.integers(0, AGENTS - 1), min_size=AGENTS, max_size=AGENTS).map(
    lambda owner: [
        [agent for agent in range(AGENTS) if owner[agent] == shard] for shard in set(owner)
    ]
)


def played(mediums, seed, shuffled=None, slots=60):
    """Send the same frames through some mediums; yield the time [s] after each slot."""
    random = Random(seed)
    for slot in range(slots):
        places = [tuple(random.uniform(-2.0, 2.0) for _ in range(3)) for _ in range(AGENTS)]
        if slot % 10 == 7:
            places[random.randrange(AGENTS)] = None
        sizes = [[random.randrange(200) for _ in range(random.randrange(4))] for _ in places]
        order = list(range(AGENTS))
        if shuffled is not None:
            shuffled.shuffle(order)
        for medium in mediums:
            if slot % 8 == 4:
                medium.apply(ORDERS[slot // 8 % len(ORDERS)])
            medium.place(tuple(places))
            for agent in order:
                frames = tuple(
                    Outgoing(at % 2, bytes(size)) for at, size in enumerate(sizes[agent])
                )
                medium.transmit(agent, slot * SLOT_S, Transmission(slot, 0, frames))
            medium.sabotage(slot * SLOT_S)
        yield (slot + 1) * SLOT_S


def setup(conditions=ROUGH, seed=3):
    return MediumSetup(seed, AGENTS, 4, 1.0 / SLOT_S, conditions)


@settings(derandomize=True, deadline=None, max_examples=25)
@given(shares, st.integers(0, 99), st.sampled_from([ROUGH, LOSSY, Conditions()]))
def test_shards_have_the_verdicts_the_frames_and_the_digest_of_one_medium(owners, seed, conditions):
    whole = Medium(setup(conditions))
    shards = [Medium(setup(conditions), receivers) for receivers in owners]
    digest = Digest()
    for now_s in played([whole, *shards], seed):
        for shard, receivers in zip(shards, owners, strict=True):
            for agent in receivers:
                assert shard.collect(agent, now_s) == whole.collect(agent, now_s)
        digest.update(joined_pages(shard.pages() for shard in shards))
        assert digest.value == whole.digest()
    counters = whole.counters(0)
    parts = [shard.counters(0) for shard in shards]
    assert all((part.sent, part.sent_b) == (counters.sent, counters.sent_b) for part in parts)
    for name in ("addressed", "in_flight", "duplicated", "corrupted"):
        assert sum(getattr(part, name) for part in parts) == getattr(counters, name)
    for fate, count in counters.fates.items():
        assert sum(part.fates[fate] for part in parts) == count


@settings(derandomize=True, deadline=None, max_examples=25)
@given(st.integers(0, 99), st.integers(0, 99))
def test_verdicts_do_not_depend_on_the_order_in_which_agents_send(seed, shuffle_seed):
    plain, mixed = Medium(setup()), Medium(setup())
    heard = []
    for medium, shuffled in ((plain, None), (mixed, Random(shuffle_seed))):
        heard.append(
            [
                [medium.collect(agent, now_s) for agent in range(AGENTS)]
                for now_s in played([medium], seed, shuffled)
            ]
        )
    assert heard[0] == heard[1]
    one, other = plain.counters(0), mixed.counters(0)
    assert (one.fates, one.in_flight, one.duplicated) == (
        other.fates,
        other.in_flight,
        other.duplicated,
    )


@settings(derandomize=True, deadline=None, max_examples=25)
@given(st.integers(0, 99))
def test_under_all_conditions_every_frame_has_one_fate_or_is_in_flight(seed):
    medium, came, history = Medium(setup()), 0, []
    for now_s in played([medium], seed, slots=100):
        came += sum(len(medium.collect(agent, now_s)) for agent in range(AGENTS))
        counters = medium.counters(0)
        history.append(counters)
        assert counters.addressed == sum(counters.fates.values()) + counters.in_flight
        assert counters.addressed == counters.sent * (AGENTS - 1) + counters.duplicated
        assert counters.fates["delivered"] == came
    occurred = {fate for each in history for fate, count in each.fates.items() if count}
    assert occurred == set(history[0].fates)
    assert history[-1].duplicated > 0
    assert history[-1].corrupted > 0
