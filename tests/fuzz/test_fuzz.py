"""`qswarm fuzz` finds a planted bug, makes it small, and `qswarm cause` tells from when on."""

import json
import tomllib
from collections.abc import Iterable, Iterator
from itertools import islice
from pathlib import Path
from typing import Any

import msgspec
import pytest

from netem.wire.shutdown import StopRequest, stop_requests
from tests.planted_bugs import filter_sign, searched
from tests.small_scenario import SMALL
from worldsim.campaign.flight_site import FlightSite, Flown, LocalSite, Order, SiteError
from worldsim.commands.app import command
from worldsim.fuzz import flights
from worldsim.fuzz.cause import Cause, find_cause
from worldsim.fuzz.findings import begin, refly, trouble_of
from worldsim.fuzz.flights import Hangar
from worldsim.fuzz.folder import SearchFolder, read_finding
from worldsim.fuzz.fuzz import Search, fuzz
from worldsim.fuzz.pages import curve
from worldsim.fuzz.probe import Rest
from worldsim.results.exit_status import BAD_INPUT, FAIL, INCONCLUSIVE, PASS
from worldsim.results.provenance import provenance
from worldsim.results.run_folder import RunDirectoryError
from worldsim.search.drafts import cautions, loaded
from worldsim.search.trials import Terms

SEEDS = range(2, 3)
CORPUS, MENDED = (Path(__file__).parent / name for name in ("corpus", "mended"))
"""What is known to fail, and what failed once."""
HUNTERS = """
name = "hunters"
[fleet]
agents = 3
tick_hz = 10.0
start = { kind = "list", positions_m = [[0, 0, 0], [2, 0, 0], [9, 0, 0]] }
[formation]
file = "pyramidal-wedge"
[comms]
local_hz = 10.0
[control]
controller = "tests.random_flights.controllers:Chase"
[expect]
converge = false
"""


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Search among hunters, with a sign wrong in the filter that keeps them apart."""
    folder = tmp_path_factory.mktemp("fuzz") / "search"
    scenario = loaded(HUNTERS, Path("hunters.toml"))
    terms = Terms(base=msgspec.to_builtins(scenario), allowed=cautions(scenario))
    assert searched(filter_sign, terms, SEEDS, folder, guided=False, budget=25) == FAIL
    return folder


@pytest.mark.pure
def test_a_planted_bug_is_found_and_made_small(found: Path) -> None:
    rows = SearchFolder(found).rows()
    assert [rows[seed]["violated"][0] for seed in SEEDS] == ["separation"]
    folder = found / "findings" / "separation-2"
    finding = read_finding(folder)
    assert finding["shrunk"]
    assert finding["size"]["agents"] == 2
    assert finding["size"]["faults"] == 0
    assert finding["size"]["duration_s"] < 0.25 * finding["original_size"]["duration_s"]
    assert finding["trouble_s"] <= finding["size"]["duration_s"]
    assert "event" not in tomllib.loads((folder / "scenario.toml").read_text())
    page = (folder / "finding.md").read_text()
    assert "Two vehicles came nearer" in page
    assert "First tick of trouble" in page
    assert "| separation | safety | 1 | 1 |" in (found / "table.md").read_text()


@pytest.mark.pure
def test_a_finding_is_known_where_it_fails_and_fixed_where_it_does_not(
    found: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    corpus = tmp_path / "corpus"
    corpus.mkdir()
    (found / "findings" / "separation-2").rename(corpus / "separation-2")
    with stop_requests() as stop:
        assert refly(corpus, hangar(tmp_path, stop), lambda _: None) == {"separation-2": "fixed"}
        cause = find_cause(corpus / "separation-2", hangar(tmp_path, stop), 4, lambda _: None)
        assert cause == Cause(replays=False)
        filter_sign(monkeypatch)
        assert refly(corpus, hangar(tmp_path, stop), lambda _: None) == {"separation-2": "known"}
        cause = find_cause(corpus / "separation-2", hangar(tmp_path, stop), 4, lambda _: None)
    assert cause is not None
    assert cause.certain_s == 0.0
    assert cause.needed is None
    assert "Certain from the start" in (corpus / "separation-2" / "finding.md").read_text()
    (corpus / "separation-2").rename(found / "findings" / "separation-2")


def hangar(folder: Path, stop: StopRequest) -> Hangar:
    return Hangar(LocalSite(1, folder / "work"), stop)


class _Leaving(LocalSite):
    """A cluster that goes away after two flights."""

    def fly(self, orders: Iterable[Order], stop: StopRequest) -> Iterator[Flown]:
        yield from islice(super().fly(orders, stop), 2)
        raise SiteError("tcp://10.0.0.5:8786: the scheduler is gone")


def test_a_search_goes_on_elsewhere_where_its_cluster_went_away(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    terms = Terms(base=msgspec.to_builtins(loaded(SMALL, Path("small.toml"))), safety_only=True)

    def search(site: FlightSite) -> Search:
        return Search(
            terms=terms,
            seeds=range(1, 4),
            folder=tmp_path / "it",
            site=site,
            guided=False,
            shrinks=0,
            corpus=None,
            described={},
            beside=Path("small.toml"),
            quiet=True,
        )

    assert fuzz(search(_Leaving(1, tmp_path / "one"))) == INCONCLUSIVE
    assert "2 of 3 seeds done; the same command goes on" in (told := capsys.readouterr().out)
    assert "the scheduler is gone" in told
    assert fuzz(search(LocalSite(1, tmp_path / "two"))) == PASS
    assert sorted(SearchFolder(tmp_path / "it").rows()) == [1, 2, 3]


def test_a_search_that_another_version_began_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its margins would mislead the guide, and its rows would stand for this version."""

    def opened(search: Search) -> int:
        with SearchFolder(search.folder).opened(search.described):
            return PASS

    monkeypatch.setattr("worldsim.fuzz.fuzz.fuzz", opened)
    again = ["fuzz", "--random", "--out", str(tmp_path / "it")]
    assert [command(again), command(again)] == [PASS, PASS]
    now = {**provenance(), "commit": "0" * 40}
    monkeypatch.setattr("worldsim.results.provenance.provenance", lambda: now)
    assert command(again) == BAD_INPUT
    told = capsys.readouterr().err
    assert "holds another search: the commit of qswarm is" in told
    assert "choose another --out" in told


