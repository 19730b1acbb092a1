"""The saboteur: what it sends, when, and that it enters the medium as any sender's frames do."""

from collections import Counter

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agent.codec import add_checksum, decode_beacon, decode_gossip, encode
from agent.messages import Beacon, Gossip, Record
from agent.rejection import RejectedError
from netem.faults import Sabotage
from netem.link_parameters import Conditions
from netem.medium import Medium
from netem.messages import MediumSetup
from netem.saboteur import Saboteur, ahead, garbage
from netem.wire.channels import LOCAL, MAX_PAYLOAD_B, MULTIHOP
from netem.wire.frame import Batch, Outgoing, Transmission, pack, unpack_batch
from tests.netem.fault_orders import begin, end

SLOT_S = 0.0125
AGENTS = 4
HERE = ((0.0, 0.0, 0.0),) * AGENTS
KINDS = ("replay", "spoof", "garbage", "flood")
ZERO = (0.0, 0.0, 0.0)


def beacon(agent, sequence=1, stamp_s=0.5):
    return add_checksum(
        encode(
            Beacon(
                id=agent,
                incarnation=0,
                sequence=sequence,
                stamp_s=stamp_s,
                position=(1.5, 2.5, 0.0),
                velocity=ZERO,
                target=ZERO,
                queue=0,
                rank=1,
                cost_mm=5,
                speed_cap=1.0,
                echoes=((0, 3),),
                mission=0,
                frame_key=0,
                frame=(0.0, 0.0, 0.0, 0.0),
                drift=None,
                blocked=(),
                standing=None,
            )
        )
    )


def gossip(agent, stamp_s=0.5):
    record = Record(
        id=agent,
        incarnation=0,
        version=7,
        stamp_s=stamp_s,
        position=ZERO,
        queue=0,
        rank=1,
        cost_mm=5,
        mission=0,
        blocked=(),
    )
    return add_checksum(
        encode(Gossip(id=agent, stamp_s=stamp_s, records=(record, record), piece=None))
    )


CLEAN = Conditions()


def medium(conditions=CLEAN, seed=3):
    return Medium(MediumSetup(seed, AGENTS, 4, 1.0 / SLOT_S, conditions))


def played(radio, slots, silent=()):
    """Let every agent send a beacon and a gossip in each of some slots; return what each heard."""
    heard = [[] for _ in HERE]
    for slot in range(slots):
        now_s = slot * SLOT_S
        radio.place(HERE)
        for agent in range(AGENTS):
            if agent in silent:
                continue
            frames = (
                Outgoing(LOCAL, beacon(agent, slot, now_s)),
                Outgoing(MULTIHOP, gossip(agent, now_s)),
            )
            radio.transmit(agent, now_s, Transmission(slot, 0, frames))
        radio.sabotage(now_s)
        for agent in range(AGENTS):
            got = radio.collect(agent, now_s + SLOT_S)
            assert unpack_batch(pack(Batch(slot, got))).frames == got
            heard[agent] += [(now_s, frame) for frame in got]
    return heard


def conserved(radio):
    counters = radio.packets()
    fates = ("delivered", "dropped_range", "dropped_loss", "dropped_medium")
    fates += ("dropped_partition", "dropped_queue", "in_flight")
    return counters["addressed"] == sum(counters[fate] for fate in fates)


def test_a_replay_sends_each_frame_once_more_byte_for_byte_and_so_much_later():
    radio = medium()
    radio.apply(begin(0, Sabotage("replay", (1,), delay_s=0.5)))
    heard = played(radio, 100)[0]
    times = {}
    for now_s, frame in heard:
        times.setdefault((frame.source, frame.payload), []).append(now_s)
    for (source, _), found in times.items():
        again = source == 1 and found[0] + 0.5 < 99.5 * SLOT_S
        assert len(found) == (2 if again else 1)
        if again:
            assert found[1] - found[0] == pytest.approx(0.5)
    assert dict(radio.counters(0).struck)[0] == (AGENTS - 1) * 2 * 60


@pytest.mark.parametrize("kind", KINDS)
def test_a_saboteurs_frames_count_as_sent_and_are_conserved(kind):
    rough = Conditions(loss_percent=20.0, delay_ms=30.0, duplicate_percent=20.0, rate_kbit=900.0)
    radio = medium(rough)
    radio.apply(begin(0, Sabotage(kind, (1, 2), delay_s=0.1)))
    played(radio, 80)
    own = 80 * AGENTS * 2
    added = radio.sent - own
    assert added > 100
    assert conserved(radio)
    assert 0 < dict(radio.counters(0).struck)[0] <= 2 * added * (AGENTS - 1)
    radio.apply(end(0))
    played(radio, 1)
    assert radio.sent == own + added + AGENTS * 2


