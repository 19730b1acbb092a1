"""Record tables that hear, relay, wait and forget in any order, against a model of a few lines.

The model keeps for each subject the newest statement ever adopted, and whether it is shown. So a
merge is a maximum: in any order, and any number of times, it comes to the same; and a member that
was forgotten does not come back by what was said before.
"""

from copy import deepcopy

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from agent.codec import decode_gossip
from agent.comms.gossip import RecordTable
from agent.messages import Record
from tests.agent.comms.builders import gossip, heard_beacon, record

OWN = (10, 11, 12)
"""Ids of the agents whose tables these are."""
SUBJECTS = (1, 2, 3)
ROUND_S = 0.5
SLACK_S = 0.1
RELAYED_SILENCE_S = 6.0
OLDEST_S = 12.0
LONGEST_SILENCE_S = RELAYED_SILENCE_S + 2.0 * OLDEST_S
tables = st.integers(0, len(OWN) - 1)
subjects = st.sampled_from(SUBJECTS)
picks = st.lists(st.integers(0, 40), min_size=1, max_size=5)

Key = tuple[int, int]
"""Incarnation and version of a statement."""


def key_of(said: Record) -> Key:
    return said.incarnation, said.version


def content(table: RecordTable, own: int, now_s: float) -> dict[int, Record]:
    """Return what a table passes on, without the own record, by subject."""
    payloads = table.frames(now_s, record(own, 1, now_s))
    records = [each for payload in payloads for each in decode_gossip(payload).records]
    return {each.id: each for each in records if each.id != own}


class Tables(RuleBasedStateMachine):
    """Three tables, and what three others have said of themselves so far."""

    def __init__(self) -> None:
        super().__init__()
        self.now_s = 1.0
        self.counts = dict.fromkeys(SUBJECTS, (0, 0))
        self.said: list[Record] = []
        self.tables = [RecordTable(own, 1.0 / ROUND_S) for own in OWN]
        self.last: list[dict[int, Key]] = [{} for _ in OWN]
        self.shown: list[dict[int, Record]] = [{} for _ in OWN]
        self.direct: list[set[int]] = [set() for _ in OWN]
        """Subjects whose newest statement is a beacon."""

    def chosen(self, numbers: list[int]) -> list[Record]:
        return [self.said[number % len(self.said)] for number in numbers]

    @rule(subject=subjects)
    def speak(self, subject: int) -> None:
        incarnation, version = self.counts[subject]
        self.counts[subject] = incarnation, version + 1
        self.now_s += 0.01
        self.said.append(record(subject, version + 1, self.now_s, incarnation=incarnation))

    @rule(subject=subjects)
    def restart(self, subject: int) -> None:
        self.counts[subject] = self.counts[subject][0] + 1, 0

    @rule(wait_s=st.sampled_from([0.5, 4.0, 7.0, 15.0]))
    def wait(self, wait_s: float) -> None:
        self.now_s += wait_s

    @precondition(lambda self: self.said)
    @rule(which=tables, numbers=picks)
    def hear_records(self, which: int, numbers: list[int]) -> None:
        """Old, doubled and re-ordered ones among them."""
        self.adopt(which, self.chosen(numbers))

    @precondition(lambda self: self.said)
    @rule(which=tables, number=st.integers(0, 40))
    def hear_a_beacon(self, which: int, number: int) -> None:
        (said,) = self.chosen([number])
        fields = {"incarnation": said.incarnation, "at": said.position}
        self.tables[which].adopt_beacon(heard_beacon(said.id, said.version, said.stamp_s, **fields))
        if self.is_news(which, said):
            self.note(which, said)
            self.direct[which].add(said.id)

    @rule(sender=tables, receiver=tables)
    def relay(self, sender: int, receiver: int) -> None:
        if sender != receiver:
            told = content(self.tables[sender], OWN[sender], self.now_s)
            self.adopt(receiver, [told[subject] for subject in sorted(told)])

    @rule(which=tables, heard=st.sets(subjects))
    def forget(self, which: int, heard: set[int]) -> None:
        before = dict(self.shown[which])
        departed = self.tables[which].forget_silent(self.now_s, heard)
        left = content(self.tables[which], OWN[which], self.now_s)
        assert sorted(each.stamp_s for each in departed) == sorted(
            said.stamp_s for subject, said in before.items() if subject not in left
        )
        for subject, said in before.items():
            age_s = self.now_s - said.stamp_s
            if subject in self.direct[which]:
                assert (subject in left) == (subject in heard)
            elif age_s <= RELAYED_SILENCE_S:
                assert subject in left
            elif age_s > LONGEST_SILENCE_S:
                assert subject not in left
        self.shown[which] = {subject: before[subject] for subject in left}
        self.direct[which] &= left.keys()

    @precondition(lambda self: self.said)
    @rule(which=tables, numbers=picks)
    def merge_in_other_orders(self, which: int, numbers: list[int]) -> None:
        records, outcomes = self.chosen(numbers), []
        for order in (records, records[::-1], records * 2, records[1:] + records[:1]):
            merged = deepcopy(self.tables[which])
            for each in order:
                merged.adopt(gossip(9, self.now_s, [each]), self.now_s, SLACK_S)
            outcomes.append(content(merged, OWN[which], self.now_s))
        whole = deepcopy(self.tables[which])
        whole.adopt(gossip(9, self.now_s, records), self.now_s, SLACK_S)
        outcomes.append(content(whole, OWN[which], self.now_s))
        assert all(each == outcomes[0] for each in outcomes)

    def adopt(self, which: int, records: list[Record]) -> None:
        self.tables[which].adopt(gossip(9, self.now_s, records), self.now_s, SLACK_S)
        for said in records:
            if self.is_news(which, said) and self.now_s - said.stamp_s <= OLDEST_S:
                self.note(which, said)
                self.direct[which].discard(said.id)

    def is_news(self, which: int, said: Record) -> bool:
        return key_of(said) > self.last[which].get(said.id, (-1, -1))

    def note(self, which: int, said: Record) -> None:
        self.last[which][said.id] = key_of(said)
        self.shown[which][said.id] = said

    @invariant()
    def tables_show_what_the_model_shows(self) -> None:
        for own, table, shown in zip(OWN, self.tables, self.shown, strict=True):
            assert content(table, own, self.now_s) == shown


TestTables = Tables.TestCase
TestTables.settings = settings(
    derandomize=True, deadline=None, max_examples=40, stateful_step_count=30
)
