"""Bad input: the error names the file and the key, in one line, before anything is built."""

from pathlib import Path

import pytest

from tests.small_scenario import SMALL
from worldsim.scenario.file import load, parse
from worldsim.scenario.toml import ScenarioError

WEDGE = Path("deploy/scenarios/wedge-9.toml")
QUEUE = "{ name = 'Q', vertices = ['V1'], shape = { kind = 'ray', direction = [0, 0, 1] } }"

OVERRIDDEN = [
    ("netem.range_m", "-6", "netem.range_m", "from 0.001"),
    ("netem.range_m", "0", "netem.range_m", "from 0.001"),
    ("netem.range_m", "nan", "netem.range_m", "finite"),
    ("netem.range_m", "inf", "netem.range_m", "got inf; must be a finite number"),
    ("netem.delay_ms", "-1", "netem.delay_ms", "from 0"),
    ("netem.loss_percent", "abc", "netem.loss_percent", "got the text 'abc'; allowed: a number"),
    ("netem.loss_percent", "101", "netem.loss_percent", "up to 100"),
    ("netem.rang_m", "3", "netem.rang_m", "did you mean 'range_m'? allowed: range_m, delay_ms"),
    ("netem.loss", "3", "netem.loss", "unknown key; did you mean 'loss_percent'? allowed: "),
    ("netem.zzz", "3", "netem.zzz", "unknown key; allowed: range_m, "),
    ("netem.link", "[{ from = 0 }]", "netem.link[0].to", "is missing"),
    ("netem.link", "[{ from = 0, to = -1 }]", "netem.link[0].to", "from 0"),
    ("netem.link", "[{ from = 0, to = 9 }]", "netem.link[0].to", "no agent 9; 0 to 8"),
    ("netem.link", "[{ from = 1, to = 1 }]", "netem.link[0].to", "to itself"),
    ("netem.link", "[{from=0,to=1}, {from=0,to=1}]", "netem.link[1]", "given before"),
    ("nettem.range_m", "3", "nettem", "did you mean 'netem'?"),
    ("fleet.agents", "0", "fleet.agents", "a whole number from 1 up to 1000"),
    ("fleet.agents", "1.5", "fleet.agents", "a whole number"),
    ("fleet.agents", "true", "fleet.agents", "got true"),
    ("fleet.briefed", "[0, 9]", "fleet.briefed[1]", "no agent 9 at the start; 0 to 8"),
    ("fleet.briefed", "[-1]", "fleet.briefed[0]", "got -1; allowed: a whole number from 0"),
    ("fleet.briefed", "['all']", "fleet.briefed[0]", "got the text 'all'; allowed: a whole"),
    ("fleet.briefed", "none", "fleet.briefed", "got the text 'none'; allowed: 'all', or a list"),
    ("fleet.briefed", "0", "fleet.briefed", "got 0; allowed: 'all', or a list of ids"),
    ("fleet.agents.x", "1", "fleet.agents", "is not a table"),
    ("fleet", "3", "fleet", "a table of agents, tick_hz, start"),
    ("fleet.tick_hz", "0", "fleet.tick_hz", "from 0.001"),
    ("fleet.start", "{ size_m = [1, 1, 1] }", "fleet.start.kind", "'box' or 'list'"),
    ("fleet.start.kind", "ring", "fleet.start.kind", "'ring'; allowed: 'box' or 'list'"),
    (
        "obstacle",
        "[{ shape = 'ball' }]",
        "obstacle[0].shape",
        "'ball'; allowed: 'sphere' or 'box' or 'cylinder' or 'wall'",
    ),
    ("fleet.start.size_m", "[1, 2]", "fleet.start.size_m", "a list of 3"),
    ("fleet.start.size_m", "[1, 2, -3]", "fleet.start.size_m[2]", "from 0"),
    ("fleet.start.size_m", "[1, 2, nan]", "fleet.start.size_m[2]", "finite"),
    ("fleet.start.spacing_m", "0.2", "fleet.start.spacing_m", "at least"),
    ("control.spacing_m", "0.45", "control.spacing_m", "at least 0.5"),
    ("control.cast_far_m", "0.06", "control.cast_far_m", "at least 2 cast_near_m = 0.1"),
    ("control.controller", "3", "control.controller", "text"),
    ("control.gather", "yes", "control.gather", "true or false"),
    ("comms.local_hz", "40", "comms.local_hz", "at most fleet.tick_hz = 20"),
    ("vehicle.kind", "boat", "vehicle.kind", "'kinematic'"),
    ("vehicle.sensors", "['nose']", "vehicle.sensors[0]", "'proximity'"),
    ("schema", "2", "schema", "allowed: 1"),
    ("name", "../x", "name", "letters"),
    ("seed", "-1", "seed", "from 0"),
    ("seed", str(2**60), "seed", "below"),
    ("duration_s", "0", "duration_s", "from 0.001"),
    ("duration_s", "0.001", "duration_s", "at least one tick"),
    ("formation.file", "nope.toml", "formation.file", "no such file"),
    (
        "formation.file",
        "helx",
        "formation.file",
        "no such formation in the library; closest: helix",
    ),
    ("formation.file", "a\0b", "formation.file", "no such file"),
    ("formation.file", "a" * 300, "formation.file", "no such file"),
    ("formation", "3", "formation", "got 3; allowed: a table of file, or of name, vertices, queue"),
    ("formation.file", "7", "formation.file", "must be text: a formation file"),
    ("formation.name", "x", "formation.name", "cannot be combined with file"),
    ("formation", "{}", "formation.name", "is missing"),
    ("a..b", "1", "a..b", "table.key"),
]


