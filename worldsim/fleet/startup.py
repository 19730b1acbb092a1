"""Before a flight: the medium takes its conditions, each agent its setup, and all report."""

import time
from collections.abc import Callable, Iterable, Mapping

import msgspec
import zenoh

from agent.config import AgentSetup
from netem.messages import MediumSetup
from netem.wire.bus import Bus, Handler, Liveliness, RefusedError, drain
from netem.wire.keys import medium_name
from worldsim.engine.preflight import PROCESS_COMMAND_TICKS, VIRTUAL_COMMAND_TICKS
from worldsim.fleet.launcher_link import LauncherLink
from worldsim.scenario.tables import SLOTS_PER_TICK, Scenario

STARTUP_WITHIN_S = 30.0
LOOK_EVERY_S = 0.02
QUESTIONS_AT_ONCE = 64


class StartupError(RuntimeError):
    """Not everybody came; the text says who is missing."""


class Startup:
    """Answers agents that ask for their setup, at the start and late; knows who is there.

    lockstep: whether they take turns; shards: how many mediums share the agents out.
    """

    def __init__(
        self, bus: Bus, scenario: Scenario, lockstep: bool = False, shards: int = 1
    ) -> None:
        self._bus = bus
        self._scenario = scenario
        self._lockstep = lockstep
        self._shards = shards
        self._uninstructed = list(range(shards))
        self._incarnations = dict.fromkeys(range(scenario.fleet.agents), 0)
        self._liveliness: Liveliness = bus.liveliness()
        self._questions: Handler[zenoh.Query] = bus.queryable("setup")

    def instruct_medium(self, speed: float) -> bool:
        """Tell each medium its conditions; False while one is missing.

        Raises RefusedError when one serves another run.
        """
        while self._uninstructed:
            shard = self._uninstructed[0]
            question = msgspec.json.encode(self._medium_setup(shard, speed))
            topic, who = ("shard", shard) if shard else ("medium", None)
            if self._bus.query(topic, who, question, timeout_s=2.0) is None:
                return False
            self._uninstructed.pop(0)
        return True

    def instruct_agents(self) -> None:
        """Answer the agents that ask."""
        for query in drain(self._questions, QUESTIONS_AT_ONCE):
            with query:
                self._answer(query)

    def missing(self) -> list[str]:
        """Return the names of those who have not come."""
        self._liveliness.departed()
        agents = range(self._scenario.fleet.agents)
        mediums = [medium_name(shard) for shard in range(self._shards)]
        wanted = [*mediums, *(f"agent-{agent}" for agent in agents)]
        return [name for name in wanted if name not in self._liveliness.alive]

    def expect(self, incarnations: Mapping[int, int]) -> None:
        """Let agents come, too, or again: each with its incarnation."""
        self._incarnations.update(incarnations)

    def absent(self, agents: Iterable[int]) -> list[int]:
        """Return which of these agents show no sign of life."""
        self._liveliness.departed()
        return [agent for agent in agents if f"agent-{agent}" not in self._liveliness.alive]

    def present(self, agents: Iterable[int]) -> list[int]:
        """Return which of these agents show a sign of life."""
        absent = self.absent(agents := list(agents))
        return [agent for agent in agents if agent not in absent]

    def gone(self) -> list[str]:
        """Return who went since the last call, as liveliness has it: a hint."""
        return self._liveliness.departed()

    def _medium_setup(self, shard: int, speed: float) -> MediumSetup:
        rows = range(self._scenario.rows)
        # By fours: so each medium has some of those who step in a slot.
        own = tuple(a for a in rows if a // SLOTS_PER_TICK % self._shards == shard)
        setup: MediumSetup = msgspec.structs.replace(
            self._scenario.medium_setup(),
            speed=speed,
            lockstep=self._lockstep,
            receivers=own if self._shards > 1 else None,
        )
        return setup

    def _answer(self, query: zenoh.Query) -> None:
        agent = str(query.key_expr).rsplit("/", 1)[1]
        incarnation = self._incarnations.get(int(agent)) if agent.isdecimal() else None
        if incarnation is None:
            query.reply_err(f"no agent {agent} in a run of {len(self._incarnations)}")
            return
        ticks = VIRTUAL_COMMAND_TICKS if self._lockstep else PROCESS_COMMAND_TICKS
        setup: AgentSetup = msgspec.structs.replace(
            self._scenario.agent_setup(int(agent), incarnation, ticks), lockstep=self._lockstep
        )
        query.reply(query.key_expr, msgspec.json.encode(setup))


def assemble(
    startup: Startup, speed: float, unwanted: Callable[[], bool], launcher: LauncherLink
) -> bool:
    """Wait until everybody is there; False when ``unwanted`` says that it is for nothing.

    Raises :class:`MusterError` after STARTUP_WITHIN_S, and when the medium refuses.
    """
    deadline = time.monotonic() + STARTUP_WITHIN_S
    missing: list[str] | None = None
    instructed = False
    while not unwanted():
        try:
            instructed = instructed or startup.instruct_medium(speed)
        except RefusedError as error:
            raise StartupError(f"netem refuses: {error}") from error
        startup.instruct_agents()
        before, missing = missing, startup.missing()
        if missing != before:
            launcher.missing(shortened(missing))
        if not missing:
            return True
        if time.monotonic() > deadline:
            raise StartupError(
                f"not there within {STARTUP_WITHIN_S:g} s: {', '.join(shortened(missing))}"
            )
        time.sleep(LOOK_EVERY_S)
    return False


def shortened(names: list[str], most: int = 5) -> list[str]:
    """Return a few names, and how many more there are."""
    more = len(names) - most
    return names if more <= 0 else [*names[:most], f"{more} more"]
