"""A timeline is checked against the fleet that each event meets; errors name the key."""

from pathlib import Path

import pytest

from worldsim.scenario.file import dump, load, parse
from worldsim.scenario.tables import Scenario
from worldsim.scenario.toml import ScenarioError

WEDGE = Path("deploy/scenarios/wedge-9.toml")
LINES = "'../formations/three-horizontal-lines.toml'"
PAIR = (
    "{ name = 'pair', vertices = { V1 = [0, 0, 0], V2 = [3, 0, 0] },"
    " queue = [{ name = 'Q', vertices = ['V1', 'V2'] }] }"
)


def timeline(*events: str) -> Scenario:
    return load(WEDGE, {"event": f"[{', '.join(f'{{ {event} }}' for event in events)}]"})


VALID = [
    ["at_s = 5, kill = [2, 'vertex:V1', 'queue:Q1', 'random:2', 'all'], for_s = 3"],
    ["at_s = 5, for_s = 2, sabotage = { kind = 'replay', agents = [1], delay_s = 1.9 }"],
    ["at_s = 5, for_s = 2, sabotage = { kind = 'spoof', agents = [1] }"],
    ["at_s = 5, join = 2", "at_s = 6, kill = [10]", "at_s = 7, restart = ['all', 10]"],
    ["at_s = 5, join = { count = 1, start = { kind = 'box', centre_m = [9, 9, 9] } }"],
    ["at_s = 5, partition = [[0, 1], [2]]", "at_s = 7, heal = true"],
    ["at_s = 5, for_s = 9, partition = { kind = 'one_way', groups = [[0, 1], [2]] }"],
    ["at_s = 5, partition = { kind = 'bridge', groups = [[0, 1], [2, 3]], bridge = [8] }"],
    ["at_s = 5, partition = { kind = 'ring', groups = [[0, 2, 1, 3]] }", "at_s = 6, heal = true"],
    ["at_s = 5, for_s = 2, jam = { centre_m = [0, 0, 0], radius_m = 2 }"],
    ["at_s = 5, for_s = 2, flap = { period_s = 0.5 }", "at_s = 6, flap = { period_s = 2 }"],
    ["at_s = 5, flap = { period_s = 2, links = [[0, 1], [1, 0]] }"],
    ["at_s = 5, for_s = 2, sabotage = { kind = 'replay', agents = [3], delay_s = 0.5 }"],
    ["at_s = 5, for_s = 9, intruder = { agents = ['vertex:V1', 2], per_s = 9 }"],
    ["at_s = 5, intruder = { per_s = 9 }", "at_s = 6, end = 'intruder-0'"],
    ["at_s = 5, every_s = 9, sabotage = { kind = 'spoof', agents = ['vertex:V1'], per_s = 9 }"],
    ["at_s = 5, netem = { gemodel = { p_percent = 1, r_percent = 9 }, rate_kbit = 64 }"],
    ["at_s = 5, for_s = 1, netem = { loss_percent = 50, multihop = { delay_ms = 9 } }"],
    [f"at_s = 5, formation = {LINES}", "at_s = 6, kill = ['vertex:V3']"],
    ["at_s = 5, frame = { yaw_deg = 90, waypoints_m = [[1, 2, 3]] }"],
    [
        "at_s = 5, for_s = 9, name = 'storm', netem = { loss_percent = 90 }",
        "at_s = 7, end = 'storm'",
    ],
    ["at_s = 6, end = 'kill-1'", "at_s = 5, kill = [0]"],
    ["at_s = 1, for_s = 2, every_s = 3, kill = ['random:1']", "at_s = 9, end = 'kill-0'"],
    [
        "at_s = 5, frame = { waypoints_m = [[0, 0, 0], [1, 0, 0]], speed_mps = 0.2, yaw = 'path' }",
        "at_s = 6, frame = { yaw_deg = 20 }",
    ],
]


@pytest.mark.parametrize("events", VALID)
def test_a_valid_timeline_is_equal_after_writing_and_reading(events: list[str]) -> None:
    scenario = timeline(*events)
    assert parse(dump(scenario)) == scenario


def test_there_is_a_row_for_each_initial_and_each_joining_agent() -> None:
    assert timeline("at_s = 5, join = 2", "at_s = 1, join = { count = 3 }").rows == 14


