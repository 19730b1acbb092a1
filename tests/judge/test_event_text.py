"""Run events in words: sentences that need no knowledge of the event's keys."""

from typing import Any

import pytest

from worldsim.engine.virtual import fly
from worldsim.judge.event_text import sentence
from worldsim.judge.run_events import event_of
from worldsim.scenario.file import load
from worldsim.scenario.library import find_scenario

QUEUES = ("Q1", "Q2", "Q3", "Q4")
SCHEDULED = {"planned": True}
BY_OPERATOR = {"planned": True, "by": "operator"}
NO_AGENT = {"agent": None}
MISSION = {
    "mission": 65536,
    "path": [[[0.0, 0.0, 0.0]], 1.0, 0.0, 0.0, 0.0, []],
    "tables": {
        "name": "vee",
        "vertices": {"V1": [0.0, 0.0, 0.0]},
        "queue": [
            {"name": "Q", "vertices": ["V1"], "shape": {"kind": "ray", "direction": [0, 0, 1]}}
        ],
    },
    **SCHEDULED,
}
SENTENCES: list[tuple[dict[str, Any], str]] = [
    ({"kind": "slot", "agent": 3, "place": [2, 1], "before": None}, "a3 takes slot 2 of queue Q3"),
    (
        {"kind": "slot", "agent": 3, "place": None, "before": [2, 1]},
        "a3 gives up slot 2 of queue Q3",
    ),
    (
        {"kind": "slot", "agent": 3, "place": [9, 0], "before": [2, 1]},
        "a3 takes slot 1 of queue number 10",
    ),
    ({"kind": "queue", "agent": 3, "queue": 0}, "a3 enters queue Q1"),
    ({"kind": "queue", "agent": 3, "queue": None}, "a3 leaves its queue"),
    ({"kind": "role", "agent": 3, "role": "vertex"}, "a3 becomes a vertex agent"),
    ({"kind": "role", "agent": 3, "role": "member"}, "a3 becomes a member"),
    ({"kind": "role", "agent": 3, "role": "distress"}, "a3 is in distress"),
    (
        {"kind": "clock", "agent": 3, "number": 1, "offset_s": -3.0, "drift_ppm": 9.0, **SCHEDULED},
        "the clock of a3 goes wrong by -3 s, +9 ppm (scheduled)",
    ),
    (
        {"kind": "clock", "agent": 3, "number": 1, "offset_s": 3.0, "ends": True, **BY_OPERATOR},
        "the clock of a3 is set right: +3 s no more (by the operator)",
    ),
    (
        {"kind": "pose", "agent": 3, "number": 1, "bias_m": [1, 0, 2], "noise_m": 0.1, **SCHEDULED},
        "a3 measures its pose wrong: bias [1.0, 0.0, 2.0] m, noise 0.1 m (scheduled)",
    ),
    (
        {"kind": "pose", "agent": 3, "number": 1, "bias_yaw_deg": 9, "ends": True, **SCHEDULED},
        "a3 measures its pose rightly: yaw +9 deg no more (scheduled)",
    ),
    (
        {"kind": "slow", "agent": 3, "number": 1, "delay_s": 0.2, **SCHEDULED},
        "a3 is slow: each step takes 0.2 s (scheduled)",
    ),
    (
        {"kind": "slow", "agent": 3, "number": 1, "delay_s": 0.2, "ends": True, **SCHEDULED},
        "a3 is no longer slow by 0.2 s a step (scheduled)",
    ),
    (
        {"kind": "starve", "agent": 3, "number": 1, "cpu_percent": 20, "period_s": 0.5} | SCHEDULED,
        "a3 gets 20 % of the CPU in each 0.5 s (scheduled)",
    ),
    (
        {"kind": "starve", "agent": 3, "number": 1, "cpu_percent": 20, "ends": True} | SCHEDULED,
        "a3 has the CPU as before, not only 20 % of it (scheduled)",
    ),
    ({"kind": "kill", "agent": 3, **SCHEDULED}, "a3 is killed; its vehicle hovers (scheduled)"),
    (
        {"kind": "kill", "agent": 3, "signal": 9, "planned": False},
        "the process of a3 ended by signal 9; its vehicle hovers (unplanned)",
    ),
    (
        {"kind": "kill", "agent": 3, "status": 1, "planned": False},
        "the process of a3 ended with status 1; its vehicle hovers (unplanned)",
    ),
    (
        {"kind": "kill", "agent": 3, "planned": False},
        "the process of a3 ended; its vehicle hovers (unplanned)",
    ),
    (
        {"kind": "kill", **NO_AGENT, "nobody": ["vertex:V1", 2], **BY_OPERATOR},
        "kill: no agent matches vertex:V1, 2 (by the operator)",
    ),
    (
        {"kind": "resume", **NO_AGENT, "nobody": ["all"], **SCHEDULED},
        "resume: no agent matches all (scheduled)",
    ),
    (
        {"kind": "join", **NO_AGENT, "refused": "a vehicle is within 0.25 m", **SCHEDULED},
        "join refused: a vehicle is within 0.25 m (scheduled)",
    ),
    ({"kind": "join", "agent": 9, "incarnation": 0, **SCHEDULED}, "a9 joins (scheduled)"),
    ({"kind": "leave", "agent": 3, **SCHEDULED}, "a3 leaves; its vehicle is removed (scheduled)"),
    (
        {"kind": "restart", "agent": 3, "incarnation": 1, **BY_OPERATOR},
        "a3 restarts (incarnation 1) (by the operator)",
    ),
    ({"kind": "pause", "agent": 3, **SCHEDULED}, "a3 is paused (scheduled)"),
    ({"kind": "resume", "agent": 3, **SCHEDULED}, "a3 resumes (scheduled)"),
    ({"kind": "late", "agent": 3, "detail": "no process yet"}, "a3 starts late: no process yet"),
    (
        {"kind": "sensor", "agent": 3, "sensor": "laser", "mode": "stuck", **SCHEDULED},
        "sensors of a3 (laser): stuck (scheduled)",
    ),
    (
        {
            **{"kind": "netem", **NO_AGENT, "number": 1, "loss_percent": 50.0},
            **{"conditions": {"range_m": 6.0, "loss_percent": 50.0}, **SCHEDULED},
        },
        "link conditions changed: loss_percent = 50 (scheduled)",
    ),
    (
        {
            **{"kind": "netem", **NO_AGENT, "number": 1, "multihop": {"delay_ms": 200.0}},
            **{"conditions": {"multihop": {"delay_ms": 200.0}}, **SCHEDULED},
        },
        "link conditions changed: multihop.delay_ms = 200 (scheduled)",
    ),
    (
        {
            **{"kind": "netem", **NO_AGENT, "number": 1, "undone": {"loss_percent": 50.0}},
            **{"conditions": {"range_m": 6.0}, **SCHEDULED},
        },
        "link conditions restored: end of loss_percent = 50 (scheduled)",
    ),
    (
        {
            **{"kind": "partition", **NO_AGENT, "number": 1, "groups": [[0, 1], [2]]},
            **{"parted": "clean", "bridge": [], **SCHEDULED},
        },
        "radio partitioned (clean): a0, a1 | a2 (scheduled)",
    ),
    (
        {
            **{"kind": "partition", **NO_AGENT, "number": 1, "groups": [[0], [2]]},
            **{"parted": "bridge", "bridge": [3], **SCHEDULED},
        },
        "radio partitioned (bridge): a0 | a2, bridged by a3 (scheduled)",
    ),
    ({"kind": "heal", **NO_AGENT, "number": 1, **SCHEDULED}, "partition healed (scheduled)"),
    ({"kind": "heal", **NO_AGENT, **BY_OPERATOR}, "all partitions healed (by the operator)"),
    (
        {
            **{"kind": "jam", **NO_AGENT, "number": 2},
            **{"jam": {"centre_m": [0, 1, 0], "radius_m": 0.5}, **SCHEDULED},
        },
        "radio jammed within 0.5 m of [0.0, 1.0, 0.0] m (scheduled)",
    ),
    ({"kind": "jam", **NO_AGENT, "number": 2, "jam": None, **SCHEDULED}, "jam ended (scheduled)"),
    (
        {
            **{"kind": "flap", **NO_AGENT, "number": 3},
            **{"flap": {"period_s": 1.0, "links": [[0, 1]], "from_s": 1.0}, **SCHEDULED},
        },
        "links flap with a period of 1 s: a0 -> a1 (scheduled)",
    ),
    (
        {
            **{"kind": "flap", **NO_AGENT, "number": 3},
            **{"flap": {"period_s": 1.0, "from_s": 1.0}, **SCHEDULED},
        },
        "links flap with a period of 1 s: all links (scheduled)",
    ),
    *(
        (
            {"kind": "sabotage", **NO_AGENT, "number": 4, "sabotage": sabotage, **SCHEDULED},
            f"{words} (scheduled)",
        )
        for sabotage, words in (
            (
                {"kind": "replay", "agents": [2, 5], "delay_s": 0.5},
                "sabotage (replay) by the radio of a2, a5: each frame again after 0.5 s",
            ),
            (
                {"kind": "garbage", "agents": [2]},
                "sabotage (garbage) by the radio of a2: 200 frames a second",
            ),
            ({"kind": "spoof", "agents": []}, "sabotage (spoof): no agent matches"),
            (None, "sabotage ended"),
        )
    ),
    *(
        (
            {"kind": "intruder", **NO_AGENT, "number": 4, "per_s": 9, **keys, **SCHEDULED},
            f"{words} (scheduled)",
        )
        for keys, words in (
            (
                {"agents": [2, 5]},
                "an intruder with the passwords of a2, a5 puts 9 messages a second on each key",
            ),
            ({"agents": []}, "an intruder without a password opens 9 connections a second"),
            ({"agents": [], "nobody": ["vertex:V1"]}, "intruder: no agent matches vertex:V1"),
            ({"agents": None}, "the intruder ended"),
        )
    ),
    (
        {"kind": "flap", **NO_AGENT, "number": 3, "flap": None, **SCHEDULED},
        "flapping links restored (scheduled)",
    ),
    (
        {"kind": "formation", "agent": 0, "formation": "vee", **MISSION},
        "new formation 'vee', given to a0 (scheduled)",
    ),
    (
        {"kind": "frame", **NO_AGENT, "formation": "vee", **MISSION},
        "new path of the target frame (scheduled)",
    ),
]


@pytest.mark.parametrize(("row", "words"), SENTENCES, ids=[words for _, words in SENTENCES])
def test_an_event_is_one_sentence(row: dict[str, Any], words: str) -> None:
    assert sentence(event_of({"t_s": 1.0, **row}), QUEUES) == words


def test_every_event_of_a_run_names_its_agent() -> None:
    events = "[{ at_s = 5, join = 1 }, { at_s = 7, leave = ['random:4'] }]"
    scenario = load(find_scenario("join-leave-12"), {"event": events, "duration_s": "10"})
    events = fly(scenario).loop.events
    assert {"join", "leave", "slot", "queue", "role"} <= {event.kind for event in events}
    queues = [queue.name for queue in scenario.formation.queue]
    assert all(sentence(event, queues).startswith(f"a{event.agent} ") for event in events)
