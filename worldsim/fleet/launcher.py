"""The launcher: it starts a fleet of processes, says what becomes of them, and ends them all.

It opens no session and no recording itself. It forks the zygote first, then netem and the world;
the zygote forks the agents. Deaths are what waitpid says, its own or the zygote's.
"""

import json
import os
import signal
import socket
import time
from functools import partial

from rich.console import Console

from netem import process as netem_process
from netem.wire.access import OPERATOR, AccessControl, write_users
from netem.wire.keys import agent_name, medium_name
from netem.wire.shutdown import ignore_signals, interrupt_on_signals
from worldsim.fleet import process as world_process
from worldsim.fleet.fork import Exit
from worldsim.fleet.ipc import Line, MessageSocket
from worldsim.fleet.launcher_link import Conducted, Progress
from worldsim.fleet.process import Terms
from worldsim.fleet.process_table import ProcessRow, ProcessTable, processes
from worldsim.fleet.supervisor import Supervisor
from worldsim.fleet.terminal import Terminal
from worldsim.fleet.zygote import Brood, Zygote
from worldsim.results.exit_status import EXIT_STATUS
from worldsim.results.run_folder import RunDirectory, unwritable
from worldsim.results.summary import Summary
from worldsim.results.verdict_text import verdict
from worldsim.scenario.tables import Scenario

__all__ = ["ProcessRow", "processes", "run"]

NOT_STARTED, UNKNOWN, INTERRUPTED = 2, 3, 130
LOOK_EVERY_S = 1.0
PATIENCE_S = 5.0
LANDING_WITHIN_S = 15.0
END_WITHIN_S = 3.0
TAIL_LINES = 5
MAX_TAIL_B = 4096


class StartError(RuntimeError):
    """A process of the fleet that did not come up; the text says which, and its last words."""


def run(scenario: Scenario, directory: RunDirectory, terms: Terms) -> int:
    """Fly a scenario with real processes, and tell the verdict; return the exit status.

    Whatever happens, Ctrl-C, SIGTERM and SIGHUP included, no process is left behind.
    """
    interrupt_on_signals()
    # One thread for receiving is enough for a client, and saves a tenth of its CPU time.
    os.environ.setdefault("ZENOH_RUNTIME", "(rx: (worker_threads: 1))")
    launch = Launch(scenario, directory, terms._replace(users=directory.users))
    try:
        launch.fly()
        status = launch.conclude()
    except StartError as error:
        launch.terminal.say(str(error))
        launch.end()
        directory.remove_results()
        status = NOT_STARTED
    except KeyboardInterrupt:
        ignore_signals()
        launch.interrupt()
        status = INTERRUPTED
    finally:
        ignore_signals()
        launch.end()
    return status


