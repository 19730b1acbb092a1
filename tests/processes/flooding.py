"""Floods all topics that one agent may write to, with that agent's password.

    python -m tests.processes.flooding RUN AGENT SECONDS [forged]

It sends junk, old messages, and messages of other incarnations and of future slots; with ``forged``
also messages of the current slot, as an attacker who has taken the agent over can.
"""

import sys
import threading
import time
from itertools import cycle
from pathlib import Path
from random import Random

import zenoh

from agent.codec import decode_observation
from netem.wire.access import login_of
from netem.wire.bus import Bus, Put
from netem.wire.keys import Keys
from netem.wire.session import open_client
from worldsim.fleet.intruder import MAKERS, mixed
from worldsim.fleet.process_table import read_fleet
from worldsim.results.run_folder import USERS

RATE_HZ = 10_000
BURST_S = 0.005


def flood(run: Path, agent: int, seconds: float, forged: bool) -> dict[str, int]:
    """Flood for some seconds; return how many messages were put on each topic."""
    fleet, login = read_fleet(run), login_of(run / USERS, f"agent-{agent}")
    with open_client(fleet.endpoint, login=login) as session:
        bus, random = Bus(session, Keys(fleet.run)), Random(1)
        puts = [
            (bus.publisher(topic, agent), cycle(mixed(make, random)))
            for topic, make in MAKERS.items()
        ]
        observations = bus.subscriber("observation", agent)
        begun, sent, pause = time.monotonic(), 0, threading.Event()
        while (now_s := time.monotonic() - begun) < seconds:
            for put, messages in puts:
                _burst(put, messages, int(now_s * RATE_HZ) - sent)
            sent = int(now_s * RATE_HZ)
            if forged:
                _forge(bus, agent, observations.drain(1))
            pause.wait(BURST_S)
    return dict.fromkeys(MAKERS, sent)


def _burst(put: Put, messages: "cycle[bytes]", count: int) -> None:
    for _ in range(count):
        put(next(messages))


def _forge(bus: Bus, agent: int, observed: list[bytes]) -> None:
    for data in observed:
        slot = decode_observation(data).slot
        for topic, make in MAKERS.items():
            bus.publisher(topic, agent)(make(slot, 0))


def main() -> None:
    run, agent, seconds, *forged = sys.argv[1:]
    print("flooding", flush=True)
    print(flood(Path(run), int(agent), float(seconds), forged == ["forged"]), flush=True)


if __name__ == "__main__":
    zenoh.init_log_from_env_or("error")
    main()
