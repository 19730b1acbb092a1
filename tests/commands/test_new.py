"""new: a scenario to start from, that flies as it stands and with every key of it taken in."""

import re
from pathlib import Path

import pytest
from msgspec import inspect

from tests.commands.conftest import Command
from worldsim.engine.virtual import fly
from worldsim.judge.verdict import Judge
from worldsim.results.summary import summarise
from worldsim.scenario.file import dump, load, parse
from worldsim.scenario.tables import Scenario
from worldsim.scenario.template import template


def outcome(scenario: Scenario) -> str:
    flight = fly(scenario)
    summary = summarise(
        scenario,
        flight.loop,
        mode="virtual",
        medium_counters=flight.medium_counters,
        late_tick_fraction=0.0,
        real_time_factor=1.0,
        duration_s=flight.loop.world.time_s,
        interrupted=False,
        host_too_slow=False,
    )
    assert isinstance(flight.loop.judge, Judge)
    return str(summary["outcome"])


def all_taken_in(text: str) -> str:
    return re.sub(r"^#(?=\S)", "", text, flags=re.MULTILINE)


def test_it_is_written_checked_and_flown(small: Path, qswarm: Command) -> None:
    told = qswarm("new", "mine")
    assert (told.status, told.err) == (0, "")
    assert told.out == "mine.toml: written; to fly it: qswarm sim mine.toml\n"
    checked = qswarm("check", "mine.toml")
    assert (checked.status, checked.err) == (0, "")
    assert load(Path("mine.toml")).name == "mine"
    assert outcome(load(Path("mine.toml"))) == "pass"


def test_with_every_key_taken_in_it_flies_too() -> None:
    assert outcome(parse(all_taken_in(template("whole")))) == "pass"


def test_what_stands_behind_a_hash_is_the_default() -> None:
    plain, whole = parse(template("same")), parse(all_taken_in(template("same")))
    assert plain.vehicle.max_speed_mps == whole.vehicle.max_speed_mps
    assert plain.comms == whole.comms
    assert plain.sensor == whole.sensor
    assert plain.fleet == whole.fleet


@pytest.mark.parametrize("table", ["", "fleet", "vehicle", "sensor", "control", "comms", "expect"])
def test_every_key_of_a_table_is_told(table: str) -> None:
    info = inspect.type_info(Scenario)
    assert isinstance(info, inspect.StructType)
    if table:
        (info,) = (field.type for field in info.fields if field.encode_name == table)  # type: ignore[assignment]
    text = template("told")
    for field in info.fields:
        name = re.escape(field.encode_name)
        assert re.search(rf"^#?(\[+({table}\.)?{name}\]+|{name} = )", text, re.MULTILINE), name


@pytest.mark.parametrize("name", ["", ".", "../x", "a b", "x" * 81, "a\nb"])
def test_a_name_that_a_scenario_cannot_have_is_refused(
    small: Path, qswarm: Command, name: str
) -> None:
    told = qswarm("new", name)
    assert (told.status, told.out, told.err.count("\n")) == (2, "", 1)
    assert "a name of letters" in told.err
    assert list(small.parent.iterdir()) == [small]


def test_nothing_is_overwritten(small: Path, qswarm: Command) -> None:
    before = small.read_text()
    told = qswarm("new", "small")
    assert (told.status, told.err) == (2, "small.toml: exists; nothing is overwritten\n")
    assert small.read_text() == before


def test_what_is_resolved_reads_back(small: Path) -> None:
    assert parse(dump(parse(template("again")))) == parse(template("again"))