@pytest.mark.parametrize(("key", "value", "named", "says"), OVERRIDDEN)
def test_an_error_names_its_key(key: str, value: str, named: str, says: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        load(WEDGE, {key: value})
    assert str(caught.value).startswith(f"{WEDGE}: {named}: ")
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


FORMATIONS = [
    ("vertices = { V1 = [0, 0] }", QUEUE, "vertices.V1", "a list of 3"),
    ("vertices = { V1 = [0, 0, 0], V2 = [0, 'a', 0] }", QUEUE, "vertices.V2[1]", "a number"),
    ("vertices = { V1 = [0, 0, 0], V2 = [1, 0, 0] }", QUEUE, "vertices.V2", "no queue"),
    ("vertices = { V1 = [0, nan, 0] }", QUEUE, "vertices.V1[1]", "finite"),
    ("vertices = { '' = [0, 0, 0] }", QUEUE, "vertices", "1 to 64"),
    ("vertices = { W = [0, 0, 0] }", QUEUE, "queue[0].vertices", "no vertex 'V1'; there are W"),
    ("vertices = { V1 = [0, 0, 0] }", QUEUE + "," + QUEUE, "queue[1].name", "used twice"),
    (
        "vertices = { V1 = [0, 0, 0] }",
        QUEUE.replace("[0, 0, 1]", "[0, 0, 0]"),
        "queue 'Q', shape.direction",
        "zero length",
    ),
    (
        "vertices = { V1 = [0, 0, 0] }",
        QUEUE.replace("shape", "capacity = 0.9, shape"),
        "queue.capacity",
        "the sum must be 1",
    ),
    (
        "vertices = { V1 = [0, 0, 0] }",
        QUEUE.replace("'ray'", "'spiral'"),
        "queue[0].shape.kind",
        "'ray'",
    ),
]


@pytest.mark.parametrize(("vertices", "queues", "key", "says"), FORMATIONS)
def test_an_error_in_a_formation_file_names_that_file(
    tmp_path: Path, vertices: str, queues: str, key: str, says: str
) -> None:
    formation = tmp_path / "f.toml"
    formation.write_text(f"name = 'f'\n{vertices}\nqueue = [{queues}]\n")
    with pytest.raises(ScenarioError) as caught:
        load(WEDGE, {"formation.file": str(formation)})
    assert str(caught.value).startswith(f"{formation}: {key}: ")
    assert says in str(caught.value)


@pytest.mark.parametrize(("vertices", "queues", "key", "says"), FORMATIONS)
def test_an_error_in_an_inline_formation_names_its_key(
    vertices: str, queues: str, key: str, says: str
) -> None:
    text = f"fleet = {{ agents = 2 }}\n[formation]\nname = 'f'\n{vertices}\nqueue = [{queues}]\n"
    with pytest.raises(ScenarioError) as caught:
        parse(text, "mine.toml")
    assert str(caught.value).startswith(f"mine.toml: formation.{key}: ")
    assert says in str(caught.value)


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"a = 1\nb = = 3\n", "not TOML: Invalid value (at line 2, column 5)"),
        (b"[fleet", "not TOML"),
        (b"a = 1\na = 2", "not TOML"),
        (b"name = 'r\xff'", "byte 9 is not UTF-8"),
        (b"#" * (1024 * 1024 + 1), "too large; at most 1048576 bytes"),
        (b"a = " + b"[" * 50_000, "nested too deeply"),
        (b"a = " + b"9" * 5_000, "not TOML"),
        (b"", "fleet: is missing"),
        (b'"a\\nb" = 1\n', "a\\nb: unknown key"),
    ],
)
def test_a_file_that_is_not_a_scenario(tmp_path: Path, content: bytes, says: str) -> None:
    file = tmp_path / "broken.toml"
    file.write_bytes(content)
    with pytest.raises(ScenarioError) as caught:
        load(file)
    assert str(caught.value).startswith(f"{file}: ")
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_missing_file_or_a_folder(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=r"none\.toml: no such file"):
        load(tmp_path / "none.toml")
    with pytest.raises(ScenarioError, match="cannot be read: Is a directory"):
        load(tmp_path)