class Launch:
    """One fleet, from its first process to its last."""

    def __init__(self, scenario: Scenario, directory: RunDirectory, terms: Terms) -> None:
        self.terminal = Terminal(Console())
        self._scenario = scenario
        self._directory = directory
        self._terms = terms
        self._endpoint = f"tcp/127.0.0.1:{_free_port()}"
        self._guard = AccessControl(directory.users, terms.run, scenario.rows)
        self._table = ProcessTable(directory.path, terms.run, self._endpoint)
        self._supervisor = Supervisor(directory.logs, self._child_ended)
        self._zygote, self._zygote_end = MessageSocket.pair()
        self._world, self._world_end = MessageSocket.pair()
        self._doomed: set[tuple[int, int]] = set()
        self._missing: list[str] | None = None
        self._say_missing_at_s = time.monotonic() + PATIENCE_S
        self._landing = False
        self._broken = False
        self._time_s = 0.0

    def fly(self) -> None:
        """Start everybody, and follow the flight until the world has ended.

        Raises :class:`StartError` when somebody does not come up.
        """
        count, name = self._scenario.fleet.agents, self._scenario.name
        self.terminal.say(
            f"{name}: starting netem, the world and {count} agents; logs in {self._directory.logs}"
        )
        self._start()
        while "world" in self._supervisor.pids and not self._broken:
            self._supervisor.turn(LOOK_EVERY_S)
            self._say_who_is_missing()
        self._end_world()

    def interrupt(self) -> None:
        """Let the world finish the recording, and tell the verdict on what there was, if any."""
        self.terminal.say("interrupted: ending the run")
        self._end_world()
        if self._flying or self._directory.summary.exists():
            self.conclude()
        else:
            self._directory.remove_results()
            self.terminal.say(f"interrupted before take-off; logs in {self._directory.logs}")

    def conclude(self) -> int:
        """Tell the verdict from the run's summary; return the exit status."""
        self.terminal.close()
        try:
            summary: Summary = json.loads(self._directory.summary.read_text("utf-8"))
        except FileNotFoundError:
            self.terminal.say(f"no summary was written; {self._last_words('world')}")
            return UNKNOWN
        recorded = self._directory.recording.exists()
        self.terminal.say(verdict(summary, self._directory.path, recorded))
        return EXIT_STATUS[summary["outcome"]]

    def end(self) -> None:
        """End every process that is left."""
        self._landing = True
        self.terminal.close()
        self._zygote.send(end=True)
        mediums = [medium_name(shard) for shard in range(self._terms.shards)]
        self._supervisor.end(["world", *mediums], END_WITHIN_S, signal.SIGTERM)
        self._supervisor.end(["zygote"], END_WITHIN_S, None)
        everybody = list(self._supervisor.pids)
        self._supervisor.end(everybody, END_WITHIN_S, signal.SIGKILL)
        self._directory.users.unlink(missing_ok=True)

    def _end_world(self) -> None:
        self._landing = True
        self._supervisor.end(["world"], LANDING_WITHIN_S, signal.SIGTERM)

    def _start(self) -> None:
        agents = range(self._scenario.fleet.agents)
        self._let_in()
        zygote = self._supervisor.start("zygote", signal.SIGKILL, self._be_zygote)
        self._zygote_end.close()
        mediums = {
            medium_name(shard): self._supervisor.start(
                medium_name(shard), signal.SIGKILL, partial(self._be_netem, shard)
            )
            for shard in range(self._terms.shards)
        }
        # The world is asked to end, so that it finishes the recording even without a launcher.
        world = self._supervisor.start("world", signal.SIGTERM, self._be_world)
        self._world_end.close()
        for name, pid in {"zygote": zygote, **mediums, "world": world}.items():
            self._table.add(name, pid)
        self._supervisor.listen(self._zygote, self._hear_zygote)
        self._supervisor.listen(self._world, self._hear_world)
        self._zygote.send(do="start", whom=[(agent, 0) for agent in agents], after_s=0.0)

    def _let_in(self) -> None:
        try:
            write_users(self._directory.users, self._users())
        except OSError as error:
            self._directory.remove_results()
            raise unwritable(self._directory.users, error) from error

    def _users(self) -> list[str]:
        mediums = [medium_name(shard) for shard in range(self._terms.shards)]
        agents = [agent_name(agent) for agent in range(self._scenario.rows)]
        return ["world", OPERATOR, *mediums, *agents]

    def _be_zygote(self) -> int:
        for end in (self._zygote, self._world, self._world_end):
            end.close()
        terms = self._terms
        logs, users = self._directory.logs, self._directory.users
        brood = Brood(terms.run, self._endpoint, logs, terms.lockstep, users)
        return Zygote(self._zygote_end, brood).serve()

    def _be_netem(self, shard: int) -> int:
        for end in (self._zygote, self._world, self._world_end):
            end.close()
        return netem_process.run(self._endpoint, shard, self._terms.lockstep, self._guard)

    def _be_world(self) -> int:
        for end in (self._zygote, self._world):
            end.close()
        return world_process.run(
            self._endpoint,
            self._scenario,
            lambda: self._directory,
            self._terms,
            lambda _: Conducted(self._world_end),
        )

    def _hear_zygote(self) -> None:
        lines = self._zygote.receive()
        for line in lines:
            if "spawned" in line:
                self._table.add(f"agent-{line['spawned']}", line["pid"])
            elif "exit" in line:
                self._agent_ended(line)
            else:
                self._world.send(**line)
        if not self._landing and any("spawned" in line for line in lines):
            self._table.write()

    def _hear_world(self) -> None:
        for line in self._world.receive():
            if "progress" in line:
                progress = Progress(**line["progress"])
                self._time_s = progress.time_s
                self.terminal.show(progress)
            elif "do" in line:
                self._pass_on(line)
            elif "missing" in line:
                self._missing = line["missing"]
            elif "waiting" in line:
                why = f"waiting for {line['waiting']}{self._table.stopped()}"
                self.terminal.say(f"standing still, {why}")
            else:
                self._landing = True

    def _pass_on(self, line: Line) -> None:
        """Hand what the world wants done to the zygote, which has the agents."""
        if line["do"] == "kill":
            self._doomed.update((agent, incarnation) for agent, incarnation in line["whom"])
        self._table.note(line["do"], line["whom"])
        self._zygote.send(**line)

    def _agent_ended(self, line: Line) -> None:
        # What the world said before an agent could end is there already.
        self._hear_world()
        if self._landing:
            return
        agent, incarnation, *how = line["exit"]
        end = Exit(*how)
        if not self._flying:
            raise self._not_started(f"agent-{agent}", end)
        self._world.send(lost=[agent, incarnation, *end])
        self.terminal.say(
            f"agent-{agent} (pid {line['pid']}) {end} about {self._time_s:.1f} s into the run;"
            f" {self._what_follows(agent, incarnation)}"
        )
        if end.status is not None:
            self.terminal.say(self._last_words(f"agent-{agent}"))

    def _what_follows(self, agent: int, incarnation: int) -> str:
        if (agent, incarnation) in self._doomed:
            return "as planned"
        return "the run ends here" if self._terms.lockstep else "its vehicle hovers"

    def _child_ended(self, name: str, end: Exit) -> None:
        self._hear_world()
        if self._landing:
            return
        if not self._flying:
            raise self._not_started(name, end)
        self.terminal.say(f"{name} {end} about {self._time_s:.1f} s into the run, which ends here")
        self._world.send(broken=f"{name} {end}")
        self._broken = True

    def _say_who_is_missing(self) -> None:
        if self._missing and time.monotonic() > self._say_missing_at_s:
            self._say_missing_at_s = time.monotonic() + PATIENCE_S
            self.terminal.say(f"still waiting for {', '.join(self._missing)}")

    @property
    def _flying(self) -> bool:
        return self._missing == []

    def _not_started(self, name: str, end: Exit) -> StartError:
        return StartError(f"{name} did not start: it {end}; {self._last_words(name)}")

    def _last_words(self, name: str) -> str:
        log = self._directory.logs / f"{name}.log"
        lines = log.read_bytes()[-MAX_TAIL_B:].decode("utf-8", "replace").splitlines()
        if not lines:
            return f"{log} is empty"
        return "\n  ".join([f"{log} ends with:", *lines[-TAIL_LINES:]])


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port
