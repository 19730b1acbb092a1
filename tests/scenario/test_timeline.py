"""The timeline: when steps are due, and in which order."""

from math import inf

from netem.faults import Flap, Heal, Jam, Partition
from netem.link_parameters import Conditions
from worldsim.scenario.faults import Join, Kill, Leave, Pause, Resume
from worldsim.scenario.file import parse
from worldsim.scenario.tables import Scenario
from worldsim.scenario.timeline import Timeline

QUEUE = "{ name = 'Q', vertices = ['V1'], shape = { kind = 'ray', direction = [0, 0, 1] } }"
LINE = f"{{ name = 'line', vertices = {{ V1 = [0, 0, 0] }}, queue = [{QUEUE}] }}"


def scenario(*events: str, radio: str = "") -> Scenario:
    tables = "\n".join(f"[[event]]\n{event}" for event in events)
    text = f"duration_s = 60\nformation = {LINE}\n[fleet]\nagents = 4\n[netem]\n{radio}\n{tables}\n"
    return parse(text)


def played(*events: str) -> list[tuple[float, int, object, bool]]:
    """Return each step: time at which it is due (0.1 s apart), number, action, whether it ends."""
    timeline = Timeline(scenario(*events))
    return [
        (k / 10, step.number, step.event.action, step.ends)
        for k in range(601)
        for step in timeline.due(k / 10)
    ]


def test_each_event_is_due_once_at_its_time_in_any_order_of_the_file() -> None:
    later, sooner = "at_s = 5.0\nkill = [1, 'random:1']", "at_s = 0.3\nleave = ['vertex:V1']"
    assert played(later, sooner) == [
        (0.3, 1, Leave(("vertex:V1",)), False),
        (5.0, 0, Kill((1, "random:1")), False),
    ]


def test_without_events_nothing_is_ever_due() -> None:
    assert Timeline(scenario()).next_s == inf
    assert played() == []


def test_steps_that_became_due_since_the_last_call_come_in_order() -> None:
    timeline = Timeline(scenario("at_s = 2\nkill = [0]\nfor_s = 3", "at_s = 4\njoin = 2"))
    assert timeline.due(1.9) == []
    assert timeline.next_s == 2.0
    assert timeline.joiners == 2
    assert [(step.number, step.event.action, step.ends) for step in timeline.due(9.0)] == [
        (0, Kill((0,)), False),
        (1, Join(count=2), False),
        (0, Kill((0,)), True),
    ]
    assert timeline.joiners == 0


def test_at_one_time_ends_come_before_beginnings() -> None:
    first = "at_s = 1\npause = ['vertex:V1']\nfor_s = 2"
    assert played(first, "at_s = 3\nresume = ['all']") == [
        (1.0, 0, Pause(("vertex:V1",)), False),
        (3.0, 0, Pause(("vertex:V1",)), True),
        (3.0, 1, Resume(("all",)), False),
    ]


def test_each_radio_fault_decodes_into_its_type() -> None:
    events = (
        "at_s = 1\npartition = [[0], [1, 2]]",
        "at_s = 2\npartition = { kind = 'bridge', groups = [[0], [1, 2]], bridge = [3] }",
        "at_s = 3\nheal = true",
        "at_s = 4\njam = { centre_m = [0, 0, 0], radius_m = 2 }",
        "at_s = 5\nflap = { period_s = 0.5, links = [[0, 1]] }",
        "at_s = 6\nnetem = { loss_percent = 50 }",
    )
    assert [action for _, _, action, _ in played(*events)] == [
        Partition(((0,), (1, 2))),
        Partition(((0,), (1, 2)), "bridge", (3,)),
        Heal(),
        Jam((0.0, 0.0, 0.0), 2.0),
        Flap(0.5, ((0, 1),)),
        Conditions(loss_percent=50.0),
    ]


