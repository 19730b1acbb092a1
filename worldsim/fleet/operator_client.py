"""The operator's side of control: sends a request to a running fleet's world.

The fleet is found by its run's folder.
"""

from pathlib import Path

import msgspec

from netem.wire.access import OPERATOR, AccessError, Login, login_of
from netem.wire.bus import Bus, RefusedError
from netem.wire.keys import Keys
from netem.wire.session import SessionError, open_client
from worldsim.fleet.control import Answer, Request
from worldsim.fleet.local_socket import LocalRefusalError, ask_locally
from worldsim.fleet.process_table import Fleet, OperatorError, read_fleet
from worldsim.results.run_folder import USERS

OPEN_WITHIN_S = 3.0
ANSWER_WITHIN_S = 10.0


def ask(run: Path, request: Request) -> Answer:
    """Return the world's answer to a request.

    Raises OperatorError when the world refuses or does not answer, RunDirectoryError when the
    folder has no valid fleet.json.
    """
    fleet = read_fleet(run)
    worlds = [row.pid for row in fleet.processes if row.name == "world" and row.alive]
    if not worlds:
        raise OperatorError(f"{run}: the run has ended")
    try:
        reply = _asked(run, fleet, worlds[0], msgspec.json.encode(request))
    except (AccessError, SessionError) as error:
        raise OperatorError(f"{run}: {error}") from error
    except (LocalRefusalError, RefusedError) as refusal:
        raise OperatorError(f"{run}: refused: {refusal}") from refusal
    if reply is None:
        raise OperatorError(
            f"{run}: the world does not answer; the fleet has not started yet, or the run has ended"
        )
    return msgspec.json.decode(reply, type=Answer)


def _asked(run: Path, fleet: Fleet, world: int, request: bytes) -> bytes | None:
    """Return the answer of the world with a pid, or None without one.

    By the local socket, as netem may be down; by the router where no such socket is within reach.
    """
    try:
        return ask_locally(world, request, ANSWER_WITHIN_S)
    except ConnectionRefusedError:
        with open_client(fleet.endpoint, OPEN_WITHIN_S, login=_login(run)) as session:
            bus = Bus(session, Keys(fleet.run))
            return bus.query("control", None, request, ANSWER_WITHIN_S)


def _login(run: Path) -> Login | None:
    """Return the operator's login; None for a fleet started by hand, which has no passwords."""
    users = run / USERS
    return login_of(users, OPERATOR) if users.exists() else None
