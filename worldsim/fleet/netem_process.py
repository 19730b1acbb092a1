"""Netem's process under a timeline that kills or pauses it, in a free-running fleet.

A process is brought into the state that the faults in force ask for at the end of a slot, so that
the answer to an operator still gets through.
"""

import time
from typing import Literal

import msgspec

from netem.conditions import NetworkConditions
from netem.faults import FaultOrder
from netem.messages import FaultOrders, MediumCounters, Resumption
from netem.wire.bus import Bus, PendingQuery
from worldsim.fleet.launcher_link import LauncherLink
from worldsim.fleet.startup import Startup
from worldsim.judge.event import By

ProcessState = Literal["up", "paused", "dead", "starting"]
MOST_BACKLOG_S = 1.0
"""A paused process is sent messages for so long [s; wall time]: its buffers would fill."""


class NetemProcess:
    """Lets the launcher strike netem's process, and sets a new one up.

    network: the faults in force. speed: simulated seconds in a second of wall time.
    """

    def __init__(
        self,
        bus: Bus,
        startup: Startup,
        launcher: LauncherLink,
        network: NetworkConditions,
        speed: float,
    ) -> None:
        self.state: ProcessState = "up"
        self._put_orders = bus.publisher("orders")
        self._startup, self._launcher = startup, launcher
        self._network, self._speed = network, speed
        self._waiting: list[FaultOrders] = []
        """Orders that netem could not take so far."""
        self._outages_by: dict[int, By] = {}
        """Who asked for each outage, by its number."""
        self._setup: PendingQuery | None = None
        self._since_s = time.monotonic()

    @property
    def paused_s(self) -> float:
        """How long the process has been paused [s; wall time]; 0 where it is not."""
        return time.monotonic() - self._since_s if self.state == "paused" else 0.0

    @property
    def takes_messages(self) -> bool:
        """Whether messages may be sent: those to a process that is paused for long would block."""
        return self.paused_s < MOST_BACKLOG_S

    def order(self, order: FaultOrder, slot: int, by: By = None) -> None:
        """Send netem an order that applies before a slot; while it is down, keep it back.

        Call it before the order is applied to the faults in force. An outage is no order to netem.
        by: who asked for it.
        """
        if order.outage is not None:
            self._outages_by[order.number] = by
        if order.outage is None and order.number not in self._network.outages:
            self._waiting.append(FaultOrders(slot, (order,)))
            self._send_waiting()

    def follow(self, slot: int, counters: MediumCounters | None) -> None:
        """Bring the process into the state that the faults in force ask for after a slot.

        counters: the newest ones.
        """
        down, killed = bool(self._network.outages), "kill" in self._network.outages.values()
        match self.state:
            case "up" | "paused" if killed:
                self._act("kill", "dead")
            case "starting" if down:
                self._act("kill", "dead")
            case "up" if down:
                self._act("pause", "paused")
            case "paused" if not down:
                self._act("resume", "up")
            case "dead" if not down:
                self._act("start", "starting")
                self._setup = None
            case "starting":
                self._set_up(slot, counters)
            case _:
                pass  # it is as it should be
        self._send_waiting()

    def wake(self) -> None:
        """Continue a paused process at the end of the run, so that it ends with the others."""
        if self.state == "paused":
            self._act("resume", "up")

    def _act(
        self, action: Literal["kill", "pause", "resume", "start"], state: ProcessState
    ) -> None:
        self._launcher.stop("netem", action, by=self._outage_by())
        self.state, self._since_s = state, time.monotonic()

    def _outage_by(self) -> By:
        """Return who asked for the outage that holds the process down; of several, the first.

        A kill comes before a pause, which a process that is not up yet takes as a kill too.
        """
        in_force = self._network.outages
        first = sorted(in_force, key=lambda number: in_force[number] != "kill")[:1]
        return next((self._outages_by.get(number) for number in first), None)

    def _set_up(self, slot: int, counters: MediumCounters | None) -> None:
        """Send a new process its setup, until it accepts one."""
        accepted = self._setup.answered() if self._setup is not None else False
        if accepted:
            self.state = "up"
        elif accepted is False:
            # The setup holds every fault that is in force by now.
            self._waiting.clear()
            before = counters.after_kill() if counters is not None else None
            resumption = Resumption(slot + 1, self._network.orders(), before)
            self._setup = self._startup.resume_medium(self._speed, resumption)

    def _send_waiting(self) -> None:
        if self.state == "up":
            for orders in self._waiting:
                self._put_orders(msgspec.json.encode(orders))
            self._waiting.clear()
