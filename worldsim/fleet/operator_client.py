"""An operator's side: a request to the world of a running fleet, found by the run's folder."""

from pathlib import Path

import msgspec

from netem.wire.access import OPERATOR, AccessError, Login, login_of
from netem.wire.bus import Bus, RefusedError
from netem.wire.keys import Keys
from netem.wire.session import SessionError, open_client
from worldsim.fleet.control import Answer, Request
from worldsim.fleet.process_table import OperatorError, fleet_of
from worldsim.results.run_folder import USERS

OPEN_WITHIN_S = 3.0
ANSWER_WITHIN_S = 10.0


def ask(run: Path, request: Request) -> Answer:
    """Return what the world made of a request.

    Raises OperatorError when it refuses or does not answer, RunDirectoryError without a fleet.
    """
    fleet = fleet_of(run)
    if not any(row.alive for row in fleet.processes if row.name == "world"):
        raise OperatorError(f"{run}: its fleet flies no more")
    try:
        with open_client(fleet.endpoint, OPEN_WITHIN_S, login=_login(run)) as session:
            bus = Bus(session, Keys(fleet.run))
            told = bus.query("control", None, msgspec.json.encode(request), ANSWER_WITHIN_S)
    except (AccessError, SessionError) as error:
        raise OperatorError(f"{run}: {error}") from error
    except RefusedError as refusal:
        raise OperatorError(f"{run}: refused: {refusal}") from refusal
    if told is None:
        raise OperatorError(f"{run}: its world does not answer; it has not taken off, or landed")
    return msgspec.json.decode(told, type=Answer)


def _login(run: Path) -> Login | None:
    """Return the operator's login; None for a fleet that was started by hand, without a guard."""
    users = run / USERS
    return login_of(users, OPERATOR) if users.exists() else None
