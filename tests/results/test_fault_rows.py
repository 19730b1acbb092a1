"""Proof of effect: a run says what each fault struck, and does not pass if one struck nothing."""

import pytest

from tests.small_scenario import SMALL
from worldsim.campaign.pool import finished
from worldsim.engine.slow_controllers import SlowControllers
from worldsim.engine.starvation import Starvation
from worldsim.engine.virtual import fly
from worldsim.results.fault_rows import fault_texts, idle_text
from worldsim.results.summary import Summary, summarise
from worldsim.scenario.file import parse
from worldsim.truth.agent_clocks import AgentClocks
from worldsim.truth.pose_errors import PoseErrors

STRIKE = {
    "partition": ("partition = [[0], [1]]", "frames"),
    "jam": ("jam = { centre_m = [0, 0, 0], radius_m = 20 }", "frames"),
    "flap": ("flap = { period_s = 0.2 }", "frames"),
    "netem": ("netem = { delay_ms = 20 }", "frames"),
    "sabotage": ("sabotage = { kind = 'flood', agents = [1] }", "frames"),
    "sensor": ('sensor = { agents = [1], mode = "silent" }', "readings"),
    "clock": ("clock = { agents = [1], offset_s = 1 }", "readings"),
    "pose": ("pose = { agents = [1], bias_m = [0, 0, 1] }", "readings"),
    "slow": ("slow = { agents = [1], delay_s = 0.2 }", "steps"),
    "starve": ("starve = { agents = [1], cpu_percent = 20 }", "steps"),
    "pause": ("pause = [1]", "agents"),
    "kill": ("kill = [1]", "agents"),
    "leave": ("leave = [1]", "agents"),
}
MISS = {
    "clock": "clock = { agents = [1], offset_s = 1 }\n[[event]]\nat_s = 2.0\nleave = [1]",
    "partition": "partition = [[0, 1]]",
    "jam": "jam = { centre_m = [500, 0, 0], radius_m = 1 }",
    "netem": "netem = { loss_percent = 0 }",
    "restart": "restart = [1]",
    "resume": "resume = [1]",
}
SENSED = '[vehicle]\nsensors = ["proximity"]\n'
LEFT = "[[event]]\nat_s = 2.0\nleave = [1]\n"


def flown(*events: str, expect: str = "", before: str = "") -> Summary:
    tables = "".join(f"[[event]]\n{event}\n" for event in events)
    scenario = parse(f"{SMALL}{SENSED}{before}{tables}[expect]\nconverge = false\n{expect}")
    return summarise(scenario, finished(fly(scenario), scenario))


@pytest.mark.parametrize("kind", STRIKE)
def test_a_fault_says_when_it_was_in_force_and_what_it_struck(kind: str) -> None:
    fault, counted = STRIKE[kind]
    summary = flown(f"at_s = 3.0\nfor_s = 1.0\n{fault}")
    (row,) = summary["faults"]
    assert (row["number"], row["kind"], row["from_s"], row["to_s"]) == (0, kind, 3.0, 4.0)
    assert row[counted]  # type: ignore[literal-required]
    assert idle_text(summary["faults"]) is None


def test_a_change_of_the_radio_says_which_keys_it_changed_from_what_to_what() -> None:
    outer = (
        "at_s = 1.0\nnetem = { loss_percent = 20, local = { delay_ms = 40 },"
        " gemodel = { p_percent = 1, r_percent = 50 } }"
    )
    inner = (
        "at_s = 2.0\nfor_s = 1.0\nnetem = { loss_percent = 50, rate_kbit = 900,"
        " local = { delay_ms = 60, jitter_ms = 5 }, link = [{ from = 0, to = 1, range_m = 3 }] }"
    )
    first, second = (summary := flown(outer, inner))["faults"]
    burst = {"p_percent": 1, "r_percent": 50, "loss_bad_percent": 100, "loss_good_percent": 0}
    assert first["settings"] == {
        "loss_percent": {"from": 0, "to": 20},
        "gemodel": {"from": None, "to": burst},
        "local.delay_ms": {"from": 0, "to": 40},
    }
    assert second["settings"] == {
        "loss_percent": {"from": 20, "to": 50},
        "rate_kbit": {"from": None, "to": 900},
        "local.delay_ms": {"from": 40, "to": 60},
        "local.jitter_ms": {"from": 0, "to": 5},
        "link.0-1.range_m": {"from": None, "to": 3},
    }
    begins = (
        "netem (loss_percent 20 to 50, rate_kbit none to 900, local.delay_ms 40 to 60, 2 more), 2"
    )
    assert fault_texts(summary["faults"])[1].startswith(begins)


