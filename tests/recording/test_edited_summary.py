"""Every figure of a summary that its recording shows: a changed one is named, and proves nothing.

A bad recording, of any kind, never ends the process that reads it.
"""

import json
import random
import shutil
from collections.abc import Iterator
from copy import deepcopy
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import pytest

from netem.wire.shutdown import StopRequest
from worldsim.campaign.pool import Job, simulate
from worldsim.recording.comparison import ADDED_LATER, COUNTS, SCHEMA, UNRECORDED, is_idle
from worldsim.recording.verify import Verification, compared, judged_again, verify
from worldsim.results.fault_rows import idle_text
from worldsim.results.verdict_text import verified
from worldsim.scenario.file import parse

SCENARIO = """
name = "edited"
duration_s = 6.0
[fleet]
agents = 3
[formation]
name = "line"
vertices = { V1 = [0, 0, 0] }
[[formation.queue]]
name = "Q1"
vertices = ["V1"]
shape = { kind = "ray", direction = [-1, 0, 0] }
orientation = { yaw_deg = "0" }
[[obstacle]]
shape = "sphere"
centre_m = [9, 9, 9]
radius_m = 0.5
[[event]]
at_s = 2.0
kill = [2]
[[event]]
at_s = 3.0
for_s = 1.0
partition = [[0]]
[expect]
converge = false
"""
BITS = (1, 1, 1, 1, 3, 3, 20, 20, 300, 300)
"""Flipped bits in each damaged recording."""


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a flown run."""
    folder = tmp_path_factory.mktemp("edited") / "run"
    simulate(Job(parse(SCENARIO), folder, recording=True), StopRequest())
    return folder


@pytest.fixture(scope="module")
def judged(run: Path) -> Verification:
    return judged_again(run, run / "run.rrd")


def paths_in(value: Any, *above: str | int) -> Iterator[tuple[str | int, ...]]:
    """Yield the path of every plain value, and of every table and list."""
    if above:
        yield above
    items = value.items() if isinstance(value, dict) else ()
    items = enumerate(value) if isinstance(value, list) else items
    for key, inner in items:
        yield from paths_in(inner, *above, key)


def another(value: Any) -> Any:
    """Return a value that differs as little as its type allows."""
    match value:
        case bool():
            return not value
        case int() | float():
            return value + 1e-12 if abs(value) < 1.0 else value * (1.0 + 1e-15)
        case str():
            return f"{value}x"
        case None:
            return 0.5
        case list():
            return value[:-1] if value else [1]
    return dict(list(value.items())[1:]) if value else {"more": 1}


def without_figures(summary: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in summary.items() if key not in {*UNRECORDED, "schema"}}


def test_the_summary_as_it_was_written_agrees(run: Path, judged: Verification) -> None:
    verification = compared(judged, run / "summary.json")
    assert verification.differences == ()
    assert verification.inconclusive is None
    summary = json.loads((run / "summary.json").read_text())
    assert set(without_figures(summary)) == {*judged.figures, "outcome"}
    assert {*judged.figures, *UNRECORDED, "outcome", "schema"} == set(summary)
    assert summary["schema"] == SCHEMA


def test_any_changed_figure_is_named_and_proves_nothing(
    run: Path, judged: Verification, tmp_path: Path
) -> None:
    summary = json.loads((run / "summary.json").read_text())
    edited = tmp_path / "summary.json"
    unfound = []
    for *above, key in paths_in(without_figures(summary)):
        if (*above, key) == ("packets", "rejected"):
            continue  # no figure of the recording: a contradiction
        if above[:1] == ["faults"] and key in COUNTS:
            continue
        changed = deepcopy(summary)
        table = changed
        for each in above:
            table = table[each]
        table[key] = another(table[key])
        edited.write_text(json.dumps(changed))
        verification = compared(judged, edited)
        named = any(each.key.startswith(str([*above, key][0])) for each in verification.differences)
        if not named or verification.exit_status != 3:
            unfound.append([*above, key])
    assert unfound == []


def test_a_fault_that_a_summary_adds_or_moves_is_named(
    run: Path, judged: Verification, tmp_path: Path
) -> None:
    summary = json.loads((run / "summary.json").read_text())
    first, second = summary["faults"]
    edited = tmp_path / "summary.json"
    for faults in ([first], [first, first], [first, second, {**first, "number": 7}], {}, 3):
        edited.write_text(json.dumps({**summary, "faults": faults}))
        assert compared(judged, edited).exit_status == 3


def test_a_key_that_a_summary_lacks_is_named(
    run: Path, judged: Verification, tmp_path: Path
) -> None:
    summary = json.loads((run / "summary.json").read_text())
    for key in summary:
        rest = {other: value for other, value in summary.items() if other != key}
        (tmp_path / "summary.json").write_text(json.dumps(rest))
        named = [each.key for each in compared(judged, tmp_path / "summary.json").differences]
        assert any(each.partition(".")[0] == key for each in named), key


def test_the_summary_of_an_older_recording_may_lack_keys(
    run: Path, judged: Verification, tmp_path: Path
) -> None:
    summary = json.loads((run / "summary.json").read_text())
    rest = {key: value for key, value in summary.items() if key not in ADDED_LATER}
    (tmp_path / "summary.json").write_text(json.dumps(rest))
    older = compared(replace(judged, exact=False), tmp_path / "summary.json")
    assert older.differences == ()


def test_an_outcome_that_the_run_cannot_have_is_named(
    run: Path, judged: Verification, tmp_path: Path
) -> None:
    """No host is too slow for virtual time, and a fault that struck nothing allows no pass."""
    summary = json.loads((run / "summary.json").read_text())
    slow = {"outcome": "inconclusive", "reason": "the host was too slow"}
    failed = replace(judged, outcome="fail", passes=False)
    for flown in (judged, failed):
        (tmp_path / "summary.json").write_text(json.dumps(summary | slow))
        verification = compared(flown, tmp_path / "summary.json")
        assert [each.key for each in verification.differences] == ["outcome"]
    summary["faults"][1]["frames"] = 0
    (tmp_path / "summary.json").write_text(json.dumps(summary))
    verification = compared(judged, tmp_path / "summary.json")
    assert verification.contradictions == ("outcome is pass, but faults.1 struck nothing",)
    assert verification.exit_status == 3
    allowed = compared(replace(judged, idle_faults=True), tmp_path / "summary.json")
    assert allowed.contradictions == ()
    idle = {"outcome": "inconclusive", "reason": "the partition at 3 s struck nothing"}
    (tmp_path / "summary.json").write_text(json.dumps(summary | idle))
    honest = compared(judged, tmp_path / "summary.json")
    assert (honest.differences, honest.contradictions) == ((), ())


def test_a_run_that_a_kill_of_the_world_ended_is_compared_in_full(tmp_path: Path) -> None:
    flown = SCENARIO.replace("kill = [2]", 'kill = ["world"]').replace("at_s = 2.0", "at_s = 1.01")
    simulate(Job(parse(flown), tmp_path / "run", recording=True), StopRequest())
    verification = verify(tmp_path / "run")
    assert (verification.whole, verification.uncompared) == (False, None)
    assert (verification.differences, verification.contradictions) == ((), ())
    assert verification.exit_status == 3
    file = tmp_path / "run" / "summary.json"
    summary = json.loads(file.read_text())
    false = {"turns_over_limit_fraction": 0.5, "outcome": "pass", "duration_s": 6.0, "faults": []}
    file.write_text(json.dumps(summary | false))
    named = {each.key.partition(".")[0] for each in compared(verification, file).differences}
    assert named == set(false)


@pytest.mark.parametrize("count", [None, -1, True, "3"])
def test_a_count_that_is_none_is_named(
    run: Path, judged: Verification, tmp_path: Path, count: object
) -> None:
    summary = json.loads((run / "summary.json").read_text())
    summary["faults"][1]["frames"] = count
    summary["packets"]["rejected"] = count
    (tmp_path / "summary.json").write_text(json.dumps(summary))
    named = [each.split()[0] for each in compared(judged, tmp_path / "summary.json").contradictions]
    assert named == ["packets.rejected", "faults.1.frames"]


def test_an_idle_fault_is_one_by_the_verdict_too() -> None:
    kinds = ("jam", "clock", "slow", "kill", "intruder", "disk_full")
    blank = dict.fromkeys((*COUNTS, "process", "agents"))
    for kind, key, count in product(kinds, COUNTS, (None, 0, 3)):
        for agents in (None, [], [1]):
            row: Any = {**blank, "kind": kind, "from_s": 1.0, "agents": agents, key: count}
            assert is_idle(row) == (idle_text([row]) is not None), row


@pytest.mark.parametrize(
    "text",
    [
        *("", "{", "[" * 100_000, '{"a":' * 100_000, "nan", "\udcff", "\x00"),
        *("[]", "3"),
    ],
)
def test_a_summary_that_is_none_proves_nothing(
    judged: Verification, tmp_path: Path, text: str
) -> None:
    (tmp_path / "summary.json").write_bytes(text.encode(errors="surrogateescape"))
    assert compared(judged, tmp_path / "summary.json").exit_status == 3


@pytest.mark.parametrize("seed", range(len(BITS)))
def test_a_recording_with_flipped_bits_never_ends_its_reader(
    run: Path, tmp_path: Path, seed: int
) -> None:
    """It is inconclusive, or all that is judged is as it was: the flip hit something else."""
    draws, whole = random.Random(seed), (run / "run.rrd").read_bytes()
    damaged = bytearray(whole[: draws.choice((len(whole), len(whole) // 2))])
    for _ in range(BITS[seed]):
        damaged[draws.randrange(len(damaged))] ^= 1 << draws.randrange(8)
    (tmp_path / "run.rrd").write_bytes(damaged)
    (tmp_path / "summary.json").write_bytes((run / "summary.json").read_bytes())
    verification = verify(tmp_path)
    if verification.held:
        assert verification.figures == judged_again(run, run / "run.rrd").figures
    else:
        assert verification.exit_status == 3
    assert verification.problem is None or len(verification.problem.splitlines()) == 1


@pytest.mark.parametrize("share", [0.0, 0.001, 0.1, 0.3, 0.9, 0.999])
def test_a_cut_recording_is_inconclusive(run: Path, tmp_path: Path, share: float) -> None:
    whole = (run / "run.rrd").read_bytes()
    (tmp_path / "run.rrd").write_bytes(whole[: int(share * len(whole))])
    (tmp_path / "summary.json").write_bytes((run / "summary.json").read_bytes())
    assert verify(tmp_path).exit_status == 3


def test_a_pass_of_a_recording_that_fails_is_named(run: Path, judged: Verification) -> None:
    failed = replace(judged, outcome="fail", passes=False)
    verification = compared(failed, run / "summary.json")
    assert [each.key for each in verification.differences] == ["outcome"]
    assert verification.exit_status == 3
    assert judged.passes


def test_a_failure_that_the_recording_does_not_show_is_no_pass(
    run: Path, judged: Verification, tmp_path: Path
) -> None:
    """As of a controller that crashed."""
    summary = json.loads((run / "summary.json").read_text()) | {"outcome": "fail"}
    (tmp_path / "summary.json").write_text(json.dumps(summary))
    assert compared(judged, tmp_path / "summary.json").exit_status == 3


@pytest.fixture
def copied(run: Path, tmp_path: Path) -> Path:
    """A copy of the run to edit."""
    return Path(shutil.copytree(run, tmp_path / "copied"))


def edit(file: Path, before: str, after: str) -> None:
    text = file.read_text()
    assert before in text
    file.write_text(text.replace(before, after, 1))


def differing(folder: Path) -> list[tuple[str, Any, Any]]:
    found = verify(folder)
    assert not found.differences
    assert found.exit_status == (3 if found.file_differences else 0)
    return [(each.key, each.summary, each.recording) for each in found.file_differences]


def test_an_edited_scenario_is_named(copied: Path) -> None:
    assert differing(copied) == []
    edit(copied / "scenario.toml", "agents = 3", "agents = 4")
    assert differing(copied) == [("fleet.agents", 4, 3)]
    verification = verify(copied)
    assert verification.inconclusive == "scenario.toml differs in fleet.agents"
    told = verified(verification)
    assert "  DIFFERS  fleet.agents: 4 in scenario.toml, 3 in the recording" in told.splitlines()
    (copied / "scenario.toml").write_text("[")
    ((key, why, _),) = differing(copied)
    assert key == "all of it"
    assert why.startswith("not readable (")
    (copied / "scenario.toml").unlink()
    assert differing(copied) == []


def test_an_edited_event_is_named(copied: Path) -> None:
    events = copied / "events.jsonl"
    lines = events.read_text().splitlines(keepends=True)
    assert any('"kill"' in line for line in lines)
    events.write_text("".join(line for line in lines if '"kill"' not in line))
    assert differing(copied) == [("kill of a2 at 2 s", 0, 1)]
    events.write_text("".join([*lines, lines[0], "[1\n"]))
    twice = json.loads(lines[0])
    name = f"{twice['kind']} of a{twice['agent']} at {twice['t_s']:g} s"
    assert differing(copied) == [
        (f"line {len(lines) + 1 + 1}", "not readable", "readable"),
        (name, 2, 1),
    ]


def test_events_lost_on_a_full_disk_are_no_difference(copied: Path) -> None:
    edit(copied / "summary.json", '"reason": null', '"reason": "results were lost: disk"')
    edit(copied / "summary.json", '"outcome": "pass"', '"outcome": "inconclusive"')
    (copied / "events.jsonl").write_text("")
    found = verify(copied)
    assert (found.differences, found.file_differences) == ((), ())
