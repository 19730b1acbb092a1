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
from worldsim.fleet.process_table import OperatorError, read_fleet
from worldsim.results.run_folder import USERS

OPEN_WITHIN_S = 3.0
ANSWER_WITHIN_S = 10.0


def ask(run: Path, request: Request) -> Answer:
    """Return the world's answer to a request.

    Raises OperatorError when the world refuses or does not answer, RunDirectoryError when the
    folder has no valid fleet.json.
    """
    fleet = read_fleet(run)
    if not any(row.alive for row in fleet.processes if row.name == "world"):
        raise OperatorError(f"{run}: the run has ended")
    try:
        with open_client(fleet.endpoint, OPEN_WITHIN_S, login=_login(run)) as session:
            bus = Bus(session, Keys(fleet.run))
            reply = bus.query("control", None, msgspec.json.encode(request), ANSWER_WITHIN_S)
    except (AccessError, SessionError) as error:
        raise OperatorError(f"{run}: {error}") from error
    except RefusedError as refusal:
        raise OperatorError(f"{run}: refused: {refusal}") from refusal
    if reply is None:
        raise OperatorError(
            f"{run}: the world does not answer; the fleet has not started yet, or the run has ended"
        )
    return msgspec.json.decode(reply, type=Answer)


def _login(run: Path) -> Login | None:
    """Return the operator's login; None for a fleet started by hand, which has no passwords."""
    users = run / USERS
    return login_of(users, OPERATOR) if users.exists() else None
