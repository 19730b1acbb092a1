"""The layout's tabs and their panels: plain words on what is flown, drawn and found."""

from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest
from rerun.chunk import Chunk, RrdReader

from netem.link_parameters import Conditions
from tests.recording.flights import straight_flight, wedge
from worldsim.judge.radio_events import Jammed
from worldsim.judge.run_events import Paused, Resumed
from worldsim.judge.verdict import Judge
from worldsim.recording import layout, panels
from worldsim.recording.blueprint import ASKED_FOR, LAYERS, SHOWN, blueprint_of
from worldsim.recording.panels import QUESTIONS, SYMBOLS
from worldsim.recording.recorder import RunRecorder
from worldsim.scenario.target_frame import FrameTable

AGENTS = 4
RADIO = Conditions(range_m=6.0, delay_ms=20.0, jitter_ms=5.0, loss_percent=20.0)
SCENARIO = msgspec.structs.replace(wedge(AGENTS, duration_s=3.0), netem=RADIO)


def flown(path: Path, found: tuple[str, ...]) -> list[Chunk]:
    recorder, judge = RunRecorder(path, SCENARIO, "panels", mode="virtual"), Judge(SCENARIO)
    recorder.event(Paused(t_s=1.0, agent=2, planned=True))
    recorder.event(Jammed(t_s=1.5, agent=None, planned=True, number=1, jam=None))
    recorder.event(Resumed(t_s=2.0, agent=2, planned=True))
    for tick in straight_flight(SCENARIO):
        placed = tick.place if tick.time_s >= 0.5 else np.full_like(tick.place, -1)
        seen = replace(tick, place=placed)
        recorder.tick(seen, judge.see(seen))
    recorder.close(found)
    return list(RrdReader(path).stream())


@pytest.fixture(scope="module")
def chunks(tmp_path_factory: pytest.TempPathFactory) -> list[Chunk]:
    return flown(tmp_path_factory.mktemp("panels") / "run.rrd", ("met: it flew",))


def column(chunks: list[Chunk], entity: str, component: str) -> list[list[str]]:
    batches = [each.to_record_batch() for each in chunks if each.entity_path == entity]
    having = [each.column(component) for each in batches if component in each.schema.names]
    return [row for each in having for row in each.to_pylist()]


@pytest.mark.parametrize("question", list(QUESTIONS))
def test_each_tab_has_a_panel_of_plain_words(chunks: list[Chunk], question: str) -> None:
    (text,) = column(chunks, layout.panel_entity(question), "TextDocument:text")[-1]
    assert QUESTIONS[question] in text
    assert SYMBOLS[question] in text
    assert "Scenario straight: 4 agents fly 3 s under q_structure" in text
    assert "20 +- 5 ms of delay, 20 % of frames lost" in text
    assert "blue Q0, orange Q1, green Q2, magenta Q3" in text


def test_the_words_tell_a_moving_frame_and_a_clean_radio() -> None:
    path = FrameTable(waypoints_m=((0.0, 0.0, 0.0), (9.0, 0.0, 0.0)), speed_mps=0.25)
    assert "moves" not in panels.flown(SCENARIO)
    assert "in a frame that moves" in panels.flown(msgspec.structs.replace(SCENARIO, frame=path))
    clean = msgspec.structs.replace(SCENARIO, netem=Conditions())
    assert panels.radio(clean) == "Radio: no limit of range, no losses."


def test_the_verdict_is_there_once_the_run_has_ended(tmp_path: Path, chunks: list[Chunk]) -> None:
    assert column(chunks, layout.VERDICT, "TextDocument:text")[-1] == ["- met: it flew"]
    broken = flown(tmp_path / "run.rrd", ())
    (text,) = column(broken, layout.VERDICT, "TextDocument:text")[-1]
    assert "has not" in text


def test_phases_and_conditions_are_timelines(chunks: list[Chunk]) -> None:
    assert column(chunks, layout.TEAM_PHASE, "StateChange:state")[:2] == [
        ["no formation"],
        ["forming wedge"],
    ]
    assert column(chunks, "/conditions/a2", "StateChange:state") == [["paused"], ["running"]]
    assert not column(chunks, "/conditions/a1", "StateChange:state"), "nothing was wrong with it"


def test_the_network_has_its_figures(chunks: list[Chunk]) -> None:
    lambda2 = column(chunks, layout.LAMBDA2, "Scalars:scalars")
    assert len(lambda2) == 3 * 4 + 1
    assert lambda2[0] == [pytest.approx(AGENTS)], "each hears each"
    assert column(chunks, layout.LINK_COUNTS, "Scalars:scalars")[0] == [6.0, 0.0, 0.0, 0.0]


def test_every_layer_is_shown_by_some_tab_or_hidden_on_purpose() -> None:
    shown = {layer for layers in SHOWN.values() for layer in layers}
    assert shown <= set(LAYERS)
    assert set(LAYERS) - shown == set(ASKED_FOR)
    assert blueprint_of(SCENARIO) is not None
