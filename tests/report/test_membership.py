"""Agents that join, leave or may join: shown as what they are, and no others counted."""

from io import BytesIO
from itertools import pairwise

import matplotlib.image
import numpy as np
import pytest

import worldsim.results
from tests.small_scenario import SMALL
from worldsim.commands.app import command
from worldsim.report import style
from worldsim.report.figures import draw_moments, moments_s
from worldsim.report.network import draw_network
from worldsim.report.shown import ABSENT, DOWN, RUNNING, STARTING, Fault, Shown
from worldsim.report.stills import Stills, facts
from worldsim.report.views import colours_of, link_lines, moment_region

CHANGING = (
    SMALL.replace("agents = 2", "agents = 2\nspare = 1").replace("5.0", "6.0")
    + """
[[event]]
at_s = 1.0
kill = [1]
for_s = 0.5
[[event]]
at_s = 3.0
join = { count = 1, start = { kind = "list", positions_m = [[-2.6, 0, 0]] } }
[[event]]
at_s = 5.0
leave = [0]
[expect]
converge = false
"""
)


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> Shown:
    """A run of two agents with a spare: one is killed, one joins, one leaves."""
    base = tmp_path_factory.mktemp("run")
    (base / "changing.toml").write_text(CHANGING)
    command(["sim", str(base / "changing.toml"), "--out", str(base / "out")])
    return Shown(worldsim.results.open(base / "out"))


def _agents_told(shown: Shown, time_s: float) -> list[str]:
    return [fact for fact in facts(shown, shown.tick_at(time_s)) if "agents running" in fact]


def test_a_still_counts_those_who_belong_to_the_fleet_by_then(shown: Shown) -> None:
    assert shown.agents == 4  # with the one who joins, and the spare
    assert _agents_told(shown, 0.5) == []
    assert _agents_told(shown, 1.2) == ["1 of 2 agents running"]
    assert _agents_told(shown, 3.5) == ["2 of 3 agents running"]
    assert _agents_told(shown, 4.5) == []
    assert _agents_told(shown, 5.5) == []  # both who are left run


def test_a_newcomer_is_absent_then_starting_then_running(shown: Shown) -> None:
    newcomer = {time_s: int(shown.states[shown.tick_at(time_s), 2]) for time_s in (2.9, 3.5, 4.5)}
    assert newcomer == {2.9: ABSENT, 3.5: STARTING, 4.5: RUNNING}
    assert (shown.states[:, 3] == ABSENT).all()
    assert shown.states[shown.tick_at(1.2), 1] == DOWN
    assert shown.states[shown.tick_at(2.0), 1] == STARTING  # it was restarted
    assert shown.states[-1, 0] == ABSENT  # it left
    booting = shown.tick_at(3.5)
    assert colours_of(shown, booting)[2] == style.STARTING
    assert colours_of(shown, shown.tick_at(1.2))[1] == style.STOPPED
    assert "1 starting" in facts(shown, booting)


def test_a_join_is_marked_on_the_bar_of_a_still(shown: Shown) -> None:
    stills = Stills(shown)
    with style.drawing():
        stills.draw(0, moment_region(shown, 0))
    _, *marks = stills.figure.axes[-1].patches
    assert [round(mark.get_x(), 3) for mark in marks] == [1.0, 3.0, 5.0]  # type: ignore[attr-defined]
    (legend,) = stills.figure.legends
    assert "process starting" in [text.get_text() for text in legend.get_texts()]


def test_the_network_figure_shows_joins_and_no_lane_of_the_absent(shown: Shown) -> None:
    with style.drawing():
        figure = draw_network(shown)
    _, roles, changes = figure.axes
    assert changes.get_title(loc="left") == "faults and joins"
    assert [text.get_text() for text in changes.texts] == ["kill", "join", "leave"]
    lanes = [np.asarray(each.get_facecolor()) for each in roles.collections]
    assert not lanes[3].any()  # the spare's lane has no colour
    told = roles.get_legend()
    assert told is not None
    assert {"starting", "not running"} <= {text.get_text() for text in told.get_texts()}
    assert "not in the world" not in {text.get_text() for text in told.get_texts()}


def test_snapshots_show_every_fault_and_join_of_a_few(shown: Shown) -> None:
    times_s = moments_s(shown)
    assert times_s == sorted(set(times_s))
    assert len(times_s) <= 9
    for change in shown.changes:
        assert any(change.from_s < time_s < change.to_s for time_s in times_s), change


def test_snapshots_of_many_faults_are_spread_over_them(
    shown: Shown, monkeypatch: pytest.MonkeyPatch
) -> None:
    many = [Fault("jam", 0.1 * k, 0.1 * k + 0.09) for k in range(1, 58)]
    monkeypatch.setattr(shown, "changes", many)
    times_s = moments_s(shown)
    assert len(times_s) == 9
    gaps = [after - before for before, after in pairwise(times_s)]
    assert max(gaps) < 0.3 * shown.until_s


def test_labels_of_snapshots_are_inside_the_figure(shown: Shown) -> None:
    with style.drawing():
        figure = draw_moments(shown)
        png = style.png_of(figure)
    darkest = matplotlib.image.imread(BytesIO(png))[..., :3].min(axis=(0, 2))
    assert darkest[-8:].min() == 1.0  # nothing is cut off at the right edge
    assert not any(axes.patch.get_visible() for axes in figure.axes)  # nor by the next column


def test_links_of_a_large_team_are_left_out_and_it_is_said(
    shown: Shown, monkeypatch: pytest.MonkeyPatch
) -> None:
    row = shown.tick_at(0.8)
    assert link_lines(shown, shown.run.ticks[row])
    assert not any("links" in fact for fact in facts(shown, row))
    monkeypatch.setattr(shown, "agents", 31)
    assert link_lines(shown, shown.run.ticks[row]) == []
    told = [fact for fact in facts(shown, row) if "links" in fact]
    assert told == ["links not drawn (more than 30 agents)"]
