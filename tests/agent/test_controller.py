"""Controllers: how they are found by name, how intents are checked, and how they fail."""

import dataclasses
from math import hypot, inf, nan
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from agent.checked_controller import CheckedController
from agent.comms.mission import Missions
from agent.config import AgentSetup
from agent.controller import (
    NO_SIGNALS,
    ControllerError,
    FaultyControllerError,
    Heard,
    Intent,
    Outgoing,
    Senses,
    Words,
    load,
)
from agent.controller_log import Logging
from agent.guidance.flocking import Flocking
from agent.guidance.q_structure import QStructure
from agent.messages import Branch, Message, Place, RootKey, Standing
from agent.plain_intent import plain
from netem.compiled import UnloadableError
from worldsim.scenario.file import load as load_scenario

SCENARIO = Path(__file__).parents[2] / "deploy" / "scenarios" / "flocking-9.toml"
REST = (0.0, 0.0, 0.0)
HERE = (1.0, 2.0, 3.0)
HOVER = Intent(wanted=REST, velocity=REST, yaw=0.5, force=0.0, heading_for=HERE)
MISSION = Missions(3, load_scenario(SCENARIO).formation, spacing=1.0).flown
SENSES = Senses(
    now_s=2.5,
    position=HERE,
    velocity=REST,
    yaw=0.5,
    vehicles=(),
    neighbours=(),
    team=tuple,
    mission=MISSION,
)


class StubController:
    """Returns, or raises, the result that a test sets."""

    result: Any = HOVER

    def __init__(self, setup: AgentSetup) -> None:
        if isinstance(self.result, OSError):
            raise self.result

    def decide(self, senses: Senses) -> Intent:
        if isinstance(self.result, BaseException):
            raise self.result
        return self.result  # type: ignore[no-any-return]


class NoController:
    """Has no method 'decide'."""


def setup_of(controller: str) -> AgentSetup:
    return load_scenario(SCENARIO, {"control.controller": controller}).agent_setup(3, 0, 1)


@pytest.fixture
def controller_with(monkeypatch: pytest.MonkeyPatch) -> Any:
    def make(result: Any) -> CheckedController:
        monkeypatch.setattr(StubController, "result", result)
        return CheckedController(setup_of(f"{__name__}:StubController"))

    return make


@pytest.mark.parametrize(
    ("name", "found"),
    [
        ("q_structure", QStructure),
        ("flocking", Flocking),
        ("agent.guidance.flocking:Flocking", Flocking),
    ],
)
def test_a_name_finds_its_class(name: str, found: type) -> None:
    assert load(name) is found


def test_an_installed_package_adds_controllers_but_cannot_replace_built_in_ones(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    info = tmp_path / "others-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: others\nVersion: 1.0\n")
    entries = "\n".join(
        f"{name} = agent.guidance.flocking:Flocking" for name in ("boids", "q_structure")
    )
    (info / "entry_points.txt").write_text(f"[qswarm.controllers]\n{entries}\n")
    monkeypatch.syspath_prepend(str(tmp_path))

    assert load("boids") is Flocking
    assert load("q_structure") is QStructure
    with pytest.raises(ControllerError, match="boids"):
        load("bird")


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("bird", "q_structure, flocking"),
        ("no.such.module:Class", "No module named 'no'"),
        ("agent.guidance.flocking:Bird", "'Bird'"),
        (f"{__name__}:NoController", "no method 'decide'"),
        (":Flocking", "neither a known controller"),
        ("agent.guidance.flocking:", "neither a known controller"),
    ],
)
def test_the_error_of_a_controller_that_cannot_be_loaded_says_why(name: str, why: str) -> None:
    with pytest.raises(ControllerError) as refused:
        load(name)
    assert repr(name) in str(refused.value)
    assert why in str(refused.value)


def test_a_plain_intent_is_returned_unchanged() -> None:
    assert plain(HOVER) is HOVER


def test_numpy_numbers_become_plain_floats() -> None:
    zero, here = np.zeros(3, dtype=np.float32), np.array(HERE)
    taken = plain(
        Intent(
            wanted=zero,
            velocity=zero,
            yaw=np.float64(0.5),
            force=np.float32(0.0),
            heading_for=here,
            target=here,
        )
    )
    assert taken == replace(HOVER, target=HERE)
    assert {type(number) for number in (*taken.wanted, *taken.heading_for, taken.yaw)} == {float}


def test_positions_far_from_the_origin_are_allowed() -> None:
    far = replace(HOVER, heading_for=(-9e5, 9e5, 100.5), target=(9e5, 0.0, 0.0), force=1e6)
    assert plain(far) == far


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("wanted", (0.0, 0.0, nan)),
        ("velocity", (0.0, inf, 0.0)),
        ("velocity", (0.0, 0.0, 101.0)),
        ("velocity", (0.0, 0.0)),
        ("wanted", np.zeros(4)),
        ("heading_for", (0.0, 2e6, 0.0)),
        ("target", (nan, 0.0, 0.0)),
        ("yaw", 100.5),
        ("force", -0.1),
        ("force", 2e9),
        ("tilt", (0.0, 0.0, 0.0)),
    ],
)
def test_a_number_outside_a_commands_bounds_is_rejected_by_name(field: str, value: Any) -> None:
    with pytest.raises(ValueError, match=f"Intent's {field} "):
        plain(replace(HOVER, **{field: value}))


