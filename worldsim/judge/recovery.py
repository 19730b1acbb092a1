"""Recoveries: the time until a team that was disturbed stands in a complete formation again.

It is disturbed where agents are lost or come back, where the radio or an agent's fault changes, and
where a fault ends that parted it. While a fault in force forbids re-forming, no time counts.

Complete: the running agents hold exactly the places that the formation has for their number; a
place in which a dead vehicle hovers is not among them (E18). Standing: each agent is within 0.12 m
of its own slot for 2 s.
"""

import msgspec

from worldsim.judge.asked_time import AskedTime
from worldsim.judge.radio_events import RadioRunEvent, settings_text
from worldsim.judge.run_events import (
    LOSS_KINDS,
    RETURN_KINDS,
    AgentFaultRunEvent,
    LossEvent,
    Reconnected,
    ReturnEvent,
)
from worldsim.judge.tick import Tick
from worldsim.scenario.tables import CONVERGED_S


class Recovery(msgspec.Struct):
    """A disturbance of the team, and its time to re-form."""

    t_s: float
    """When it was [s; simulated time]."""
    kind: str
    """The kind of the events."""
    agents: list[int]
    """The agents that were lost, came back, or have or had a fault; none for the radio."""
    reformed_s: float | None = None
    """From ``timed_from_s`` to the start of the 2 s [s]; None until the team has re-formed.

    From ``t_s`` where a fault forbade it to the last: that was not timed.
    """
    timed_from_s: float | None = None
    """From when the time counts: ``t_s``, or the end of the last fault that forbade re-forming.

    None while one does [s; simulated time].
    """
    asked_s: float = 0.0
    """The longest time without such a fault that the team had, or took [s]."""
    overtaken_s: float | None = None
    """What of that time it had before the next disturbance [s]; None where it re-formed before."""
    in_place_from_s: float | None = None
    """Since when it was whole again, at the next disturbance or now [s; simulated time].

    None where it was not, and where it has re-formed before that disturbance.
    """
    changed: str | None = None
    """What conditions of the radio changed; None where none did."""

    def is_late(self, within_s: float) -> bool:
        """Return whether the team has had a time [s] to re-form, and has not done so in it.

        It had only the time until the next disturbance.
        """
        if self.overtaken_s is not None:
            return self.overtaken_s >= within_s
        if self.reformed_s is None:
            return self.asked_s >= within_s
        return self.asked_s > within_s


class Recoveries:
    """Every disturbance of the team in a run."""

    def __init__(self) -> None:
        self.all: list[Recovery] = []
        self._open: list[tuple[Recovery, AskedTime]] = []
        self._forbidden = False
        self.standing_since_s: float | None = None
        """Since when the team has stood again [s]; None where it does not."""

    def note(self, t_s: float, *, forbidden: bool) -> None:
        """Take from a time on whether a fault in force forbids re-forming [s; simulated time]."""
        self._forbidden = forbidden
        for recovery, asked in self._open:
            asked.note(t_s, forbidden=forbidden, standing_since_s=self.standing_since_s)
            recovery.timed_from_s = asked.from_s

    def handle_event(self, event: LossEvent | ReturnEvent) -> None:
        """Take the loss or return of an agent; without an agent, a start that was refused."""
        if event.agent is None:
            self.all.append(Recovery(event.t_s, event.kind, []))
        else:
            self._disturbed(event).agents.append(event.agent)

    def handle_radio(self, event: RadioRunEvent | Reconnected) -> None:
        """Take a change of the radio, after which the team is not parted, or no more."""
        begun = self._begin(event)
        if not isinstance(event, Reconnected):
            begun.changed = settings_text(event)

    def handle_agent_fault(self, event: AgentFaultRunEvent) -> None:
        """Take a change of an agent's fault, after which the team is not parted, or no more."""
        last = self._disturbed(event)
        if event.agent is not None:
            last.agents.append(event.agent)

    def _disturbed(self, event: LossEvent | ReturnEvent | AgentFaultRunEvent) -> Recovery:
        """Return the disturbance that an event belongs to: that of others of its time and kind."""
        last = self.all[-1] if self.all else None
        if last is None or (last.t_s, last.kind) != (event.t_s, event.kind):
            return self._begin(event)
        self.standing_since_s = None
        return last

    def _begin(
        self, event: LossEvent | ReturnEvent | AgentFaultRunEvent | RadioRunEvent | Reconnected
    ) -> Recovery:
        until_s = event.t_s if self.standing_since_s is None else self.standing_since_s
        for each, its in self._open:
            if each.overtaken_s is None:
                each.overtaken_s = its.until(until_s)
                each.in_place_from_s = self.standing_since_s
        self.standing_since_s = None
        asked = AskedTime(event.t_s, forbidden=self._forbidden)
        recovery = Recovery(event.t_s, event.kind, [], timed_from_s=asked.from_s)
        self.all.append(recovery)
        self._open.append((recovery, asked))
        return recovery

    def see(self, tick: Tick, in_place: bool) -> None:
        """Take a tick; in_place: whether every running agent is in its place."""
        if not self._open:
            return
        if not (in_place and self._all_back(tick)):
            self.standing_since_s = None
        elif self.standing_since_s is None:
            self.standing_since_s = tick.time_s
        since_s = self.standing_since_s
        newest, _ = self._open[-1]  # the others were overtaken
        newest.in_place_from_s = since_s
        for recovery, asked in self._open:
            recovery.asked_s = asked.until(tick.time_s if since_s is None else since_s)
        if since_s is not None and tick.time_s - since_s >= CONVERGED_S - 1e-9:
            for recovery, asked in self._open:
                asked.settle(since_s)
                recovery.timed_from_s, recovery.reformed_s = asked.from_s, recovery.asked_s
                if asked.from_s is None:
                    recovery.reformed_s = since_s - recovery.t_s
            newest.in_place_from_s = None
            self._open = []

    def _all_back(self, tick: Tick) -> bool:
        """Return whether every agent that came back, and was not lost again, has booted."""
        lost_again: set[int] = set()
        for recovery in reversed(self.all):
            if recovery.kind in LOSS_KINDS:
                lost_again.update(recovery.agents)
            elif recovery.kind in RETURN_KINDS and any(
                not tick.alive[agent] for agent in recovery.agents if agent not in lost_again
            ):
                return False
        return True
