"""Trials are fair: faults end, a team is left, and the time to settle is as long as announced."""

from pathlib import Path

import msgspec

from worldsim.scenario.file import parse
from worldsim.scenario.tables import Scenario
from worldsim.search.drafts import objection
from worldsim.search.draws import GeneDraw
from worldsim.search.trials import LEAST_S, Terms, leaves_a_team, trial

SEEDS = range(12)
ALL = Terms()


def drawn(seed: int, terms: Terms = ALL) -> Scenario:
    return parse(trial(f"t-{seed}", ("t", seed), terms, objection, {}).text)


def test_every_fault_ends_before_the_team_is_left_alone() -> None:
    for seed in SEEDS:
        scenario = drawn(seed)
        alone_s = scenario.expect.converge_within_s
        assert alone_s is not None
        quiet_s = scenario.duration_s - alone_s - 3.0
        assert scenario.duration_s >= LEAST_S
        for event in scenario.event:
            once = event.kind in ("kill", "leave", "join", "heal", "restart", "resume", "frame")
            ends_s = event.at_s + (event.for_s or 0.0)
            assert ends_s <= quiet_s + 1e-9, (seed, event)
            assert event.for_s or once or event.kind in ("formation", "end"), (seed, event)


def test_a_base_keeps_its_team_and_gets_faults() -> None:
    base = parse(Path("deploy/scenarios/wedge-9.toml").read_text(), Path("deploy/scenarios/x.toml"))
    terms = Terms(base=msgspec.to_builtins(base))
    varied = [drawn(seed, terms) for seed in range(6)]
    assert {each.fleet.agents for each in varied} == {9}
    assert {each.formation.name for each in varied} == {"pyramidal-wedge"}
    assert len({each.seed for each in varied}) == 6
    assert any(each.event for each in varied)


def test_a_base_keeps_its_vehicles_and_loses_the_faults_that_they_do_not_bear() -> None:
    """Who knows others by radio alone stands still once one is silent: nobody dies for good."""
    text = Path("deploy/scenarios/wedge-9.toml").read_text() + "\n[vehicle]\nsensors = []\n"
    base = parse(text, Path("deploy/scenarios/x.toml"))
    varied = [drawn(seed, Terms(base=msgspec.to_builtins(base))) for seed in range(8)]
    assert {each.vehicle.sensors for each in varied} == {()}
    kinds = {event.kind for each in varied for event in each.event}
    assert kinds
    assert not kinds & {"kill", "leave"}


def test_safety_only_expects_no_formation() -> None:
    scenario = drawn(3, Terms(controller="flocking", safety_only=True))
    assert scenario.control.controller == "flocking"
    assert not scenario.expect.converge
    assert scenario.expect.reform_within_s is None


def test_nobody_left_is_no_team() -> None:
    tables = {"fleet": {"agents": 4}, "event": [{"at_s": 1.0, "kill": [0, "random:1"]}]}
    assert leaves_a_team(tables)
    tables["event"].append({"at_s": 2.0, "leave": ["vertex:V1"]})
    assert not leaves_a_team(tables)
    all_restart = {"at_s": 1.0, "kill": ["all"], "for_s": 2.0}
    assert not leaves_a_team({**tables, "event": [all_restart]})
    assert leaves_a_team({**tables, "event": [{**all_restart, "kill": [0, 1, "netem"]}]})


def test_one_gene_changes_and_the_others_stay() -> None:
    one = GeneDraw("a").part("event", 0)
    before = [one.number(0.0, 9.0), one.among("xyz"), one.whole(0, 99)]
    changed = {**one.used, "event/0/1": 0.5}
    other = GeneDraw("b", given=changed).part("event", 0)
    assert [other.number(0.0, 9.0), other.among("xyz"), other.whole(0, 99)] == [4.5, *before[1:]]
