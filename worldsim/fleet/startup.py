"""The start of a run: netem gets its conditions, each agent its setup, and all must be present."""

import time
from collections.abc import Callable, Iterable, Mapping

import msgspec
import zenoh

from agent.config import AgentSetup
from netem.messages import MediumSetup, Resumption
from netem.wire.bus import Bus, Handler, Liveliness, PendingQuery, RefusedError, drain
from netem.wire.keys import agent_name, medium_name
from worldsim.engine.preflight import PROCESS_COMMAND_TICKS, VIRTUAL_COMMAND_TICKS
from worldsim.fleet.launcher_link import LauncherLink
from worldsim.scenario.tables import SLOTS_PER_TICK, Scenario

STARTUP_WITHIN_S = 30.0
POLL_S = 0.02
REQUESTS_PER_POLL = 64


class StartupError(RuntimeError):
    """A start that failed; the text names the missing processes, or netem's reason to refuse."""


class Startup:
    """Configures netem and the agents, at the start and later; tells which are present.

    shards: the number of mediums that share the agents. Presence is Zenoh's liveliness: a hint,
    not a proof.
    """

    def __init__(
        self, bus: Bus, scenario: Scenario, lockstep: bool = False, shards: int = 1
    ) -> None:
        self._bus = bus
        self._scenario = scenario
        self._lockstep = lockstep
        self._shards = shards
        self._unconfigured = list(range(shards))
        self._incarnations = dict.fromkeys(range(scenario.fleet.agents), 0)
        self._liveliness: Liveliness = bus.liveliness()
        self._requests: Handler[zenoh.Query] = bus.queryable("setup")

    def configure_mediums(self, speed: float) -> bool:
        """Send each medium its conditions; return False while one does not answer.

        Raises RefusedError when a medium serves another run.
        """
        while self._unconfigured:
            shard = self._unconfigured[0]
            setup = msgspec.json.encode(self._medium_setup(shard, speed))
            topic, number = ("shard", shard) if shard else ("medium", None)
            if self._bus.query(topic, number, setup, timeout_s=2.0) is None:
                return False
            self._unconfigured.pop(0)
        return True

    def resume_medium(self, speed: float, resumption: Resumption) -> PendingQuery:
        """Send the only medium of a run, whose process is new, what it needs to go on."""
        setup = msgspec.structs.replace(self._medium_setup(0, speed), resumes=resumption)
        return self._bus.begin_query("medium", msgspec.json.encode(setup), timeout_s=2.0)

    def answer_setup_requests(self) -> None:
        """Send their setups to the agents that have asked for them."""
        for query in drain(self._requests, REQUESTS_PER_POLL):
            with query:
                self._answer(query)

    def missing(self) -> list[str]:
        """Return the names of the processes of the start that are not present."""
        self._liveliness.departed()
        mediums = [medium_name(shard) for shard in range(self._shards)]
        agents = [agent_name(agent) for agent in range(self._scenario.fleet.agents)]
        return [name for name in [*mediums, *agents] if name not in self._liveliness.alive]

    def expect(self, incarnations: Mapping[int, int]) -> None:
        """Accept agents that join or restart, each with its incarnation."""
        self._incarnations.update(incarnations)

    def absent(self, agents: Iterable[int]) -> list[int]:
        """Return those of some agents that are not present."""
        self._liveliness.departed()
        return [agent for agent in agents if agent_name(agent) not in self._liveliness.alive]

    def present(self, agents: Iterable[int]) -> list[int]:
        """Return those of some agents that are present."""
        absent = self.absent(agents := list(agents))
        return [agent for agent in agents if agent not in absent]

    def vanished(self) -> list[str]:
        """Return the names of the processes that vanished since the last call."""
        return self._liveliness.departed()

    def _medium_setup(self, shard: int, speed: float) -> MediumSetup:
        rows = range(self._scenario.rows)
        # Blocks of four agents, so that each medium has agents of every slot of a tick.
        receivers = tuple(a for a in rows if a // SLOTS_PER_TICK % self._shards == shard)
        setup: MediumSetup = msgspec.structs.replace(
            self._scenario.medium_setup(),
            speed=speed,
            lockstep=self._lockstep,
            receivers=receivers if self._shards > 1 else None,
        )
        return setup

    def _answer(self, query: zenoh.Query) -> None:
        agent = str(query.key_expr).rsplit("/", 1)[1]
        incarnation = self._incarnations.get(int(agent)) if agent.isdecimal() else None
        if incarnation is None:
            query.reply_err(f"no agent {agent} in a run of {len(self._incarnations)} agents")
            return
        ticks = VIRTUAL_COMMAND_TICKS if self._lockstep else PROCESS_COMMAND_TICKS
        setup: AgentSetup = msgspec.structs.replace(
            self._scenario.agent_setup(int(agent), incarnation, ticks),
            lockstep=self._lockstep,
            real_time=not self._lockstep,
        )
        query.reply(query.key_expr, msgspec.json.encode(setup))


def assemble(
    startup: Startup, speed: float, should_stop: Callable[[], bool], launcher: LauncherLink
) -> bool:
    """Wait until all processes are present; return False when ``should_stop`` says so first.

    Raises StartupError after STARTUP_WITHIN_S, and when a medium refuses the run.
    """
    deadline = time.monotonic() + STARTUP_WITHIN_S
    missing: list[str] | None = None
    configured = False
    while not should_stop():
        try:
            configured = configured or startup.configure_mediums(speed)
        except RefusedError as error:
            raise StartupError(f"netem refused the run: {error}") from error
        startup.answer_setup_requests()
        before, missing = missing, startup.missing()
        if missing != before:
            launcher.report_missing(shortened(missing))
        if not missing:
            return True
        if time.monotonic() > deadline:
            names = ", ".join(shortened(missing))
            raise StartupError(f"not started within {STARTUP_WITHIN_S:g} s: {names}")
        time.sleep(POLL_S)
    return False


def shortened(names: list[str], most: int = 5) -> list[str]:
    """Return the first few names, and how many more there are."""
    more = len(names) - most
    return names if more <= 0 else [*names[:most], f"{more} more"]