@pytest.mark.parametrize(
    ("result", "text"),
    [
        (ZeroDivisionError("division by zero"), "ZeroDivisionError: division by zero"),
        (None, "TypeError: decide returned NoneType, not an Intent"),
        (replace(HOVER, yaw=nan), "ValueError: the Intent's yaw holds nan; at most 100 is allowed"),
        (replace(HOVER, wanted=("a", "b", "c")), "TypeError: "),
    ],
)
def test_a_failure_in_flight_names_controller_agent_and_time(
    result: Any, text: str, controller_with: Any
) -> None:
    controller = controller_with(result)
    with pytest.raises(FaultyControllerError) as failed:
        controller.decide(SENSES)
    begin = f"controller '{__name__}:StubController' of agent 3 failed at 2.5 s: "
    assert str(failed.value).startswith(begin + text)


def test_a_failure_at_the_start_names_controller_and_agent(controller_with: Any) -> None:
    with pytest.raises(FaultyControllerError) as failed:
        controller_with(OSError("no battery"))
    begin = f"controller '{__name__}:StubController' of agent 3 failed in its constructor: "
    assert str(failed.value) == begin + "OSError: no battery"


def test_compiled_code_that_cannot_be_loaded_is_not_the_controllers_fault(
    controller_with: Any,
) -> None:
    with pytest.raises(UnloadableError):
        controller_with(UnloadableError()).decide(SENSES)


def heard(x: float, velocity: tuple[float, float, float] = REST) -> Heard:
    at = (x, 0.0, 0.0)
    return Heard(id=1, age_s=0.0, position=at, velocity=velocity, target=at, place=None)


def flock(*neighbours: Heard) -> Intent:
    senses = dataclasses.replace(SENSES, position=REST, yaw=0.0, neighbours=neighbours)
    return Flocking(setup_of("flocking")).decide(senses)


def test_an_agent_alone_hovers() -> None:
    assert flock().wanted == REST


@pytest.mark.parametrize(("x", "way"), [(0.9, -1), (1.0, 0), (1.1, 1)])
def test_a_flock_keeps_about_spacing_m_apart(x: float, way: int) -> None:
    assert np.sign(flock(heard(x)).wanted[0]) == way


def test_a_flock_aligns_its_velocities() -> None:
    assert flock(heard(1.0, (0.0, 0.2, 0.1))).wanted == pytest.approx((0.0, 0.1, 0.05))


def test_a_flock_keeps_the_limits_of_its_vehicles() -> None:
    assert hypot(*flock(heard(0.01)).wanted) == pytest.approx(0.5)


@pytest.mark.parametrize("exits", [SystemExit(0), SystemExit(3), GeneratorExit("over")])
def test_a_controller_that_exits_has_failed(controller_with: Any, exits: BaseException) -> None:
    with pytest.raises(FaultyControllerError, match=type(exits).__name__):
        controller_with(exits).decide(SENSES)


class LyingFloat(float):
    """Says that it is 0 and smaller than everything; it is what float's own methods say."""

    def __abs__(self) -> float:
        return 0.0

    def __lt__(self, other: object) -> bool:
        return True

    __le__ = __ge__ = __gt__ = __lt__

    def __bool__(self) -> bool:
        return False


class LyingInt(int):
    """Says that it is within any bounds."""

    def __lt__(self, other: object) -> bool:
        return True

    __le__ = __ge__ = __gt__ = __lt__


class LyingTuple(tuple[Any, ...]):
    """Shows others than it holds, from the second look on; says that it is empty."""

    looks = 0

    def __iter__(self) -> Any:
        self.looks += 1
        return super().__iter__() if self.looks == 1 else iter((nan, nan, nan))

    def __eq__(self, other: object) -> bool:
        return True

    __hash__ = None  # type: ignore[assignment]

    def __bool__(self) -> bool:
        return False


class LyingBytes(bytes):
    """Hands out itself where a copy is asked for."""

    def __bytes__(self) -> bytes:
        return self

    def __len__(self) -> int:
        return 1


class LyingText(str):
    """Hands out itself where a copy is asked for."""

    __slots__ = ()

    def __str__(self) -> str:
        return self


class LyingIntent(Intent, frozen=True):
    """Names another velocity each time."""

    def __getattribute__(self, name: str) -> Any:
        if name == "velocity":
            return (LyingFloat(1.0), 0.0, 0.0)
        return super().__getattribute__(name)


def classes_in(value: Any) -> set[type]:
    """Return the classes of a value and of all that it holds."""
    held: list[Any] = []
    if isinstance(value, dict):
        held = [*dict.keys(value), *dict.values(value)]
    elif isinstance(value, tuple):
        held = list(tuple.__iter__(value))
    elif isinstance(value, Message | Intent):
        held = [object.__getattribute__(value, name) for name in type(value).__struct_fields__]
    return {type(value)}.union(*map(classes_in, held))


