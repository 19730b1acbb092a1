"""The launcher: starts a fleet of processes, follows the run, and ends every process.

It opens no Zenoh session and no recording. It forks the zygote first, then netem and the world; the
zygote forks the agents. An exit is what waitpid reports, to the launcher or to the zygote.
"""

import json
import signal
import socket
import time
from functools import partial
from pathlib import Path

from netem import process as netem_process
from netem.compiled import tell_if_unfit
from netem.wire.access import OPERATOR, AccessControl, write_users
from netem.wire.keys import agent_name, medium_name
from netem.wire.shutdown import ignore_signals, interrupt_on_signals
from worldsim.fleet import process as world_process
from worldsim.fleet.culprits import SharedSteps
from worldsim.fleet.fleet_monitor import FleetMonitor, ProcessSockets, StartError
from worldsim.fleet.fork import adopt_orphans, children, end_orphans
from worldsim.fleet.frame_witness import FrameWitness
from worldsim.fleet.intruder import IntruderCounts
from worldsim.fleet.ipc import (
    ActionRequest,
    AgentProcess,
    EndRequest,
    world_sockets,
    zygote_sockets,
)
from worldsim.fleet.launcher_link import LaunchedLink
from worldsim.fleet.planned_stops import PlannedStops
from worldsim.fleet.process import RunOptions
from worldsim.fleet.process_table import ProcessRow, ProcessTable, processes, sweep_passwords
from worldsim.fleet.supervisor import Supervisor
from worldsim.fleet.terminal import Terminal, console_on
from worldsim.fleet.zygote import AgentProcessConfig, Zygote
from worldsim.results.closing import Output
from worldsim.results.environment import descriptors_problem
from worldsim.results.flown_code import keep_code
from worldsim.results.overall import FailedRun, Result
from worldsim.results.run_folder import RunDirectory, RunDirectoryError, unwritable
from worldsim.results.summary import Summary
from worldsim.scenario.tables import Scenario

__all__ = ["ProcessRow", "processes", "run"]

NOT_STARTED, UNKNOWN, INTERRUPTED = 2, 3, 130
OTHER_DESCRIPTORS = 64
"""File descriptors that netem needs beside one for each agent."""
POLL_S = 1.0
RUN_END_WITHIN_S = 15.0
END_WITHIN_S = 3.0


def run(scenario: Scenario, directory: RunDirectory, options: RunOptions, output: Output) -> int:
    """Run a scenario with real processes and tell the outcome; return the exit status.

    No process is left behind, also after Ctrl-C, SIGTERM and SIGHUP. Raises RunDirectoryError where
    the host allows too few files.
    """
    tell_if_unfit()
    launched_s = time.monotonic()
    problem = descriptors_problem(scenario.rows + OTHER_DESCRIPTORS)
    if problem is not None:
        directory.remove_results()
        raise RunDirectoryError(directory.path, problem)
    interrupt_on_signals()
    adopt_orphans()
    launcher = Launcher(
        scenario, directory, options._replace(users=directory.users, launched_s=launched_s), output
    )
    try:
        launcher.fly()
        status = launcher.conclude()
    except StartError as error:
        launcher.report_failure(str(error))
        launcher.end()
        directory.remove_results()
        status = NOT_STARTED
    except KeyboardInterrupt:
        ignore_signals()
        launcher.interrupt()
        status = INTERRUPTED
    finally:
        ignore_signals()
        launcher.end()
    return status


