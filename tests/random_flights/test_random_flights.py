"""Random scenarios of all kinds fly; ``python -m tests.random_flights`` flies as many as wanted."""

import os
import signal
import time
from collections import Counter
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from tests.random_flights import __main__ as the_command
from tests.random_flights.campaign import Campaign, report
from tests.random_flights.children import answers
from tests.random_flights.generate import Generated, draft, objection, scenario
from tests.small_scenario import SMALL
from worldsim.scenario.file import parse
from worldsim.scenario.schema import schema
from worldsim.scenario.template import OF_OWN_CONTROLLERS
from worldsim.search.drafts import without
from worldsim.search.draws import Draw

BASE = 11
SHORT = 300
"""Steps of all agents in a flight of the suite."""
DOZENS = 24


def test_short_flights_of_random_scenarios_show_no_failure(tmp_path: Path) -> None:
    rows = Campaign(partial(scenario, BASE, steps=SHORT), tmp_path, twice_every=3).fly(
        range(DOZENS)
    )
    assert [row for row in rows.values() if "failure" in row] == [], report(rows)
    assert len({row["trace"] for row in rows.values()}) == DOZENS
    assert [file.name for file in tmp_path.iterdir()] == ["results.jsonl"]


def test_a_scenario_is_a_function_of_its_base_and_number() -> None:
    assert scenario(3, 5).text == scenario(3, 5).text
    assert len({scenario(base, number).text for base in (3, 4) for number in (5, 6)}) == 4


def keys(plain: Any) -> Iterator[str]:
    inner = plain.values() if isinstance(plain, dict) else plain
    if isinstance(plain, dict):
        yield from plain
    if isinstance(plain, dict | list):
        for value in inner:
            yield from keys(value)


def test_drafts_use_every_key_of_a_scenario() -> None:
    known = {key for each in schema()["$defs"].values() for key in each.get("properties", ())}
    drafts = [draft(Draw("keys", number), SHORT) for number in range(100)]
    # A draft flies controllers of this project, which need none of these.
    spared = {"schema", *OF_OWN_CONTROLLERS}
    assert known - {key for each in drafts for key in keys(each)} == spared


def test_scenarios_are_of_all_kinds() -> None:
    scenarios = [parse(scenario(5, number).text) for number in range(30)]
    events = {event.kind for each in scenarios for event in each.event}
    assert events >= {"kill", "pause", "join", "sensor", "formation", "frame", "jam", "netem"}
    assert {each.vehicle.kind for each in scenarios} == {"kinematic", "accelerating", "forward"}
    assert {len(each.formation.vertices) for each in scenarios} >= {1, 2, 3}
    assert {type(obstacle).__name__ for each in scenarios for obstacle in each.obstacle} == {
        "Sphere",
        "Box",
        "Cylinder",
        "Wall",
    }
    assert max(each.fleet.agents for each in scenarios) > 12


def test_a_warning_of_check_is_an_objection() -> None:
    assert objection(SMALL) == ""
    assert ": netem.range_m: warning: " in objection(f"{SMALL}[netem]\nrange_m = 0.9\n")
    assert ": extra: unknown key" in objection(f"extra = 1\n{SMALL}")


@pytest.mark.parametrize(
    ("key", "left"),
    [
        ("event[1].kill[0]", {"event": [1, 3], "netem": {"a": 1, "b": {"c": 2}}}),
        ("netem.b.c", {"event": [1, 2, 3], "netem": {"a": 1, "b": {}}}),
        ("netem.a", {"event": [1, 2, 3], "netem": {"b": {"c": 2}}}),
        ("netem.b", {"event": [1, 2, 3], "netem": {"a": 1}}),
        ("fleet.agents", None),
    ],
)
def test_a_repair_leaves_out_what_is_named(key: str, left: Any) -> None:
    tables: Any = {"event": [1, 2, 3], "netem": {"a": 1, "b": {"c": 2}}}
    assert without(tables, key) == (left is not None)
    assert left is None or tables == left


def test_a_hang_a_crash_and_an_exception_are_told_apart() -> None:
    def work(number: int) -> dict[str, Any]:
        if number == 0:
            time.sleep(60.0)
        if number == 1:
            os.kill(os.getpid(), signal.SIGKILL)
        if number == 2:
            raise ValueError("no such flight")
        return {"fine": number}

    rows = dict(answers(range(4), work, jobs=4, deadline_s=1.0))
    assert [rows[number].get("failure") for number in range(4)] == [
        "hang",
        "crash",
        "exception",
        None,
    ]
    assert rows[2]["detail"] == "ValueError: no such flight"
    assert rows[3] == {"fine": 3}


FAILING = """
duration_s = 1.0
[fleet]
agents = 2
[control]
controller = "tests.random_flights.test_random_flights:Bad"
[formation]
file = "pyramidal-wedge"
"""


class Bad:
    """A controller that fails."""

    def __init__(self, setup: object) -> None:
        raise LookupError("no way")

    def decide(self, senses: object) -> None:
        raise NotImplementedError


def test_what_failed_is_kept_told_and_not_flown_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    made = Generated(FAILING, 1, Counter())
    monkeypatch.setattr(the_command, "scenario", lambda base, number, steps: made)
    monkeypatch.setattr("sys.argv", ["it", "--count", "2", "--out", str(tmp_path)])
    assert the_command.main() == 1
    assert the_command.main() == 1
    out = capsys.readouterr().out
    assert out.count("| exception | 2 | 0, 1 |") == 2
    assert "FaultyControllerError" in out
    assert (tmp_path / "1.toml").read_text() == FAILING
    assert len((tmp_path / "results.jsonl").read_text().splitlines()) == 2