RADIO = [
    ("partition = [[0, 1], [1]]", "partition[1]", "agent 1 is named twice"),
    ("partition = [[0, 9]]", "partition[0]", "no agent 9; 0 to 8"),
    ("partition = [[0, 'x']]", "partition[0][1]", "got the text 'x'"),
    ("partition = { groups = [[0], [0]] }", "partition.groups[1]", "named twice"),
    ("partition = { groups = [[0]], kind = 'half' }", "partition.kind", "'clean' or 'one_way'"),
    ("partition = { kind = 'ring' }", "partition.groups", "is missing"),
    ("partition = { groups = [[0]], kind = 'bridge' }", "partition.bridge", "with kind = 'bridge'"),
    ("partition = { groups = [[0]], bridge = [1] }", "partition.bridge", "with kind = 'bridge'"),
    (
        "partition = { groups = [[0]], kind = 'bridge', bridge = [0] }",
        "partition.bridge",
        "agent 0 is named twice",
    ),
    ("heal = true", "heal", "no partition to heal"),
    ("jam = { centre_m = [0, 0, 0], radius_m = -1 }", "jam.radius_m", "from 0.001"),
    ("jam = { centre_m = [0, 0], radius_m = 1 }", "jam.centre_m", "a list of 3"),
    ("jam = { radius_m = 1 }", "jam.centre_m", "is missing"),
    ("flap = { period_s = 1e-300 }", "flap.period_s", "from 0.05 up to 86400"),
    ("netem = { rate_kbit = 1e-300 }", "netem.rate_kbit", "from 0.001 up to"),
    ("jam = { centre_m = [0, 0, 0], radius_m = 0 }", "jam.radius_m", "from 0.001"),
    ("flap = { period_s = 1, links = [[0, 9]] }", "flap.links[0]", "no agent 9; 0 to 8"),
    ("intruder = { agents = [9] }", "intruder.agents[0]", "no agent 9; 0 to 8"),
    ("kill = [0, 'random:10']", "kill[1]", "10 agents of the 9 by then"),
    ("slow = { agents = ['random:10'], delay_s = 1 }", "slow.agents[0]", "10 agents of the 9"),
    ("intruder = { agents = [1], per_s = 1e9 }", "intruder.per_s", "from 1 up to 20000"),
    ("sabotage = { kind = 'spoof', agents = [9] }", "sabotage.agents[0]", "no agent 9; 0 to 8"),
    ("sabotage = { kind = 'spoof', agents = ['vertex:V9'] }", "sabotage.agents[0]", "no vertex"),
    ("sabotage = { kind = 'spoof', agents = [] }", "sabotage.agents", "a list of 1 to 1000"),
    ("sabotage = { kind = 'spoof' }", "sabotage.agents", "is missing"),
    ("sabotage = { kind = 'bribe', agents = [1] }", "sabotage.kind", "'replay' or 'spoof'"),
    ("sabotage = { kind = 'flood', agents = [1], per_s = 9e9 }", "sabotage.per_s", "up to 2000"),
    ("sabotage = { kind = 'replay', agents = [1], delay_s = 0 }", "sabotage.delay_s", "0.001"),
    ("flap = { period_s = 1, links = [[2, 2]] }", "flap.links[0]", "a link to itself"),
    ("flap = { period_s = 1, links = [[1, 2], [1, 2]] }", "flap.links[1]", "given before"),
    ("netem = {}", "netem", "no key to set"),
    ("netem = { local = {} }", "netem", "no key to set"),
    ("netem = { gemodel = { p_percent = 1 } }", "netem.gemodel.r_percent", "is missing"),
    ("netem = { duplicate_percent = 101 }", "netem.duplicate_percent", "up to 100"),
    ("netem = { link = [{ from = 0, to = 9 }] }", "netem.link[0].to", "no agent 9"),
]