PLAIN = {float, int, bool, str, bytes, tuple, dict, type(None), type(NO_SIGNALS)}
PLAIN |= {Intent, Place, Outgoing, Words, Standing, Branch, RootKey}
LYING_STANDING = Standing(
    branches=(Branch(RootKey(LyingInt(5), LyingInt(3)), LyingInt(1), 0, LyingInt(-1)),),
    leads=LyingInt(-1),
    queue=0,
    heard=1,
    pushes=False,
    proposal=None,
    reservation=None,
    code=1,
)


@pytest.mark.parametrize(
    ("fields", "what_it_is"),
    [
        ({"velocity": (LyingFloat(1.5), 0.0, 0.0)}, {"velocity": (1.5, 0.0, 0.0)}),
        ({"velocity": LyingTuple((1.5, 0.0, 0.0))}, {"velocity": (1.5, 0.0, 0.0)}),
        ({"target": LyingTuple(HERE)}, {"target": HERE}),
        ({"tilt": LyingTuple((0.1, 0.2))}, {"tilt": (0.1, 0.2)}),
        ({"yaw": LyingFloat(1.5)}, {"yaw": 1.5}),
        ({"force": LyingFloat(1.5)}, {"force": 1.5}),
        ({"force": True}, {"force": 1.0}),
        ({"cost_m": LyingFloat(1.5)}, {"cost_m": 1.5}),
        ({"place": Place(LyingInt(1), LyingInt(2))}, {"place": Place(1, 2)}),
        ({"blocked": LyingTuple((Place(LyingInt(1), 2),))}, {"blocked": (Place(1, 2),)}),
        ({"vertex": 1}, {"vertex": True}),
        ({"words": Words(tier=LyingInt(1))}, {"words": Words(tier=1)}),
        ({"words": Words(standing=LYING_STANDING)}, {"words": Words(standing=LYING_STANDING)}),
        ({"signals": {LyingText("a"): LyingFloat(1.5)}}, {"signals": {"a": 1.5}}),
        (
            {"messages": LyingTuple(((LyingText("local"), LyingBytes(b"ab")),))},
            {"messages": (Outgoing("local", b"ab"),)},
        ),
    ],
)
def test_what_is_checked_of_a_number_with_methods_of_its_own_is_what_is_flown(
    fields: dict[str, Any], what_it_is: dict[str, Any]
) -> None:
    taken = plain(replace(HOVER, **fields))
    assert taken == replace(HOVER, **what_it_is)
    assert classes_in(taken) <= PLAIN


@pytest.mark.parametrize(
    "fields",
    [
        {"wanted": (LyingFloat(1e5), 0.0, 0.0)},
        {"velocity": (LyingFloat(nan), 0.0, 0.0)},
        {"velocity": (0.0, 0.0), "wanted": (0.0, 0.0, 0.0, 0.0)},
        {"velocity": ("1", "0", "0")},
        {"heading_for": (LyingFloat(1e9), 0.0, 0.0)},
        {"target": (1.0,)},
        {"target": LyingTuple((nan, 0.0, 0.0))},
        {"yaw": LyingFloat(inf)},
        {"force": LyingFloat(-1.0)},
        {"cost_m": LyingFloat(-1.0)},
        {"cost_m": LyingFloat(nan)},
        {"place": Place(LyingInt(2**20), 0)},
        {"blocked": ((LyingInt(2**20), 0),)},
        {"blocked": (Place(0, 0),) * 13},
        {"blocked": 7},
        {"words": Words(tier=LyingInt(2**20))},
        {"words": Words(role=9)},
        {"words": Words(agents=-3)},
        {"words": Words(standing=replace(LYING_STANDING, code=LyingInt(900)))},
        {"words": Words(standing="leader")},  # type: ignore[arg-type]
        {"signals": {"a": LyingFloat(inf)}},
        {"messages": (Outgoing("local", LyingBytes(b"x" * 2000)),)},
    ],
)
def test_a_number_outside_the_bounds_is_rejected_whatever_its_methods_say(
    fields: dict[str, Any],
) -> None:
    with pytest.raises((ValueError, TypeError)):
        plain(replace(HOVER, **fields))


def test_an_intent_of_a_class_of_its_own_is_read_once() -> None:
    given = LyingIntent(wanted=REST, velocity=REST, yaw=0.5, force=0.0, heading_for=HERE)
    taken = plain(given)
    assert taken == replace(HOVER, velocity=(1.0, 0.0, 0.0))
    assert classes_in(taken) <= PLAIN


class SulkingLogger(Logging):
    """Fails where its log is asked for."""

    def __init__(self, setup: AgentSetup) -> None:
        del setup

    def decide(self, senses: Senses) -> Intent:
        del senses
        return HOVER

    def take_log(self) -> list[str]:
        raise LookupError("no paper")


def test_a_log_that_fails_is_the_failure_of_its_controller() -> None:
    controller = CheckedController(setup_of(f"{__name__}:SulkingLogger"))
    controller.decide(SENSES)
    with pytest.raises(FaultyControllerError, match=r"agent 3 failed at 2\.5 s, in its log: Look"):
        controller.log(2.5)
