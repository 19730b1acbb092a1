"""A fault of the radio excuses a team exactly where it keeps running agents from hearing others."""

import pytest

from netem.faults import Flap, Jam, Partition, RadioFault
from netem.link_parameters import Conditions, DirectedLink, LinkKeys
from tests.judge.test_asked_time import CONVERGE, found, judged, kill
from tests.judge.test_held_formation import away, radio, rows
from worldsim.judge.verdict import Judge
from worldsim.results.expectation_text import Circumstances, RecoveryRow, expectation_texts

FAR = Jam((500.0, 0.0, 0.0), 0.5)
DEAF = Conditions(link=tuple(DirectedLink(source=0, to=to, loss_percent=100) for to in range(1, 5)))


def words(judge: Judge) -> str:
    recoveries: list[RecoveryRow] = [
        {
            "t_s": each.t_s,
            "kind": each.kind,
            "agents": each.agents,
            "reformed_s": each.reformed_s,
            "timed_from_s": each.timed_from_s,
            "asked_s": each.asked_s,
            "overtaken_s": each.overtaken_s,
            "in_place_from_s": each.in_place_from_s,
            "changed": each.changed,
        }
        for each in judge.recoveries
    ]
    row = rows(judge)["reform_within_s"].row
    return expectation_texts([row], Circumstances(20.0, [], recoveries))[0]


@pytest.mark.parametrize(
    ("fault", "excused"),
    [
        (Conditions(loss_percent=100.0), True),
        (Conditions(range_m=0.01), True),
        (Conditions(local=LinkKeys(loss_percent=100.0)), True),
        (Conditions(multihop=LinkKeys(loss_percent=100.0)), True),
        (Conditions(delay_ms=6000.0), True),
        (DEAF, True),
        (Conditions(rate_kbit=0.2), True),
        (Conditions(rate_kbit=100.0, rate_overhead_b=10_000, delay_ms=4900.0), True),
        (Conditions(rate_kbit=1.0, limit=2), False),
        (Conditions(rate_kbit=100.0), False),
        (Partition(((0,),)), True),
        (Jam((0.0, 0.0, 0.0), 5.0), True),
        (Flap(1.0, ((0, 1),)), True),
        (Conditions(loss_percent=50.0), False),
        (Conditions(delay_ms=200.0), False),
        (Partition(((0, 1, 2, 3, 4),)), False),
        (FAR, False),
        (Flap(1.0, ((0, 7),)), False),
    ],
)
def test_a_loss_is_excused_while_the_radio_keeps_agents_from_hearing_others(
    fault: RadioFault, excused: bool
) -> None:
    """There is no agent 7: a flap of its links cuts nobody from hearing others."""
    judge = judged(away(8.0, 99.0), [kill(8.0), *radio((9.0, 0, fault))])
    row = rows(judge)["reform_within_s"]
    assert row.held is (None if excused else False)
    after = judged(away(8.0, 99.0), [kill(8.0), *radio((9.0, 0, fault), (12.0, 0, None))])
    assert rows(after)["reform_within_s"].held is False


def test_a_jam_far_away_takes_no_time_of_the_team() -> None:
    jam = radio((0.0, 0, FAR), (9.0, 0, None))
    judge = judged(away(10.0, 15.0), jam, within_s=0.1)
    assert found(rows(judge)[CONVERGE])[1] is False
    assert judge.recoveries == []
    assert rows(judge)["in_formation_fraction"].got == pytest.approx(
        rows(judged(away(10.0, 15.0), []))["in_formation_fraction"].got
    )


def test_a_jam_excuses_from_when_an_agent_flies_into_it() -> None:
    height = Jam((0.0, 0.0, 50.0), 10.0)
    judge = judged(away(9.0, 12.0, off_m=45.0), [kill(8.0), *radio((7.0, 0, height))])
    (lost,) = judge.recoveries
    assert lost.timed_from_s == 12.0


def test_the_words_tell_what_conditions_changed() -> None:
    lossy = Conditions(loss_percent=50.0)
    assert "netem (loss_percent = 50) at 8 s: not re" in words(
        judged(away(8.0, 99.0), radio((8.0, 0, lossy)))
    )
    assert "netem (end of loss_percent = 50) at 8 s: not re" in words(
        judged(away(8.0, 99.0), radio((5.0, 0, lossy), (8.0, 0, None)))
    )


def test_the_words_tell_that_a_team_was_whole_but_had_not_stood_for_long_enough() -> None:
    lossy = radio((11.0, 0, Conditions(loss_percent=50.0)))
    off_m = away(8.0, 10.0), away(11.0, 13.5)
    judge = judged(lambda time_s: max(each(time_s) for each in off_m), [kill(8.0), *lossy])
    assert words(judge) == (
        "kill of a4 at 8 s: the team was whole after 2 s, but had stood for only 1 s of 2 s"
        " when the netem (loss_percent = 50) at 11 s overtook it (limit 3 s; margin -2.5 s)"
    )
    assert words(judged(away(17.0, 18.5), [kill(17.0)])) == (
        "kill of a4 at 17 s: the team was whole after 1.5 s, but had stood for only 1.5 s of 2 s"
        " when the run ended (limit 3 s)"
    )