@pytest.mark.parametrize(("event", "key", "detail"), RADIO, ids=[event for event, _, _ in RADIO])
def test_an_invalid_radio_fault_is_rejected(event: str, key: str, detail: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        timeline(f"at_s = 5, {event}")
    assert str(caught.value).startswith(f"{WEDGE}: event[0].{key}: ")
    assert detail in str(caught.value)
    assert "\n" not in str(caught.value)


INVALID = [
    (["at_s = 5"], "event[0]", "no action; one of kill, leave"),
    (["at_s = 5, kill = [1], leave = [2]"], "event[0].leave", "not beside kill"),
    (["kill = [1]"], "event[0].at_s", "is missing"),
    (["at_s = -1, kill = [1]"], "event[0].at_s", "from 0"),
    (["at_s = 20, kill = [1]"], "event[0].at_s", "duration_s = 20"),
    (["at_s = 5, join = 1, for_s = 2"], "event[0].for_s", "join is not undone"),
    (["at_s = 5, kill = [9]"], "event[0].kill[0]", "no agent 9; 0 to 8"),
    (["at_s = 6, join = 1", "at_s = 5, kill = [0, 9]"], "event[1].kill[1]", "no agent 9"),
    (["at_s = 5, leave = ['vertex:V2']"], "event[0].leave[0]", "no vertex 'V2'"),
    (["at_s = 5, leave = ['queue:Q9']"], "event[0].leave[0]", "there are Q1, Q2, Q3, Q4"),
    (["at_s = 5, restart = [1.5]"], "event[0].restart[0]", "allowed: an id, 'random:2' or 'all'"),
    (
        ["at_s = 5, for_s = 2, sabotage = { kind = 'replay', agents = [1] }"],
        "event[0].sabotage.delay_s",
        "2; below for_s = 2",
    ),
    (
        ["at_s = 15, sabotage = { kind = 'replay', agents = [1], delay_s = 5 }"],
        "event[0].sabotage.delay_s",
        "the run ends 5 s later",
    ),
    (["at_s = 5, kill = ['nettem']"], "event[0].kill[0]", "; or 'netem' or 'world', alone"),
    (["at_s = 5, kill = ['random:0']"], "event[0].kill[0]", "'random:2' or 'all'"),
    (["at_s = 5, kill = ['vertex:']"], "event[0].kill[0]", "an id, 'vertex:V1'"),
    (["at_s = 5, restart = ['vertex:V1']"], "event[0].restart[0]", "an id, 'random:2'"),
    (["at_s = 5, kill = [2.5]"], "event[0].kill[0]", "an id"),
    (["at_s = 5, kill = []"], "event[0].kill", "1 to 1000"),
    (["at_s = 5, heal = true"], "event[0].heal", "no partition"),
    (["at_s = 5, heal = false"], "event[0].heal", "true"),
    (["at_s = 5, end = 'jam-1'"], "event[0].end", "no fault 'jam-1'; there are none"),
    (["at_s = 5, kill = [0]", "at_s = 6, end = 'x'"], "event[1].end", "there are kill-0"),
    (["at_s = 5, kill = [0]", "at_s = 5, end = 'kill-0'"], "event[1].end", "begins at 5 s"),
    (
        ["at_s = 5, kill = [0], for_s = 1", "at_s = 6, end = 'kill-0'"],
        "event[1].end",
        "over at 6 s",
    ),
    (
        ["at_s = 5, kill = [0]", "at_s = 6, end = 'kill-0'", "at_s = 7, end = 'kill-0'"],
        "event[2].end",
        "ended by the event at 6 s already",
    ),
    (["at_s = 5, join = 1", "at_s = 6, end = 'join-0'"], "event[1].end", "no fault 'join-0'"),
    (["at_s = 5, join = 1, every_s = 2"], "event[0].every_s", "join is not undone"),
    (["at_s = 5, kill = [0], for_s = 2, every_s = 2"], "event[0].every_s", "than for_s = 2"),
    (["at_s = 5, kill = [0], every_s = 0.001"], "event[0].every_s", "at most 1000 times"),
    (["at_s = 5, join = 1, name = 'more'"], "event[0].name", "join is not undone; name goes with"),
    (
        ["at_s = 5, kill = [0]", "at_s = 6, name = 'kill-0', kill = [1]"],
        "event[1].name",
        "'kill-0' is the name of event[0] too",
    ),
    (
        ["at_s = 5, partition = [[1]], for_s = 2", "at_s = 8, heal = true"],
        "event[1].heal",
        "no partition",
    ),
    (["at_s = 5, partition = [[0, 1], [1]]"], "event[0].partition[1]", "1 is named twice"),
    (["at_s = 5, partition = [[9]]"], "event[0].partition[0]", "no agent 9; 0 to 8"),
    (["at_s = 5, netem = { loss_percent = 101 }"], "event[0].netem.loss_percent", "to 100"),
    (["at_s = 5, netem = { los_percent = 1 }"], "event[0].netem.los_percent", "did you mean"),
    (
        ["at_s = 5, netem = { link = [{ from = 0, to = 9 }] }"],
        "event[0].netem.link[0].to",
        "no agent 9",
    ),
    (["at_s = 5, formation = 'nope.toml'"], "event[0].formation", "no such file"),
    (
        ["at_s = 5, formation = { name = 'x', vertices = {}, queue = [] }"],
        "event[0].formation.vertices",
        "",
    ),
    ([f"at_s = 5, formation = {PAIR}"], "event[0].formation.queue", "full"),
    (
        ["at_s = 5, leave = [0, 1, 2, 'random:4']", f"at_s = 6, formation = {LINES}"],
        "event[1].formation",
        "2 agents by then, for 3 vertices",
    ),
    (["at_s = 5, frame = {}"], "event[0].frame", "yaw_deg"),
    (
        ["at_s = 5, frame = { waypoints_m = [[0, 0, 0], [1, 0, 0]] }"],
        "event[0].frame.speed_mps",
        "is missing",
    ),
    (["at_s = 5, frame = { speed_mps = 0.2 }"], "event[0].frame.speed_mps", "a new path"),
    (
        ["at_s = 5, frame = { waypoints_m = [[0, 0, 0]], speed_mps = 0.2 }"],
        "event[0].frame.speed_mps",
        "two waypoints or more",
    ),
    (
        ["at_s = 5, frame = { waypoints_m = [[0, 0, 0], [1, 0, 0]], speed_mps = 1, start_s = 4 }"],
        "event[0].frame.start_s",
        "or later",
    ),
    (
        ["at_s = 5, frame = { waypoints_m = [[0, 0, 0], [0, 0, 0]], speed_mps = 0.2 }"],
        "event[0].frame.waypoints_m[1]",
        "the same point as before",
    ),
    (["at_s = 5, join = 0"], "event[0].join", "from 1"),
    (["at_s = 5, join = { coun = 2 }"], "event[0].join.coun", "did you mean 'count'"),
    (
        ["at_s = 5, join = { count = 2, start = { kind = 'list', positions_m = [[0, 0, 0]] } }"],
        "event[0].join.start.positions_m",
        "1 for 2",
    ),
    (
        ["at_s = 5, join = { count = 2, start = { kind = 'box', spacing_m = 0.1 } }"],
        "event[0].join.start.spacing_m",
        "at least",
    ),
    (["at_s = 5, join = 992"], "event", "at most 1000"),
]


@pytest.mark.parametrize(("events", "key", "detail"), INVALID)
def test_an_error_names_the_key_of_an_invalid_event(
    events: list[str], key: str, detail: str
) -> None:
    with pytest.raises(ScenarioError) as caught:
        timeline(*events)
    assert str(caught.value).startswith(f"{WEDGE}: {key}")
    assert detail in str(caught.value)


@pytest.mark.parametrize("fault", ["leave = [1.5]", "leave = ['x']", "clock = { agents = [1.5] }"])
def test_netem_is_suggested_only_where_it_can_be_struck(fault: str) -> None:
    with pytest.raises(ScenarioError, match=r"'all'") as caught:
        load(WEDGE, {"event": f"[{{ at_s = 5, {fault} }}]"})
    assert "'netem'" not in str(caught.value)


def test_a_join_beyond_the_size_of_the_formation_is_rejected() -> None:
    text = f"formation = {PAIR.replace('[3, 0, 0]', '[2, 0, 0]')}\n[fleet]\nagents = 3\n"
    assert parse(text + "[[event]]\nat_s = 1\nkill = [0]\n").rows == 3
    with pytest.raises(ScenarioError) as caught:
        parse(text + "[[event]]\nat_s = 1\njoin = 1\n")
    assert "event[0].join: 'pair' has no room for them" in str(caught.value)


def test_a_join_needs_positions_where_the_start_is_a_list() -> None:
    text = f"formation = {PAIR}\n[fleet]\nagents = 2\n[fleet.start]\nkind = 'list'\n"
    with pytest.raises(ScenarioError) as caught:
        parse(text + "positions_m = [[0, 0, 0], [1, 0, 0]]\n[[event]]\nat_s = 1\njoin = 1\n")
    assert "event[0].join.start: is missing" in str(caught.value)


def test_an_error_in_a_formation_file_names_that_file(tmp_path: Path) -> None:
    formation = tmp_path / "f.toml"
    formation.write_text("name = 'f'\nvertices = { V1 = [0, 'a', 0] }\nqueue = []\n")
    with pytest.raises(ScenarioError) as caught:
        timeline(f"at_s = 5, formation = '{formation}'")
    assert str(caught.value).startswith(f"{formation}: vertices.V1[1]: ")