@pytest.mark.parametrize(
    ("kind", "settings"),
    [
        ("partition", {"groups": [[0], [1]], "kind": "clean", "bridge": []}),
        ("jam", {"centre_m": [0, 0, 0], "radius_m": 20}),
        ("flap", {"period_s": 0.2, "links": []}),
        ("kill", None),
    ],
)
def test_a_fault_of_the_radio_says_its_keys(kind: str, settings: object) -> None:
    (row,) = flown(f"at_s = 3.0\nfor_s = 1.0\n{STRIKE[kind][0]}")["faults"]
    assert row["settings"] == settings


@pytest.mark.parametrize(
    ("kind", "model"),
    [
        ("clock", AgentClocks),
        ("pose", PoseErrors),
        ("slow", SlowControllers),
        ("starve", Starvation),
    ],
)
def test_without_the_model_of_a_fault_nothing_is_struck_and_the_run_says_so(
    monkeypatch: pytest.MonkeyPatch, kind: str, model: type[object]
) -> None:
    monkeypatch.setattr(model, "begin", lambda *_: None)
    summary = flown(f"at_s = 3.0\nfor_s = 1.0\n{STRIKE[kind][0]}")
    assert summary["outcome"] == "inconclusive"
    assert summary["reason"] == f"the {kind} at 3 s struck nothing"


def test_a_fault_that_is_in_force_to_the_end_has_no_end() -> None:
    (row,) = flown("at_s = 3.0\npartition = [[0], [1]]")["faults"]
    assert row["to_s"] is None
    assert fault_texts([row]) == [f"partition, 3 s to the end: cut {row['frames']} frames"]


def test_a_heal_ends_the_partitions() -> None:
    (row,) = flown("at_s = 3.0\npartition = [[0], [1]]", "at_s = 4.0\nheal = true")["faults"]
    assert row["to_s"] == 4.0


def test_a_fault_whose_agents_another_fault_still_holds_has_ended() -> None:
    rows = flown("at_s = 1.0\nfor_s = 1.0\nkill = [1]", "at_s = 1.5\nkill = [1]")["faults"]
    assert [(row["to_s"], row["agents"]) for row in rows] == [(2.0, [1]), (None, [1])]


def test_of_changes_of_the_radio_that_do_the_same_the_first_counts() -> None:
    slow = "at_s = 3.0\nfor_s = 1.0\nnetem = { delay_ms = 20 }"
    parts = "at_s = 3.0\nfor_s = 1.0\nnetem = { local.delay_ms = 20, multihop.delay_ms = 20 }"
    for first, second in ((slow, slow), (parts, slow), (slow, parts)):
        before, after = flown(first, second)["faults"]
        assert (before["frames"] or 0) > 0
        assert after["frames"] == 0


def test_a_run_whose_fault_strikes_nothing_does_not_pass() -> None:
    missed = flown(f"at_s = 3.0\n{MISS['jam']}", f"at_s = 4.0\n{MISS['netem']}")
    assert missed["outcome"] == "inconclusive"
    assert missed["reason"] == "the jam at 3 s and the netem at 4 s struck nothing"
    allowed = flown(f"at_s = 3.0\n{MISS['jam']}", expect="idle_faults = true")
    assert (allowed["outcome"], allowed["reason"]) == ("pass", None)
    assert fault_texts(allowed["faults"]) == ["jam, 3 s to the end: struck nothing"]


def test_of_many_faults_the_first_are_told_and_the_others_counted() -> None:
    rows = flown(f"at_s = 1.0\nfor_s = 0.05\nevery_s = 0.1\n{MISS['jam']}")["faults"]
    reason = "the jam at 1 s and the jam at 1.1 s and the jam at 1.2 s and"
    assert idle_text(rows) == f"{reason} {len(rows) - 3} more struck nothing"
    texts = fault_texts(rows)
    assert len(texts) == 21
    assert texts[-1] == f"{len(rows) - 20} more faults: see summary.json"


@pytest.mark.parametrize("kind", MISS)
def test_a_fault_that_misses_is_found(kind: str) -> None:
    assert (
        idle_text(flown(f"at_s = 3.0\n{MISS[kind]}")["faults"])
        == f"the {kind} at 3 s struck nothing"
    )


@pytest.mark.parametrize("mode", ["stuck", "silent", "wrong"])
def test_a_fault_of_sensors_that_changes_no_reading_is_found(mode: str) -> None:
    """An agent alone, far from everything, has an empty reading however its sensor fails."""
    alone = flown(f"at_s = 3.0\nsensor = {{ agents = [0], mode = '{mode}' }}", before=LEFT)
    assert idle_text(alone["faults"]) == "the sensor at 3 s struck nothing"