class Launcher:
    """One launched fleet, from its first process to its last."""

    def __init__(
        self, scenario: Scenario, directory: RunDirectory, options: RunOptions, output: Output
    ) -> None:
        self.terminal = Terminal(console_on(output.stream), quiet=output.quiet)
        self._output = output
        self._others = children()
        """Processes of whoever launches the fleet: a live view."""
        self._scenario = scenario
        self._directory = directory
        self._options = options
        self._endpoint = f"tcp/127.0.0.1:{_free_port()}"
        self._access = AccessControl(directory.users, options.run, scenario.rows)
        self._steps = SharedSteps.of(scenario.rows, options.shards)
        self._counts = IntruderCounts()
        self._table = ProcessTable(directory.path, options.run, self._endpoint)
        self._zygote, self._zygote_end = zygote_sockets()
        self._world, self._world_end = world_sockets()
        self._monitor = FleetMonitor(
            ProcessSockets(self._zygote, self._world),
            self.terminal,
            self._table,
            directory.logs,
            options.lockstep,
        )
        self._supervisor = Supervisor(directory.logs, self._monitor.child_exited)
        self._stops = PlannedStops(
            self._supervisor, self._table, self._world, self._mediums(), self._restart_netem
        )
        self._monitor.stops = self._stops

    def fly(self) -> None:
        """Start all processes, and follow the run until the world has ended.

        Raises StartError when a process does not start.
        """
        count, name = self._scenario.fleet.agents, self._scenario.name
        self.terminal.print(
            f"{name}: starting netem, the world and {count} agents; logs in {self._directory.logs}"
        )
        self._start()
        while "world" in self._supervisor.pids and not self._monitor.failed:
            self._supervisor.poll(self._stops.seconds_left(POLL_S))
            self._stops.wake_world()
            self._monitor.report_missing()
        self._end_world()

    def interrupt(self) -> None:
        """Let the world finish the recording, and print the verdict if the run had begun."""
        self.terminal.print("interrupted: ending the run")
        self._end_world()
        if self._monitor.all_present or self._directory.summary.exists():
            self.conclude()
        else:
            self._directory.remove_results()
            self.terminal.print(f"interrupted before take-off; logs in {self._directory.logs}")

    def conclude(self) -> int:
        """Tell the outcome from the run's summary; return the exit status."""
        self.terminal.close()
        try:
            summary: Summary = json.loads(self._directory.summary.read_text("utf-8"))
        except FileNotFoundError:
            self._directory.free_room()
            self.report_failure(self._without_summary())
            return UNKNOWN
        recorded = self._directory.recording.exists()
        return self._output.conclude(Result(self._directory.path, summary), recorded)

    def report_failure(self, text: str) -> None:
        """Report why there is no summary."""
        self.terminal.print_error(text)
        name, seed = self._scenario.name, self._scenario.seed
        self._output.fail(FailedRun(self._directory.path, name, seed, text, outcome="inconclusive"))

    def end(self) -> None:
        """End every process that is left, and delete the passwords."""
        self._monitor.run_over = True
        self.terminal.close()
        self._zygote.send(EndRequest())
        self._supervisor.end(["world", *self._mediums()], END_WITHIN_S, signal.SIGTERM)
        self._supervisor.end(["zygote"], END_WITHIN_S, None)
        self._supervisor.end(list(self._supervisor.pids), END_WITHIN_S, signal.SIGKILL)
        end_orphans(self._others)
        self._directory.users.unlink(missing_ok=True)

    def _without_summary(self) -> str:
        """Return what there is to say of a run whose world wrote no summary."""
        ended = self._monitor.world_exit
        if ended is None or not self._directory.recording.exists():
            ended = f"{ended}; " if ended is not None else ""
            return f"{ended}no summary was written; {self._monitor.log_tail('world')}"
        folder = self._directory.path
        return f"inconclusive ({ended}); judge the recording up to then: qswarm verify {folder}"

    def _end_world(self) -> None:
        self._monitor.run_over = True
        self._supervisor.end(["world"], RUN_END_WITHIN_S, signal.SIGTERM)

    def _mediums(self) -> list[str]:
        return [medium_name(shard) for shard in range(self._options.shards)]

    def _start(self) -> None:
        self._write_passwords()
        start = self._supervisor.start
        zygote = start("zygote", signal.SIGKILL, self._run_zygote)
        self._zygote_end.close()
        for shard in range(self._options.shards):
            self._start_netem(shard)
        # SIGTERM lets the world finish the recording even when the launcher has died.
        world = start("world", signal.SIGTERM, self._run_world)
        self._world_end.close()
        self._table.add("zygote", zygote)
        self._table.add("world", world)
        self._supervisor.watch(self._zygote, self._monitor.receive_from_zygote)
        self._supervisor.watch(self._world, self._monitor.receive_from_world)
        agents = tuple(AgentProcess(agent, 0) for agent in range(self._scenario.fleet.agents))
        self._zygote.send(ActionRequest("start", agents))

    def _start_netem(self, shard: int) -> None:
        name = medium_name(shard)
        pid = self._supervisor.start(name, signal.SIGKILL, partial(self._run_netem, shard))
        self._steps.note_medium(shard, pid)
        self._table.add(name, pid)

    def _restart_netem(self, shard: int) -> None:
        self._start_netem(shard)
        self._table.write()

    def _write_passwords(self) -> None:
        sweep_passwords(self._directory.path.parent)
        agents = [agent_name(agent) for agent in range(self._scenario.rows)]
        try:
            write_users(self._directory.users, ["world", OPERATOR, *self._mediums(), *agents])
        except OSError as error:
            self._directory.remove_results()
            raise unwritable(self._directory.users, error) from error

    def _run_zygote(self) -> int:
        for end in (self._zygote, self._world, self._world_end):
            end.close()
        config = AgentProcessConfig(
            self._options.run,
            self._endpoint,
            self._directory.logs,
            users=self._directory.users,
            steps=self._steps.page,
            inputs=self._inputs(),
            counts=self._counts,
            commands=self._scenario.commands,
        )
        return Zygote(self._zygote_end, config).serve()

    def _inputs(self) -> Path | None:
        """Return the folder in which agents keep what they are given; None where they do not."""
        if not self._options.inputs:
            return None
        self._directory.inputs.mkdir()
        keep_code(self._directory.inputs, self._scenario.control)
        return self._directory.inputs

    def _run_netem(self, shard: int) -> int:
        for end in (self._zygote, self._world, self._world_end):
            end.close()
        check = FrameWitness(self._scenario) if self._scenario.commands else None
        options = netem_process.ServingOptions(patient=True, check=check)
        return netem_process.run(self._endpoint, shard, options, self._access)

    def _run_world(self) -> int:
        for end in (self._zygote, self._world):
            end.close()
        return world_process.run(
            self._endpoint,
            self._scenario,
            lambda: self._directory,
            self._options,
            lambda _: LaunchedLink(self._world_end, self._steps, self._counts),
        )


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port
