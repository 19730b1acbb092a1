"""new: the template runs as it is, and with every commented key set."""

import re
from pathlib import Path

import pytest
from msgspec import inspect

from tests.commands.conftest import Command
from worldsim.campaign.pool import finished
from worldsim.engine.virtual import fly
from worldsim.results.summary import summarise
from worldsim.scenario.file import dump, load, parse
from worldsim.scenario.tables import Scenario
from worldsim.scenario.template import OF_OWN_CONTROLLERS, template


def outcome(scenario: Scenario) -> str:
    return summarise(scenario, finished(fly(scenario), scenario))["outcome"]


def with_every_key(text: str) -> str:
    return re.sub(r"^#(?=\S)", "", text, flags=re.MULTILINE)


def test_the_new_file_passes_check_and_its_run_passes(small: Path, qswarm: Command) -> None:
    printed = qswarm("new", "mine")
    assert (printed.status, printed.err) == (0, "")
    assert printed.out == "mine.toml: written; run it with: qswarm sim mine.toml\n"
    checked = qswarm("check", "mine.toml")
    assert (checked.status, checked.err) == (0, "")
    assert load(Path("mine.toml")).name == "mine"
    assert outcome(load(Path("mine.toml"))) == "pass"


def test_with_every_key_set_it_passes_too() -> None:
    assert outcome(parse(with_every_key(template("whole")))) == "pass"


def test_a_commented_key_shows_the_default() -> None:
    plain, whole = parse(template("same")), parse(with_every_key(template("same")))
    assert plain.vehicle.max_speed_mps == whole.vehicle.max_speed_mps
    assert plain.comms == whole.comms
    assert plain.sensor == whole.sensor
    assert plain.fleet == whole.fleet


@pytest.mark.parametrize("table", ["", "fleet", "vehicle", "sensor", "control", "comms", "expect"])
def test_every_key_of_a_table_is_shown(table: str) -> None:
    info = inspect.type_info(Scenario)
    assert isinstance(info, inspect.StructType)
    if table:
        (info,) = (field.type for field in info.fields if field.encode_name == table)  # type: ignore[assignment]
    text = template("printed")
    for field in info.fields:
        if field.encode_name in OF_OWN_CONTROLLERS:
            continue
        name = re.escape(field.encode_name)
        assert re.search(rf"^#?(\[+({table}\.)?{name}\]+|{name} = )", text, re.MULTILINE), name


@pytest.mark.parametrize("name", ["", ".", "../x", "a b", "x" * 81, "a\nb"])
def test_an_invalid_name_is_rejected(small: Path, qswarm: Command, name: str) -> None:
    printed = qswarm("new", name)
    assert (printed.status, printed.out, printed.err.count("\n")) == (2, "", 1)
    assert "a name of letters" in printed.err
    assert list(small.parent.iterdir()) == [small]


def test_a_name_may_end_in_toml(small: Path, qswarm: Command) -> None:
    assert qswarm("new", "mine.toml").status == 0
    assert parse((small.parent / "mine.toml").read_text()).name == "mine"
    assert not small.with_name("mine.toml.toml").exists()


def test_nothing_is_overwritten(small: Path, qswarm: Command) -> None:
    before = small.read_text()
    printed = qswarm("new", "small")
    assert (printed.status, printed.err) == (2, "small.toml: exists; nothing is overwritten\n")
    assert small.read_text() == before


def test_the_resolved_template_parses_to_the_same_scenario(small: Path) -> None:
    assert parse(dump(parse(template("again")))) == parse(template("again"))