def test_an_operators_event_begins_now_and_ends_by_its_own_number() -> None:
    planned = scenario("at_s = 9\nkill = [0]")
    timeline = Timeline(planned)
    (event,) = scenario("at_s = 2\npause = [1]\nfor_s = 3").event
    step = timeline.begin_now(event)
    assert (step.ends, step.number) == (False, 2)
    timeline.keep(step)
    assert [(each.at_s, each.number, each.ends) for each in timeline.due(60.0)] == [
        (5.0, 2, True),
        (9.0, 0, False),
    ]


def test_an_event_ends_a_fault_before_its_time_and_then_it_ends_no_more() -> None:
    jam = "at_s = 1\nfor_s = 9\njam = { centre_m = [0, 0, 0], radius_m = 1 }"
    assert [(t_s, n, ends) for t_s, n, _, ends in played(jam, "at_s = 3\nend = 'jam-0'")] == [
        (1.0, 0, False),
        (3.0, 0, True),
        (3.0, 1, False),
    ]


def test_a_fault_of_a_given_name_that_has_no_end_is_ended() -> None:
    kill = "at_s = 1\nname = 'outage'\nkill = [0]"
    steps = played(kill, "at_s = 3\nend = 'outage'")
    assert [(t_s, n, ends) for t_s, n, _, ends in steps if n == 0] == [
        (1.0, 0, False),
        (3.0, 0, True),
    ]


def test_an_operator_ends_faults_by_their_names() -> None:
    timeline = Timeline(scenario("at_s = 1\npause = [0]"))
    (event,) = scenario("at_s = 2\nname = 'storm'\nnetem = { loss_percent = 90 }").event
    timeline.keep(timeline.begin_now(event))
    (number,) = timeline.numbers_of("storm")
    found = timeline.end_now(number, 5.0)
    assert (found.at_s, found.event, found.ends) == (5.0, event, True)
    assert timeline.name_of(number) == "storm"
    assert timeline.numbers_of("pause-0") == [0]
    assert timeline.numbers_of("netem-2") == []


def test_an_operators_event_gets_a_name_that_no_other_has() -> None:
    timeline = Timeline(scenario("at_s = 1\npause = [0]\nname = 'pause-2'"))
    (event,) = scenario("at_s = 2\npause = [1]").event
    begun = timeline.begin_now(event)
    timeline.keep(begun)
    assert timeline.name_of(begun.number) == "pause-3"


LOOP = "at_s = 1\nfor_s = 0.5\nevery_s = 20\nkill = ['random:1']"


def test_an_event_repeats_to_the_end_of_the_run_with_numbers_of_its_own() -> None:
    steps = [(t_s, n, ends) for t_s, n, _, ends in played(LOOP, "at_s = 2\nkill = [0]")]
    assert steps == [
        *((1.0, 0, False), (1.5, 0, True), (2.0, 1, False)),
        *((21.0, 2, False), (21.5, 2, True), (41.0, 3, False), (41.5, 3, True)),
    ]


def test_an_event_that_ends_one_that_repeats_ends_it_for_good() -> None:
    steps = played(LOOP, "at_s = 41.2\nend = 'kill-0'")
    assert [(t_s, ends) for t_s, n, _, ends in steps if n != 1] == [
        *((1.0, False), (1.5, True), (21.0, False), (21.5, True), (41.0, False), (41.2, True)),
    ]
    steps = played(LOOP, "at_s = 30\nend = 'kill-0'")
    assert [t_s for t_s, n, _, ends in steps if n != 1 and not ends] == [1.0, 21.0]


def test_an_operators_event_repeats_until_the_operator_ends_it() -> None:
    timeline = Timeline(scenario())
    (event,) = scenario(LOOP).event
    begun = timeline.begin_now(event)
    timeline.keep(begun)
    assert [(each.at_s, each.ends) for each in timeline.due(30.0)] == [
        *((1.5, True), (21.0, False), (21.5, True)),
    ]
    assert timeline.name_of(begun.number + 1) == "kill-1"
    assert timeline.names_to_come == {"kill-1"}
    timeline.cancel("kill-1")
    assert timeline.names_to_come == set()
    assert [each.at_s for each in timeline.due(60.0) if not each.ends] == []
