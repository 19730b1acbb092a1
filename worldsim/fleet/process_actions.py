"""What a free-running fleet does to other processes: signals, starts, orders to the medium."""

from collections.abc import Iterable, Sequence
from typing import assert_never

from netem.faults import FaultOrder
from worldsim.engine.operations import (
    AdmitAgents,
    DisturbAgents,
    EndProcesses,
    FillDisk,
    GiveMission,
    Operation,
    PauseProcesses,
    ResumeProcesses,
    SetSensorMode,
    StartProcesses,
    StopWorldProcess,
    ThrottleProcesses,
)
from worldsim.fleet.ipc import AgentProcess, IntruderEndRequest, IntruderRequest, ProcessAction
from worldsim.fleet.launcher_link import LauncherLink
from worldsim.fleet.netem_process import NetemProcess
from worldsim.fleet.startup import Startup
from worldsim.judge.event import By
from worldsim.scenario.faults import Intruder

START_WITHIN_S = 5.0
"""How long before the end of a long boot the process starts: it waits at most 30 s for messages."""


class ProcessActions:
    """Carries operations out on the other processes: signals and starts, and orders to the medium.

    It waits for nothing: an operation is done within milliseconds, or reported as late.
    """

    def __init__(
        self, netem: NetemProcess, startup: Startup, launcher: LauncherLink, boot_wall_s: float
    ) -> None:
        self._netem = netem
        self._startup = startup
        self._launcher = launcher
        self._after_s = max(0.0, boot_wall_s - START_WITHIN_S)

    def carry_out(
        self, operation: Operation, slot: int, incarnations: Sequence[int], by: By = None
    ) -> list[int]:
        """Carry out an operation before a slot; return admitted agents that are not up.

        incarnations: of all agents, as they were before the operation. by: who asked for it.
        """
        match operation:
            case EndProcesses() | PauseProcesses() | ResumeProcesses():
                processes = _processes(operation.agents, incarnations)
                self._launcher.request(_action(operation), processes, by=by)
            case ThrottleProcesses(stops=stops, continues=continues):
                self._launcher.request("pause", _processes(stops, incarnations))
                self._launcher.request("resume", _processes(continues, incarnations))
            case StartProcesses(incarnations=started):
                self._startup.expect(started)
                starting = [AgentProcess(*each) for each in started.items()]
                self._launcher.request("start", starting, self._after_s)
            case AdmitAgents(agents=agents):
                return self._startup.absent(agents)
            case FaultOrder():
                self._netem.order(operation, slot, by)
            case DisturbAgents(fault=Intruder() as intruder):
                self._intrude(operation, intruder)
            case (
                SetSensorMode() | DisturbAgents() | GiveMission() | StopWorldProcess() | FillDisk()
            ):
                pass  # the world's own matters; its stop waits for the slot's end
            case _:
                assert_never(operation)
        return []

    def _intrude(self, operation: DisturbAgents, intruder: Intruder) -> None:
        """Start or end an intruder; one for which no agent was found does not start."""
        number, agents = operation.number, operation.agents
        if operation.ends:
            self._launcher.request_intruder(IntruderEndRequest(number))
        elif agents or not intruder.agents:
            self._launcher.request_intruder(IntruderRequest(number, agents, intruder.rate))


def _action(operation: EndProcesses | PauseProcesses | ResumeProcesses) -> ProcessAction:
    match operation:
        case EndProcesses():
            return "kill"
        case PauseProcesses():
            return "pause"
        case ResumeProcesses():
            return "resume"
    assert_never(operation)


def _processes(agents: Iterable[int], incarnations: Sequence[int]) -> list[AgentProcess]:
    return [AgentProcess(agent, incarnations[agent]) for agent in agents]
