"""The base of all run events: when something happened, to which agent, and who asked for it."""

from typing import Literal

import msgspec

By = Literal["operator"] | None
"""The source of an event; None: the timeline."""


class Event(
    msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True, tag_field="kind", gc=False
):
    """Something that happened at a time."""

    t_s: float
    """[s; simulated time]"""
    agent: int | None
    """The agent that it happened to; None where there is no single one."""

    @property
    def kind(self) -> str:
        """The event's key."""
        return str(self.__struct_config__.tag)


class PlannedEvent(Event, frozen=True, kw_only=True):
    """An event that the timeline or an operator caused, or an unplanned exit."""

    planned: bool
    """False for an unplanned exit."""
    by: By = None
