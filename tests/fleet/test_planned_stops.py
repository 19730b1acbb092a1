"""Planned stops on real children: each is struck, named as planned, and the world is woken."""

import os
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from worldsim.fleet.fork import ProcessExit
from worldsim.fleet.ipc import OtherProcessRequest, WorldWoken, world_sockets
from worldsim.fleet.planned_stops import PlannedKill, PlannedStops
from worldsim.fleet.process_table import ProcessTable
from worldsim.fleet.supervisor import Supervisor


class Fleet:
    """A supervisor with two mediums and a world that only wait."""

    def __init__(self, folder: Path) -> None:
        self.exits: list[tuple[str, ProcessExit]] = []
        self.supervisor = Supervisor(folder, lambda *each: self.exits.append(each))
        self.launcher_end, self.world_end = world_sockets()
        table = ProcessTable(folder, "mine", "tcp/127.0.0.1:7447")
        self.mediums = ["netem", "netem-1"]
        self.stops = PlannedStops(
            self.supervisor, table, self.launcher_end, self.mediums, self.start_medium
        )
        for name in (*self.mediums, "world"):
            self.start(name)

    def start(self, name: str) -> None:
        self.supervisor.start(name, signal.SIGKILL, wait_for_signals)

    def start_medium(self, shard: int) -> None:
        self.start(self.mediums[shard])

    def state(self, name: str) -> str:
        stat = Path(f"/proc/{self.supervisor.pids[name]}/stat").read_text("ascii")
        return stat.rpartition(")")[2].split()[0]

    def poll_until(self, condition: Callable[[], bool]) -> None:
        deadline = time.monotonic() + 5.0
        while not condition():
            assert time.monotonic() < deadline
            self.supervisor.poll(self.stops.seconds_left(0.05))
            self.stops.wake_world()

    def ask(self, process: str, action: str, for_s: float = 0.0) -> None:
        request: Any = (process, action, for_s, "operator")
        self.stops.carry_out(OtherProcessRequest(*request))


def wait_for_signals() -> int:
    while True:
        signal.pause()


@pytest.fixture
def fleet(tmp_path: Path) -> Iterator[Fleet]:
    made = Fleet(tmp_path)
    yield made
    made.supervisor.end(list(made.supervisor.pids), 5.0, signal.SIGKILL)
    made.launcher_end.close()
    made.world_end.close()


def test_a_kill_of_netem_is_of_every_shard_and_each_is_started_anew(fleet: Fleet) -> None:
    before = dict(fleet.supervisor.pids)
    fleet.ask("netem", "kill")
    fleet.ask("netem", "start")  # before the exits are seen
    fleet.poll_until(lambda: len(fleet.exits) == 2)
    assert sorted(fleet.exits) == [(name, ProcessExit(9, None)) for name in fleet.mediums]
    planned = [fleet.stops.take_kill(name) for name in (*fleet.mediums, "world")]
    assert planned == [PlannedKill("operator"), PlannedKill("operator"), None]
    assert fleet.stops.take_kill(fleet.mediums[0]) is None, "the next exit is not planned"
    for name in fleet.mediums:
        assert fleet.supervisor.pids[name] != before[name]
        assert fleet.state(name) in "RS"


def test_netem_stops_and_goes_on(fleet: Fleet) -> None:
    fleet.ask("netem", "pause")
    assert [fleet.state(name) for name in fleet.mediums] == ["T", "T"]
    fleet.ask("netem", "resume")
    assert all(fleet.state(name) in "RS" for name in fleet.mediums)


def test_the_world_is_woken_when_its_time_is_over(fleet: Fleet) -> None:
    began_s = time.monotonic()
    fleet.ask("world", "pause", 0.3)
    assert fleet.state("world") == "T"
    assert fleet.stops.seconds_left(1.0) <= 0.3
    fleet.stops.wake_world()
    assert fleet.world_end.receive() == [], "not before its time"
    fleet.poll_until(lambda: fleet.state("world") != "T")
    assert time.monotonic() - began_s >= 0.3
    assert fleet.world_end.receive() == [WorldWoken()]
    assert fleet.stops.seconds_left(1.0) == 1.0


def test_a_world_that_died_in_its_pause_is_not_woken(fleet: Fleet) -> None:
    fleet.ask("world", "pause", 0.05)
    os.kill(fleet.supervisor.pids["world"], signal.SIGKILL)
    fleet.poll_until(lambda: bool(fleet.exits))
    fleet.poll_until(lambda: fleet.stops.seconds_left(1.0) == 1.0)
    assert fleet.exits == [("world", ProcessExit(9, None))]
    assert fleet.stops.take_kill("world") is None


def test_a_stopped_child_ends_when_it_is_asked_to(fleet: Fleet) -> None:
    fleet.ask("netem", "pause")
    assert fleet.supervisor.end(fleet.mediums, 2.0, signal.SIGTERM)
