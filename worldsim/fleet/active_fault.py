"""The faults in force in a running fleet, as an operator is shown them."""

from collections.abc import Iterator
from typing import Any

import msgspec

from netem.conditions import NetworkConditions
from netem.faults import Outage, RadioEvent
from worldsim.engine.fault_reports import FaultReport, FaultReports
from worldsim.scenario.faults import AgentFault, SensorFault
from worldsim.scenario.selectors import ProcessName
from worldsim.scenario.timeline import Timeline


class ActiveFault(msgspec.Struct, frozen=True):
    """A fault in force."""

    number: int
    name: str
    """By which it can be ended."""
    kind: str
    """The key of its event."""
    since_s: float
    """When it began [s; simulated time]."""
    until_s: float | None
    """When it will end [s; simulated time]; None: to the end of the run, or until it is ended."""
    agents: tuple[int, ...] | None
    """The agents that it strikes, or whose radios it uses; None for other faults of the radio."""
    process: ProcessName | None = None
    """netem or the world, where it strikes that process."""
    fault: RadioEvent = RadioEvent()
    """A fault of the radio; empty for another one."""
    values: dict[str, Any] = {}
    """The values of a fault of agents, by the keys of its table."""


def active_faults(
    reports: FaultReports, timeline: Timeline, network: NetworkConditions
) -> Iterator[ActiveFault]:
    """Yield the faults in force, in the order in which they began."""
    for report in reports.all:
        if report.to_s is not None:
            continue
        number, on_radio = report.number, network.in_force.get(report.number)
        fault = on_radio.fault if on_radio is not None else Outage("kill")
        yield ActiveFault(
            number=number,
            name=timeline.name_of(number),
            kind=report.kind,
            since_s=report.from_s,
            until_s=timeline.ends_s(number),
            agents=_agents(report),
            process=report.process,
            fault=RadioEvent() if isinstance(fault, Outage) else RadioEvent.of(fault),
            values=_values(timeline.event_of(number).action),
        )


def _agents(report: FaultReport) -> tuple[int, ...] | None:
    strikes = report.process is None and report.kind != "disk_full"
    return report.held if strikes and (report.held or not report.on_radio) else None


def _values(action: object) -> dict[str, Any]:
    """Return the values of a fault of agents, without its agents; none for other faults."""
    if not isinstance(action, AgentFault | SensorFault):
        return {}
    found: dict[str, Any] = msgspec.to_builtins(action)
    return {key: value for key, value in found.items() if key != "agents" and value is not None}
