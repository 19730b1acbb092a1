"""Lines of JSON for controllers in other languages: what is written, and what is taken."""

import json

import msgspec
import pytest

from agent.controller import Intent, Link, Outgoing, Received, Senses
from agent.lines import LineError, SensesLines, hover, intent_of, line_schema, setup_line
from agent.messages import Place
from agent.qstructure.formation import Formation
from agent.qstructure.target_frame import Frame
from agent.senses import Flown, Heard
from tests.small_scenario import SMALL
from worldsim.scenario.file import parse

SCENARIO = parse(SMALL, overrides={"control.parameters.gain": "2.5"})
FORMATION = Formation(SCENARIO.formation, SCENARIO.control.spacing_m)
HERE = (0.1, 0.2, 0.3)


def senses(**given: object) -> Senses:
    known = {
        "now_s": 1.5,
        "position": HERE,
        "velocity": (0.0, 0.0, 0.0),
        "yaw": 0.25,
        "vehicles": ((1.0, 0.0, 0.0),),
        "neighbours": (Heard(3, 0.1, (1.0, 2.0, 3.0), HERE, HERE, Place(0, 1)),),
        "team": tuple,
        "mission": Flown(7, FORMATION, Frame((5.0, 0.0, 0.0), 0.5)),
    }
    return Senses(**{**known, **given})  # type: ignore[arg-type]


def test_the_first_line_holds_the_setup_with_parameters() -> None:
    setup = SCENARIO.agent_setup(1, 0, 1)
    told = json.loads(setup_line(setup))
    assert told["protocol"] == 1
    assert told["setup"]["id"] == 1
    assert told["setup"]["control"]["parameters"] == {"gain": 2.5}


def test_a_line_of_senses_is_exact() -> None:
    told = json.loads(SensesLines(2).line(senses()))
    assert (told["now_s"], told["position"], told["yaw"]) == (1.5, list(HERE), 0.25)
    assert told["neighbours"][0]["place"] == [0, 1]
    assert told["mission"]["origin"] == [5.0, 0.0, 0.0]
    assert told["reach_m"] is None, "JSON has no infinity"
    heard = senses(link=Link(0.1, 0.02, 4.5))
    assert json.loads(SensesLines(2).line(heard))["reach_m"] == 4.5
    assert json.loads(SensesLines(2).line(senses(mission=None)))["mission"] is None


def test_slots_are_told_once_for_each_mission() -> None:
    lines = SensesLines(2)
    first, second = (json.loads(lines.line(senses()))["mission"]["slots"] for _ in range(2))
    assert [slot["place"] for slot in first] == [
        list(place) for place in FORMATION.layout(2).places
    ]
    assert second is None
    newer = senses(mission=Flown(8, FORMATION, Frame()))
    assert json.loads(lines.line(newer))["mission"]["slots"] == first


def test_only_the_velocity_must_be_given() -> None:
    said, log = intent_of(b'{"velocity":[3,0,4]}', senses())
    assert log == []
    assert said == Intent(
        wanted=(3.0, 0.0, 4.0),
        velocity=(3.0, 0.0, 4.0),
        yaw=0.25,
        force=5.0,
        heading_for=(3.1, 0.2, 4.3),
    )
    more, _ = intent_of(
        b'{"velocity":[0,0,0],"wanted":[1,0,0],"yaw":1,"force":0.5,"heading_for":[1,2,3],'
        b'"target":[4,5,6],"place":[1,2],"cost_m":7,"tilt":[0.1,0.2]}',
        senses(),
    )
    assert (more.wanted, more.force, more.place, more.tilt) == (
        *((1.0, 0.0, 0.0), 0.5),
        *(Place(1, 2), (0.1, 0.2)),
    )


def test_words_signals_and_log_go_both_ways() -> None:
    inbox = (
        Received(4, "local", 0.1, "grüße".encode()),
        Received(5, "multihop", 0.2, b"\xff\x00"),
    )
    heard = json.loads(SensesLines(2).line(senses(inbox=inbox)))["inbox"]
    assert heard == [
        {"source": 4, "channel": "local", "age_s": 0.1, "text": "grüße", "data": None},
        {"source": 5, "channel": "multihop", "age_s": 0.2, "text": None, "data": "/wA="},
    ]
    said, log = intent_of(
        b'{"velocity":[0,0,0],"messages":[{"channel":"local","text":"hi"},'
        b'{"channel":"multihop","data":"/wA="}],"signals":{"gap":1.5},"log":["one","two"]}',
        senses(),
    )
    assert said.messages == (Outgoing("local", b"hi"), Outgoing("multihop", b"\xff\x00"))
    assert said.signals == {"gap": 1.5}
    assert log == ["one", "two"]


@pytest.mark.parametrize(
    ("line", "said"),
    [
        (b"", "an empty line"),
        (b"hello", "the line: 'hello'"),
        (b'{"velocity":[0,0,0],"messages":[{"channel":"local"}]}', "either a text or data"),
        (b'{"velocity":[0,0,0],"messages":[{"channel":"loud","text":""}]}', "loud"),
        (b"{}", "missing required field `velocity`"),
        (b'{"velocity":[1,2]}', "length 3"),
        (b'{"velocity":[1,2,"3"]}', "`float`, got `str`"),
        (b'{"velocity":[1,2,NaN]}', "malformed"),
        (b'{"velocity":[1,2,3],"speed":1}', "unknown field `speed`"),
        (b'{"velocity":[1,2,3],"force":-1}', ">= 0"),
        (b"\xff\xfe", "malformed"),
    ],
)
def test_a_line_that_is_no_intent_is_refused_with_its_beginning(line: bytes, said: str) -> None:
    with pytest.raises(LineError) as refused:
        intent_of(line, senses())
    assert said in str(refused.value)
    assert len(str(refused.value).splitlines()) == 1


def test_hovering_wants_to_stay() -> None:
    assert hover(senses()).velocity == (0.0, 0.0, 0.0)
    assert hover(senses()).heading_for == HERE


def test_the_schema_has_all_three_lines() -> None:
    schema = line_schema()
    assert {"SetupLine", "SensesLine", "IntentLine"} <= set(schema["$defs"])
    assert schema["$defs"]["IntentLine"]["required"] == ["velocity"]
    msgspec.json.encode(schema)
