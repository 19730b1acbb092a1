"""Zenoh sessions: one router on a host, and every other process its client.

No peers are discovered, no endpoint is opened that was not named, and message sizes are bounded.
"""

import ipaddress
import json
import os
import re
from typing import Any

import zenoh

from netem.wire.access import AccessControl, Login, size_limits
from netem.wire.connections import HANDSHAKE_WITHIN_S, MAX_PENDING, MAX_SESSIONS

OPEN_TIMEOUT_S = 8.0
MAX_MESSAGE_B = 4 * 1024 * 1024
LEASE_S = 24 * 3600
"""Lease of a session: a process that is paused sends no keep-alives for so long. A process that has
ended closes its socket, which is noticed at once. Where the lease of a paused one runs out, Zenoh's
router waits for room in its full socket, and forwards nothing to anybody until it continues."""

_RUNTIMES = ("acc", "net", "rx", "tx")
"""What Zenoh calls its groups of threads, beside that of the application."""
ROUTER_THREADS = "(rx: (worker_threads: 1))"
"""One receiving thread is enough, and saves a tenth of the CPU time."""
CLIENT_THREADS = "({})".format(", ".join(f"{each}: (handover: app)" for each in _RUNTIMES))
"""A client's one thread reads, writes and watches its only socket: no thread has to wake another.
A router needs several: it waits for room in a queue that another thread empties."""

_ENDPOINT = re.compile(r"(?P<protocol>[a-z][a-z-]*)/(?P<address>.+)")
_IN_USE = re.compile(r"in use|lock", re.IGNORECASE)


class SessionError(RuntimeError):
    """A session could not be opened; the text says why in one line."""


def open_router(listen: str, access: AccessControl | None = None) -> zenoh.Session:
    """Open this host's router at ``listen``, for example ``tcp/127.0.0.1:7447``.

    access: None allows every process everything. Raises :class:`SessionError` when the endpoint is
    malformed, not loopback or in use.
    """
    _refuse_all_but_loopback(listen)
    try:
        return _open(router_config(listen, access), ROUTER_THREADS)
    except zenoh.ZError as error:
        raise SessionError(f"{listen}: {_cause(error)}") from error


def open_client(
    connect: str,
    timeout_s: float = OPEN_TIMEOUT_S,
    login: Login | None = None,
) -> zenoh.Session:
    """Open a client of the router at ``connect``; later the client reconnects by itself.

    login: for a router with access control. Raises :class:`SessionError` when no router answers
    within ``timeout_s`` [s].
    """
    _address(connect)
    try:
        return _open(client_config(connect, timeout_s, login), CLIENT_THREADS)
    except zenoh.ZError as error:
        raise SessionError(f"no router answers at {connect} within {timeout_s:g} s") from error


def _open(config: zenoh.Config, threads: str) -> zenoh.Session:
    """Open a session. Raises ZError, and SessionError where Zenoh itself breaks down.

    threads: only those of a process's first session count.
    """
    # A value of the user's own that Zenoh does not understand would end the process.
    os.environ["ZENOH_RUNTIME"] = threads
    try:
        return zenoh.open(config)
    except BaseException as error:
        # Rust's panics are a class of its own that cannot be imported.
        if type(error).__name__ != "PanicException":
            raise
        raise SessionError(f"Zenoh cannot start: {' '.join(str(error).split())}") from error


def router_config(listen: str, access: AccessControl | None = None) -> zenoh.Config:
    """Return the configuration of a router that listens at one endpoint."""
    router: dict[str, Any] = {
        "mode": "router",
        "listen": {"endpoints": [listen]},
        "low_pass_filter": size_limits(),
    }
    limits = {
        "max_sessions": MAX_SESSIONS,
        "accept_pending": MAX_PENDING,
        "accept_timeout": round(1000 * HANDSHAKE_WITHIN_S),
    }
    if access is None:
        return _config(router, {}, limits)
    # Zenoh wants a user name of a router, too, though the router connects to nothing.
    passwords = {"user": "router", "password": "", "dictionary_file": str(access.users)}
    own = router | {"access_control": access.config()}
    return _config(own, passwords, limits)


def client_config(connect: str, timeout_s: float, login: Login | None = None) -> zenoh.Config:
    """Return the configuration of a client, which listens at no endpoint."""
    retry = {"period_init_ms": 50, "period_max_ms": 500, "period_increase_factor": 2}
    return _config(
        {
            "mode": "client",
            "listen": {"endpoints": []},
            "connect": {
                "endpoints": [connect],
                "timeout_ms": round(timeout_s * 1000),
                "exit_on_failure": True,
                "retry": retry,
            },
        },
        login._asdict() if login is not None else {},
    )


def _config(
    own: dict[str, Any],
    passwords: dict[str, str],
    limits: dict[str, int] | None = None,
) -> zenoh.Config:
    link = {"rx": {"max_message_size": MAX_MESSAGE_B}, "tx": {"lease": LEASE_S * 1000}}
    common = {
        "scouting": {"delay": 0, "multicast": {"enabled": False}, "gossip": {"enabled": False}},
        "adminspace": {"enabled": False},
        "transport": {
            "link": link,
            "shared_memory": {"enabled": False},
            **({"unicast": limits} if limits else {}),
            **({"auth": {"usrpwd": passwords}} if passwords else {}),
        },
    }
    return zenoh.Config.from_json5(json.dumps(common | own))


def _address(endpoint: str) -> tuple[str, str]:
    match = _ENDPOINT.fullmatch(endpoint)
    if match is None:
        raise SessionError(f"{endpoint!r}: not an endpoint, for example tcp/127.0.0.1:7447")
    return match["protocol"], match["address"]


def _refuse_all_but_loopback(endpoint: str) -> None:
    protocol, address = _address(endpoint)
    if protocol == "unixsock-stream":
        return
    host, colon, port = address.rpartition(":")
    if not colon or not port.isdecimal() or not int(port) < 2**16:
        raise SessionError(f"{endpoint}: the port is missing or wrong; 0 to 65535 are allowed")
    if not _is_loopback(host.strip("[]")):
        raise SessionError(
            f"{endpoint}: not a loopback address; 127.0.0.1, [::1] and localhost are allowed"
        )


def _is_loopback(host: str) -> bool:
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def _cause(error: zenoh.ZError) -> str:
    text = str(error)
    if _IN_USE.search(text):
        return "the port is in use"
    # Zenoh appends the place in its own source, which does not help a user.
    return re.sub(r" at /\S+\.rs:\d+\.?", "", text).splitlines()[0]
