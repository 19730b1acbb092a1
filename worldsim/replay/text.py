"""A step of a replay as text: a few lines to read, or one of JSON for a program."""

from collections.abc import Sequence
from math import dist
from typing import Any

import msgspec

from agent.lines import SensesLines
from agent.messages import Vector
from worldsim.replay.steps import Step

LEAST_MPS = 1e-3
"""A smaller change by the safety filter is not told [m/s]."""


def step_text(step: Step) -> str:
    """Return what an agent sensed and wanted at a step, in a few lines."""
    senses, intent = step.senses, step.intent
    lines = [
        f"{senses.now_s:.3f} s  at {_point(senses.position)}, heading {senses.yaw:.2f} rad",
        f"  hears  {_heard(step)}",
        *_inbox(step),
        f"  wants  {_point(intent.velocity)} m/s{_claim(step)}",
        *_filtered(step),
        *(f"  {name} = {value:.6g}" for name, value in sorted(intent.signals.items())),
        *(f"  says   {text}" for text in step.log),
    ]
    return "\n".join(lines)


def step_json(step: Step, lines: SensesLines) -> str:
    """Return a step as a line of JSON: the senses as a program gets them, and the intent.

    lines: writes the senses of all steps of one agent, in order.
    """
    intent = step.intent
    said: dict[str, Any] = {
        "senses": msgspec.Raw(lines.line(step.senses)),
        "intent": {
            "wanted": intent.wanted,
            "velocity": intent.velocity,
            "yaw": intent.yaw,
            "force": intent.force,
            "heading_for": intent.heading_for,
            "target": intent.target,
            "place": intent.place,
            "messages": [{"channel": channel, "data": data} for channel, data in intent.messages],
            "signals": dict(intent.signals),
        },
        "velocity": step.velocity,
        "incarnation": step.incarnation,
        "log": step.log,
    }
    return msgspec.json.encode(said).decode()


def _heard(step: Step) -> str:
    """Return the neighbours, the nearest first, with their distance and the age of the news."""
    at = step.senses.position
    near = sorted((dist(at, each.position), each.id, each.age_s) for each in step.senses.neighbours)
    told = [f"a{other} {away_m:.2f} m ({age_s:.2f} s old)" for away_m, other, age_s in near]
    return ", ".join(told) or "nobody"


def _inbox(step: Step) -> Sequence[str]:
    inbox = step.senses.inbox
    if not inbox:
        return ()
    sizes = ", ".join(
        f"a{each.source} {len(each.data)} B ({each.age_s:.2f} s old)" for each in inbox
    )
    return (f"  inbox  {sizes}",)


def _claim(step: Step) -> str:
    place = step.intent.place
    return "" if place is None else f", claims rank {place[1]} of queue {place[0]}"


def _filtered(step: Step) -> Sequence[str]:
    changed_mps = dist(step.velocity, step.intent.velocity)
    if changed_mps <= LEAST_MPS:
        return ()
    return (f"  flies  {_point(step.velocity)} m/s: the filter changes {changed_mps:.3f} m/s",)


def _point(vector: Vector) -> str:
    x, y, z = vector
    return f"({x:.3f}, {y:.3f}, {z:.3f})"
