"""The JSON Schema of a scenario file accepts what check accepts, and rejects invalid values."""

import json
import tomllib
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator, ValidationError

from worldsim.commands.app import command
from worldsim.scenario.file import dump, parse
from worldsim.scenario.library import SCENARIOS
from worldsim.scenario.schema import schema
from worldsim.scenario.template import template

VALIDATOR = Draft202012Validator(schema())


def test_it_is_a_schema_and_check_prints_it(capsys: pytest.CaptureFixture[str]) -> None:
    Draft202012Validator.check_schema(schema())
    assert command(["check", "--schema"]) == 0
    assert json.loads(capsys.readouterr().out) == json.loads(json.dumps(schema()))


@pytest.mark.parametrize("file", sorted(SCENARIOS.rglob("*.toml")), ids=lambda file: file.stem)
def test_it_accepts_the_library(file: Path) -> None:
    VALIDATOR.validate(tomllib.loads(file.read_text()))


def test_it_accepts_an_inline_formation_and_a_resolved_scenario() -> None:
    VALIDATOR.validate(tomllib.loads(template("placed")))
    VALIDATOR.validate(tomllib.loads(dump(parse(template("placed")))))


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("name", "a b"),
        ("seed", -1),
        ("duration_s", "long"),
        ("bogus", 1),
        ("formation", {"file": "a.toml", "name": "b"}),
        ("formation", {"file": 3}),
        ("fleet", {}),
        ("fleet", {"agents": 2, "start": {"kind": "heap"}}),
        ("netem", {"los_percent": 50}),
    ],
)
def test_it_rejects_invalid_values(key: str, value: Any) -> None:
    with pytest.raises(ValidationError):
        VALIDATOR.validate({**tomllib.loads(template("bad")), key: value})


MAY_BE_ANY_SHARE = {"capacity", "density_per_m3"}


def open_bounds(value: Any, name: str = "") -> list[str]:
    """Return the keys whose numbers come as near to 0 as a file can write."""
    if isinstance(value, list):
        return [key for each in value for key in open_bounds(each, name)]
    if not isinstance(value, dict):
        return []
    own = [name] if "exclusiveMinimum" in value else []
    return own + [key for inner, each in value.items() for key in open_bounds(each, inner)]


def test_a_number_above_0_has_a_least_value() -> None:
    found = open_bounds(schema())
    assert {key for key in found if key != "anyOf"} <= MAY_BE_ANY_SHARE
    assert len(found) == len(MAY_BE_ANY_SHARE)