def test_the_folder_of_another_search_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, terms = SearchFolder(tmp_path / "it"), {"base": "wedge-9", "guided": False}
    with folder.opened(terms):
        folder.add({"seed": 3, "violated": []})
        with (
            pytest.raises(RunDirectoryError, match="another search is at work in it"),
            SearchFolder(tmp_path / "it").opened(terms),
        ):
            pass
    with folder.opened(terms):
        assert folder.rows() == {3: {"seed": 3, "violated": []}}
    assert command(["fuzz", "--out", str(tmp_path / "it"), "--random"]) == BAD_INPUT
    assert "holds another search: base is wedge-9 there" in capsys.readouterr().err
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "notes.txt").touch()
    assert command(["fuzz", "--out", str(tmp_path / "full"), "--random"]) == BAD_INPUT
    assert "no folder of a search" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--seeds", "5"], "--seeds: '5'"),
        (["--controller", "no.such:Thing"], "control.controller"),
        (["--base", "no-such"], "no such file"),
        (["--set", "seed=3"], "--set: needs --base"),
        (["--corpus", "no-such-folder"], "--corpus: no-such-folder"),
    ],
)
def test_bad_input_is_refused_before_anything_is_made(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], said: str
) -> None:
    out = tmp_path / "out"
    assert command(["fuzz", "--out", str(out), "--random", *arguments]) == BAD_INPUT
    assert said in capsys.readouterr().err
    assert not out.exists()


