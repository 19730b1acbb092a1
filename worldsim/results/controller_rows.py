"""What a summary says of controllers: how the safety filter changed them, and what they said."""

from typing import TypedDict

from agent.config import FilterMode
from worldsim.engine.controller_counters import ControllerCounters


class FilterRow(TypedDict):
    """How the safety filter changed what each agent's controller wanted; row i is agent i."""

    mode: FilterMode  # "watch": how it would have changed it
    acted_fraction: list[float | None]  # of the agent's steps
    mean_mps: list[float | None]  # over the steps in which it acted [m/s]
    most_mps: list[float | None]  # [m/s]


class DatagramRow(TypedDict):
    """What the controllers said to each other in their own words; row i is agent i."""

    sent: list[int]
    sent_b: list[int]  # bytes of their own
    received: list[int]
    received_b: list[int]
    oldest_s: list[float | None]  # age of the oldest one received [s]


def datagram_row(controllers: ControllerCounters) -> DatagramRow | None:
    """Return what the controllers said to each other; None where none said anything."""
    use = controllers.datagram_use()
    if use is None:
        return None
    return {
        "sent": use.sent,
        "sent_b": use.sent_b,
        "received": use.received,
        "received_b": use.received_b,
        "oldest_s": use.oldest_s,
    }


def filter_row(mode: FilterMode, controllers: ControllerCounters) -> FilterRow | None:
    """Return how the safety filter changed what the controllers wanted; None where it is off."""
    if mode == "off":
        return None
    use = controllers.filter_use()
    return {
        "mode": mode,
        "acted_fraction": use.acted_fraction,
        "mean_mps": use.mean_mps,
        "most_mps": use.most_mps,
    }


def filter_texts(row: FilterRow | None) -> list[str]:
    """Return a line on what the safety filter changed, or would have changed; none for nothing."""
    if row is None:
        return ["the safety filter was off"]
    acted = [share or 0.0 for share in row["acted_fraction"]]
    if not any(acted):
        return ["the safety filter would have changed nothing"] if row["mode"] == "watch" else []
    most = max(range(len(acted)), key=acted.__getitem__)
    changed_mps = max(each or 0.0 for each in row["most_mps"])
    acts = "would have changed" if row["mode"] == "watch" else "changed"
    return [
        f"the safety filter {acts} {100 * sum(acted) / len(acted):.1f} % of the velocities, by at"
        f" most {changed_mps:.2f} m/s; most often those of agent {most} ({100 * acted[most]:.1f} %)"
    ]