def test_an_error_in_an_override_mentions_the_command_line() -> None:
    with pytest.raises(ScenarioError, match="it was set on the command line"):
        load(WEDGE, {"fleet.agents": "0"})
    with pytest.raises(ScenarioError) as caught:
        parse("[fleet]\nagents = 0\n[formation]\n", "mine.toml", {"seed": "2"})
    assert "command line" not in str(caught.value)


def test_slots_too_close_together_are_rejected() -> None:
    second = QUEUE.replace("'Q'", "'R'").replace("'V1'", "'V2'")
    near = f"{{ name = 'f', vertices = {{ V1 = [0, 0, 0], V2 = [0.4, 0, 0] }}, queue = [{QUEUE},"
    with pytest.raises(ScenarioError, match=r"formation\.queue 'Q' and 'R': .* at least 0\.5 m"):
        load(WEDGE, {"formation": f"{near} {second}] }}"})


def test_fewer_agents_than_vertices() -> None:
    lines = "../formations/three-vertical-lines.toml"
    with pytest.raises(ScenarioError, match=r"fleet\.agents: 2 for 3 vertices; at least 3"):
        load(WEDGE, {"formation.file": lines, "fleet.agents": "2"})
    assert load(WEDGE, {"formation.file": lines, "fleet.agents": "3"}).fleet.agents == 3


LINKS = [
    ("loss_percent", "100.5", "up to 100"),
    ("corrupt_percent", "-1", "from 0"),
    ("reorder_percent", "101", "up to 100"),
    ("delay_correlation_percent", "100", "below 100"),
    ("distribution", "'gamma'", "'normal'"),
    ("gemodel", "{ p_percent = 5 }", "r_percent: is missing"),
    ("gemodel", "{ p_percent = 5, r_percent = 120 }", "r_percent: got 120"),
    ("path_loss", "{ exponent = 3, budget_db = 70 }", "reference_loss_db: is missing"),
    ("path_loss.shadowing_db", "0", "from 0.001"),
    ("rate_kbit", "0", "from 0.001 up to"),
    ("rate_kbit", "1e-300", "from 0.001 up to"),
    ("limit", "0", "from 1"),
    ("limit", "1.5", "a whole number"),
]