def test_a_folder_without_a_finding_has_no_cause(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert command(["cause", str(tmp_path)]) == BAD_INPUT
    assert "is not a finding of `qswarm fuzz`" in capsys.readouterr().err


def test_a_line_that_was_cut_off_is_flown_again(tmp_path: Path) -> None:
    folder = SearchFolder(tmp_path)
    (tmp_path / "seeds.jsonl").write_text(json.dumps({"seed": 1}) + '\n{"seed": 2, "vio')
    assert list(folder.rows()) == [1]
    folder.add({"seed": 3})
    assert list(folder.rows()) == [1, 3]


def test_a_curve_shows_its_least_values() -> None:
    assert curve([0.0, 0.5, 1.0]) == "▁▅█"
    assert curve([None, 1.0]) == " ▁"


def test_a_finding_is_explained_before_it_is_made_small(tmp_path: Path) -> None:
    measured = {"first_s": {"I3": 4.5}, "t_s": [0.0, 0.1], "slot_error_m": [2.0, 1.0]}
    events = ({"t_s": 2.0, "kind": "kill", "agent": 1}, {"t_s": 9.0, "kind": "heal"})
    flown = flights.Flown("3", {"I3": -1.0}, "I3 is violated", "ab", measured, events)
    row = {"seed": 3, "how": "random", "violated": ["I3"], "reason": "", "duration_s": 60.0}
    assert not begin(tmp_path, SMALL, row, flown)["shrunk"]
    page = (tmp_path / "finding.md").read_text()
    assert "First tick of trouble: 4.5 s.\nLast event before it: 2 s: kill (agent 1)." in page
    assert "slot_error_m" in page
    begin(tmp_path, SMALL, {**row, "violated": ["error"]}, flown._replace(measured=None))
    assert "First tick of trouble: not known." in (tmp_path / "finding.md").read_text()


def test_a_flight_tells_since_when_all_vehicles_stand_still() -> None:
    rest = Rest()
    for tick in range(10):
        x = min(0.2 * tick, 1.0)  # it flies for five ticks
        rest.see([(x, 0.0, 0.0), None], 0.1 * tick)
    assert rest.since_s == pytest.approx(0.5)
    rest.see([(1.0, 0.0, 0.04), None], 1.0)
    assert rest.since_s == pytest.approx(0.5)
    rest.see([(1.0, 0.0, 0.04), (0.0, 0.0, 0.0)], 1.1)
    assert rest.since_s == pytest.approx(1.1), "one that joins"


def test_a_page_tells_from_when_on_a_team_that_never_forms_stands_still(tmp_path: Path) -> None:
    measured: Any = {"t_s": [0.0, 1.0], "slot_error_m": [3.0, 2.0], "rest_since_s": 9.0}
    flown = flights.Flown("it", {"converge": -0.5}, "it did not converge", "", measured)
    row = {"seed": 1, "how": "random", "violated": ["converge"], "reason": "", "duration_s": 5.0}
    begin(tmp_path, SMALL, row, flown)
    assert "stand still" not in (tmp_path / "finding.md").read_text()
    begin(tmp_path, SMALL.replace("duration_s = 5.0", "duration_s = 20.0"), row, flown)
    assert "All vehicles stand still from 9 s on." in (tmp_path / "finding.md").read_text()


def test_the_trouble_of_a_time_that_runs_out_is_where_progress_ends() -> None:
    times = [0.0, 1.0, 2.0, 3.0]
    stands = {"t_s": times, "slot_error_m": [9.0, None, 7.0, 7.0]}
    assert trouble_of(stands, "converge", 60.0) == 0.0
    assert trouble_of({**stands, "slot_error_m": [9.0, 8.0, 7.0, 7.0]}, "converge", 60.0) == 1.0
    assert trouble_of({**stands, "slot_error_m": [0.1, 0.0, 7.0, 3.0]}, "converge", 60.0) == 1.0
    assert trouble_of({**stands, "first_s": {"I4": 2.5}}, "I4", 60.0) == 2.5


@pytest.mark.parametrize(("folder", "state"), [(CORPUS, "known"), (MENDED, "fixed")])
def test_findings_of_the_corpus_still_fail_and_mended_ones_do_not(
    folder: Path, state: str, tmp_path: Path
) -> None:
    with stop_requests() as stop:
        states = refly(folder, hangar(tmp_path, stop), lambda _: None)
    assert states == dict.fromkeys(states, state)
    assert len(states) == len(list(folder.glob("*/scenario.toml")))
