"""Who may put and hear what in a run: a password each, and nobody hears a radio but its own.

The router lets each name do what is its own, and drops everything else without a word. On a host
where everybody may read everybody's files that is a fence against mistakes, not against malice.
"""

import os
import secrets
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

from netem.wire.frame import MAX_TRANSMISSION_B
from netem.wire.keys import EVERY_KEY, Keys, agent_name
from netem.wire.latency import MAX_ARRIVALS_B

OPERATOR = "operator"
MOST_B = {"tx": MAX_TRANSMISSION_B, "command": 4096, "arrivals": MAX_ARRIVALS_B}
"""Of what an agent says, what is larger goes no further than the router."""
HEARS = ("observation", "rx")
"""Topics of which each agent has its own, and puts to the ones and gets the others."""
ALL = [
    *("put", "delete", "declare_subscriber", "query", "reply", "declare_queryable"),
    *("liveliness_token", "liveliness_query", "declare_liveliness_subscriber"),
]
INGRESS, EGRESS = ["ingress"], ["egress"]
"""From a user to the router, and from the router to a user."""
BOTH = INGRESS + EGRESS
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
        rules = [_rule("everything", [EVERY_KEY], ALL, BOTH)]
        policies = [{"rules": ["everything"], "subjects": others}] if others else []
        allowed = {user: _asking(user, [keys.of("control")]) for user in asking}
        allowed |= {name: _flying(name, keys, agent) for agent, name in enumerate(agents)}
        for user, own in allowed.items():
            rules += own
            policies.append({"rules": [rule["id"] for rule in own], "subjects": [user]})
        return {
            "enabled": True,
            "default_permission": "deny",
            "rules": rules,
            "subjects": [{"id": user, "usernames": [user]} for user in (*agents, *asking, *others)],
            "policies": policies,
        }


def size_limits() -> list[Rule]:
    """Return Zenoh's filters by size: how long a message on a topic of an agent's may be [B]."""
    return [
        {
            "id": f"size of {topic}",
            "flows": INGRESS,
            "messages": ["put"],
            "key_exprs": [Keys.any_run(topic, "*")],
            "size_limit": most_b,
        }
        for topic, most_b in MOST_B.items()
    ]


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


def _flying(name: str, keys: Keys, agent: int) -> list[Rule]:
    """Return what one agent may: say and hear what is its own, show its life, ask for its setup."""
    said = [keys.of(topic, agent) for topic in MOST_B]
    heard = [keys.of("over"), *(keys.of(topic, agent) for topic in HEARS)]
    return [
        _rule(f"{name} says", said, ["put"], INGRESS),
        _rule(f"{name} is heard", said, ["declare_subscriber"], EGRESS),
        _rule(f"{name} listens", heard, ["declare_subscriber"], INGRESS),
        _rule(f"{name} hears", heard, ["put"], EGRESS),
        _rule(f"{name} lives", [keys.of("alive", name)], ["liveliness_token"], INGRESS),
        *_asking(name, [keys.of("setup", agent)]),
    ]


def _asking(user: str, questions: list[str]) -> list[Rule]:
    """Return what lets a user ask, and be answered."""
    return [
        _rule(f"{user} asks", questions, ["query"], INGRESS),
        _rule(f"{user} is answered", questions, ["reply", "declare_queryable"], EGRESS),
    ]


def _rule(name: str, key_exprs: list[str], messages: list[str], flows: list[str]) -> Rule:
    return {
        "id": name,
        "permission": "allow",
        "flows": flows,
        "messages": messages,
        "key_exprs": key_exprs,
    }
