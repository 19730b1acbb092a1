"""Who may put and hear what in a run: a password each, and nobody hears a radio but its own.

The router lets each name do what is its own, and drops everything else without a word. On a host
where everybody may read everybody's files that is a fence against mistakes, not against malice.
"""

import os
import secrets
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

from netem.wire.keys import EVERY_KEY, Keys, agent_name

OPERATOR = "operator"
OWN = ("observation", "rx", "tx", "command", "setup")
"""Topics of which each agent has its own."""
ALL = [
    *("put", "delete", "declare_subscriber", "query", "reply", "declare_queryable"),
    *("liveliness_token", "liveliness_query", "declare_liveliness_subscriber"),
]
BOTH = ["ingress", "egress"]
Rule = dict[str, Any]


class AccessError(RuntimeError):
    """A file of passwords that cannot be used; the text says why in one line."""


class Login(NamedTuple):
    """A name and its password."""

    user: str
    password: str


class Guard(NamedTuple):
    """What a router goes by: the file of passwords, the run, and how many agents it has."""

    users: Path
    run: str
    agents: int

    def login(self, user: str) -> Login:
        """Return a user's login. Raises AccessError where the file has none."""
        return login_of(self.users, user)

    def config(self) -> dict[str, Any]:
        """Return Zenoh's access control: what is not allowed is denied."""
        keys = Keys(self.run)
        agents = [agent_name(agent) for agent in range(self.agents)]
        asking = [user for user in _passwords(self.users) if user == OPERATOR]
        others = [user for user in _passwords(self.users) if user not in (*agents, OPERATOR)]
        over = [keys.of("over")]
        rules = [
            _rule("hear over", over, ["put"]) | {"flows": ["egress"]},
            _rule("listen to over", over, ["declare_subscriber"]) | {"flows": ["ingress"]},
            _rule("everything", [EVERY_KEY], ALL),
            _rule("ask", [keys.of("control")], ["query"]) | {"flows": ["ingress"]},
            _rule("answer", [keys.of("control")], ["reply", "declare_queryable"])
            | {"flows": ["egress"]},
        ]
        rules += [_rule(name, _own(keys, agent), ALL) for agent, name in enumerate(agents)]
        policies = [{"rules": ["everything"], "subjects": others}] if others else []
        policies += [{"rules": ["ask", "answer"], "subjects": [user]} for user in asking]
        policies += [
            {"rules": ["hear over", "listen to over", name], "subjects": [name]} for name in agents
        ]
        return {
            "enabled": True,
            "default_permission": "deny",
            "rules": rules,
            "subjects": [{"id": user, "usernames": [user]} for user in (*agents, *asking, *others)],
            "policies": policies,
        }


def write_users(path: Path, users: Iterable[str]) -> None:
    """Write a new file of passwords, for its owner alone. Raises OSError."""
    lines = [f"{user}:{secrets.token_urlsafe(16)}\n" for user in users]
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(descriptor, "w", encoding="ascii") as file:
        file.writelines(lines)


def login_of(path: Path, user: str) -> Login:
    """Return a user's login from a file of passwords. Raises AccessError where it has none."""
    password = _passwords(path).get(user)
    if password is None:
        raise AccessError(f"{path}: no password of {user}")
    return Login(user, password)


def _passwords(path: Path) -> dict[str, str]:
    try:
        lines = path.read_text(encoding="ascii").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise AccessError(f"{path}: cannot be read") from error
    return {user: password for user, _, password in (line.partition(":") for line in lines)}


def _own(keys: Keys, agent: int) -> list[str]:
    return [*(keys.of(topic, agent) for topic in OWN), keys.of("alive", agent_name(agent))]


def _rule(name: str, key_exprs: list[str], messages: list[str]) -> Rule:
    return {
        "id": name,
        "permission": "allow",
        "flows": BOTH,
        "messages": messages,
        "key_exprs": key_exprs,
    }