@pytest.mark.parametrize(("key", "value", "says"), LINKS)
@pytest.mark.parametrize("table", ["netem", "netem.local", "netem.multihop"])
def test_an_invalid_link_is_rejected(table: str, key: str, value: str, says: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        load(WEDGE, {f"{table}.{key}": value})
    assert f": {table}.{key.partition('.')[0]}" in str(caught.value)
    assert says in str(caught.value)


def test_a_correlation_needs_no_jitter() -> None:
    assert load(WEDGE, {"netem.delay_correlation_percent": "25"}).netem.jitter_ms is None


LISTS = [
    ("{ kind = 'list', positions_m = [[0, 0, 0]] }", "positions_m", "one for each"),
    ("{ kind = 'list', positions_m = [[0, 0, 0], [0, 0.2, 0]] }", "positions_m[1]", "agent 0"),
    (
        "{ kind = 'list', positions_m = [[0, 0, 0], [1, 0, 0]], yaws_deg = [0] }",
        "yaws_deg",
        "one for each",
    ),
    ("{ kind = 'list', positions_m = [[0, 0, 0], [nan, 0, 0]] }", "positions_m[1][0]", "finite"),
]


@pytest.mark.parametrize(("start", "key", "says"), LISTS)
def test_a_list_of_starts(start: str, key: str, says: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        load(WEDGE, {"fleet.agents": "2", "fleet.start": start})
    assert f": fleet.start.{key}: " in str(caught.value)
    assert says in str(caught.value)


def test_jitter_may_exceed_the_delay() -> None:
    assert load(WEDGE, {"netem.jitter_ms": "40"}).netem.jitter_ms == 40.0


def test_a_byte_order_mark_is_read(tmp_path: Path) -> None:
    file = tmp_path / "marked.toml"
    file.write_bytes(b"\xef\xbb\xbf" + SMALL.encode())
    assert load(file) == parse(SMALL)


DATES = ["2024-01-01", "10:30:00", "2024-01-01T10:30:00"]


@pytest.mark.parametrize("value", DATES)
@pytest.mark.parametrize("key", ["name", "formation.name", "control.controller"])
def test_a_date_for_a_text_is_named(key: str, value: str) -> None:
    with pytest.raises(ScenarioError, match="got the date or time ") as error:
        parse(SMALL, overrides={key: value})
    assert error.value.key == key


TOO_SMALL = ["5e-324", "1e-310", "1e-9", "0.0009"]


@pytest.mark.parametrize("value", TOO_SMALL)
@pytest.mark.parametrize(
    "key",
    [
        "fleet.tick_hz",
        "comms.local_hz",
        "comms.multihop_hz",
        "vehicle.max_speed_mps",
        "vehicle.max_turn_deg",
        "vehicle.max_yaw_rate_dps",
        "control.spacing_m",
        "control.cast_near_m",
        "frame.turn_dps",
        "sensor.laser.rate_hz",
        "netem.range_m",
    ],
)
def test_a_number_too_small_to_fly_with_is_refused_by_its_key(key: str, value: str) -> None:
    with pytest.raises(ScenarioError) as error:
        parse(SMALL, overrides={key: value})
    assert error.value.key == key


def test_a_ring_needs_an_elevation_that_is_more_than_nothing() -> None:
    laser = {"sensor.laser.rings": "9", "sensor.laser.elevation_deg": "1e-310"}
    with pytest.raises(ScenarioError, match=r"sensor\.laser\.rings: 9 rings need elevation_deg"):
        parse(SMALL, overrides=laser)