def test_it_sends_at_its_rate_by_each_radio_that_there_is():
    radio = medium()
    radio.apply(begin(0, Sabotage("garbage", (1, 2), per_s=40.0)))
    played(radio, 81)
    assert radio.sent == 81 * AGENTS * 2 + 2 * 40
    off = medium()
    off.apply(begin(0, Sabotage("garbage", (1,), per_s=40.0)))
    off.place((HERE[0], None, HERE[2], HERE[3]))
    off.sabotage(1.0)
    assert off.sent == 0


@pytest.mark.parametrize("kind", KINDS)
def test_the_agents_own_frames_have_the_fates_that_they_have_without_a_saboteur(kind):
    lossy = Conditions(loss_percent=50.0, delay_ms=30.0, jitter_ms=20.0)
    alone, beside = medium(lossy), medium(lossy)
    beside.apply(begin(0, Sabotage(kind, (1,), delay_s=0.1)))
    own, among = played(alone, 60), played(beside, 60)
    forged = 2**52
    for plain, mixed in zip(own, among, strict=True):
        assert plain == [(now_s, frame) for now_s, frame in mixed if frame.count < forged]


def test_what_it_sends_belongs_to_its_fault_and_the_seed():
    def sent(seed, number):
        radio = medium(seed=seed)
        radio.apply(begin(number, Sabotage("garbage", (1,))))
        return [frame.payload for _, frame in played(radio, 40)[0] if frame.count >= 2**52]

    assert sent(1, 4) == sent(1, 4)
    assert sent(1, 4) != sent(1, 5)
    assert sent(1, 4) != sent(2, 4)


def test_a_spoofed_frame_claims_another_agent_and_a_higher_incarnation_and_sequence():
    radio = medium()
    radio.apply(begin(0, Sabotage("spoof", (1,))))
    heard = [frame for _, frame in played(radio, 100)[0] if frame.count >= 2**52]
    claimed = Counter()
    for frame in heard:
        assert frame.source == 1
        if frame.channel == LOCAL:
            said = decode_beacon(frame.payload)
            assert (said.incarnation, said.sequence >= 1000) == (1, True)
        else:
            said = decode_gossip(frame.payload)
            assert said.records[0].incarnation == 1
        claimed[said.id] += 1
    assert set(claimed) == {0, 2, 3}


def test_without_anything_overheard_it_sends_noise_or_nothing():
    for kind, sent in (("garbage", 200), ("spoof", 0), ("flood", 0), ("replay", 0)):
        radio = medium()
        radio.apply(begin(0, Sabotage(kind, (1,))))
        played(radio, 81, silent=range(AGENTS))
        assert radio.sent == sent


@settings(derandomize=True, deadline=None, max_examples=400)
@given(
    st.one_of(
        st.just(b""),
        st.just(beacon(3)),
        st.just(gossip(3)),
        st.binary(max_size=MAX_PAYLOAD_B),
    ),
    st.randoms(use_true_random=False),
)
def test_garbage_fits_the_radio_and_is_no_message(payload, random):
    for _ in range(20):
        found = garbage(payload, random)
        assert len(found) <= MAX_PAYLOAD_B
        for decode in (decode_beacon, decode_gossip):
            with pytest.raises(RejectedError) as rejected:
                decode(found)
            assert rejected.value.cause in {"corrupt", "garbage", "invalid"}


@given(st.binary(max_size=200), st.sampled_from((LOCAL, MULTIHOP)))
def test_of_a_payload_that_it_does_not_understand_it_sends_something_that_fits(payload, channel):
    assert len(ahead(payload, channel)) <= MAX_PAYLOAD_B


def test_it_forgets_the_oldest_of_too_many_frames_to_repeat():
    saboteur = Saboteur(bytes(32), 0, 0.0, Sabotage("replay", (1,), delay_s=60.0))
    for slot in range(11_000):
        frames = (Outgoing(LOCAL, slot.to_bytes(4, "big")),)
        saboteur.overhear(1, 0.0, Transmission(slot, 0, frames))
    repeated = list(saboteur.due(100.0))
    assert len(repeated) == 10_000
    assert repeated[-1].payload == (10_999).to_bytes(4, "big")
