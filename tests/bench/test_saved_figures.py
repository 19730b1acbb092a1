"""The file of figures: what is saved can be compared, and a bad file is one line with its key."""

import json
from pathlib import Path
from typing import Any

import pytest

from worldsim.bench.circumstances import circumstances, code_form, cpu_model, modules
from worldsim.bench.measures import Row
from worldsim.bench.saved_figures import content, of, saved
from worldsim.scenario.toml import ScenarioError

ROWS = [
    Row("a", "us", 2.0, 1.5, False),
    Row("b", "x", None, None, True, "not converged within 20 s"),
]


@pytest.fixture
def figures() -> dict[str, Any]:
    return json.loads(json.dumps(content(ROWS, circumstances(), 3, None)))


def error_of(tmp_path: Path, text: str) -> str:
    file = tmp_path / "f.json"
    file.write_text(text)
    with pytest.raises(ScenarioError) as raised:
        saved(file)
    assert "\n" not in str(raised.value)
    return str(raised.value).removeprefix(f"{file}: ")


def test_what_is_saved_is_read_again(tmp_path: Path, figures: dict[str, Any]) -> None:
    file = tmp_path / "f.json"
    file.write_text(json.dumps(figures))
    found = saved(file)
    assert found == of(content(ROWS, circumstances(), 3, None))
    assert [(row.name, row.measured) for row in found.rows] == [("a", 1.5), ("b", None)]
    assert figures["rows"][1]["invalid"] == "not converged within 20 s"
    assert figures["rows"][0]["reached"] is True


def test_a_key_that_is_not_known_is_ignored(tmp_path: Path, figures: dict[str, Any]) -> None:
    file = tmp_path / "f.json"
    file.write_text(json.dumps({**figures, "weather": "fine"}))
    assert saved(file).repeats == 3


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "not JSON: "),
        ("{", "not JSON: "),
        ("[" * 100_000, "not JSON: "),
        ("[]", "not a file of qswarm bench --save"),
        ("{}", "format: is missing; 'qswarm-bench' of qswarm bench --save is needed"),
        ('{"format": "other"}', "format: got 'other'; 'qswarm-bench' of "),
    ],
)
def test_a_foreign_file_is_named(tmp_path: Path, text: str, says: str) -> None:
    assert error_of(tmp_path, text).startswith(says)


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=r"none\.json: no such file"):
        saved(tmp_path / "none.json")


@pytest.mark.parametrize(
    ("key", "value", "says"),
    [
        ("schema", 2, "schema: got 2; allowed: 1"),
        ("rows", {}, "rows: got a table; allowed: a list"),
        ("rows", [{"name": "a", "unit": "us"}], "rows[0].measured: is missing; allowed: "),
        (
            "rows",
            [{"name": "a", "unit": "us", "measured": "1", "more": False}],
            "rows[0].measured: got the text '1'; allowed: ",
        ),
        (
            "rows",
            [{"name": "a", "unit": "us", "measured": float("nan"), "more": False}],
            "rows[0].measured: got nan; must be a finite number",
        ),
        ("host", {"os": "Linux"}, "host.machine: is missing; allowed: "),
        ("packages", {"numpy": 2}, "packages.numpy: got 2; allowed: "),
        ("python", None, "python: got None; allowed: "),
        ("seconds", "long", "seconds: got the text 'long'; allowed: "),
    ],
)
def test_a_bad_value_is_named_with_its_key(
    tmp_path: Path, figures: dict[str, Any], key: str, value: Any, says: str
) -> None:
    assert error_of(tmp_path, json.dumps({**figures, key: value})).startswith(says)


@pytest.mark.parametrize(
    "key", ["schema", "code", "commit", "commit_dirty", "python", "packages", "host", "rows"]
)
def test_a_missing_key_is_named(tmp_path: Path, figures: dict[str, Any], key: str) -> None:
    del figures[key]
    assert error_of(tmp_path, json.dumps(figures)).startswith(f"{key}: is missing; allowed: ")


def test_the_form_of_the_code_is_that_of_its_modules() -> None:
    files = {"agent.core": "/x/agent/core.py", "agent.codec": "/x/agent/codec.py"}
    assert code_form(files) == "pure Python"
    files["agent.core"] = "/x/agent/core.cpython-311-x86_64-linux-gnu.so"
    assert code_form(files | {"agent.core": f"/x/agent/core{suffix()}"}) == (
        "compiled (1 of 2 modules)"
    )
    found = modules()
    assert {"agent.core", "netem.medium", "worldsim.engine.step"} <= found.keys()
    assert all(Path(file).exists() for file in found.values())


def suffix() -> str:
    from importlib.machinery import EXTENSION_SUFFIXES  # noqa: PLC0415

    return EXTENSION_SUFFIXES[0]


def test_the_processor_is_named_where_the_kernel_tells(tmp_path: Path) -> None:
    file = tmp_path / "cpuinfo"
    file.write_text("processor\t: 0\nmodel name\t: Some CPU @ 2 GHz\nflags\t\t: fpu\n")
    assert cpu_model(file) == "Some CPU @ 2 GHz"
    file.write_text("processor\t: 0\n")
    assert cpu_model(file) is None
    assert cpu_model(tmp_path / "none") is None
