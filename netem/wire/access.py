"""Access control of a run: a password for each process, and rules for what it may put and get.

An agent gets its own radio's messages only. The router drops everything that is not allowed,
without an error. On a host where all users can read all files this protects against mistakes, not
against attacks.
"""

import os
import secrets
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

from netem.wire.frame import MAX_TRANSMISSION_B
from netem.wire.keys import EVERY_KEY, Keys, agent_name
from netem.wire.latency import MAX_REPORT_B

OPERATOR = "operator"
MAX_AGENT_PUT_B = {"tx": MAX_TRANSMISSION_B, "command": 4096, "arrivals": MAX_REPORT_B}
"""Topics that agents put, and the longest message on each [B]; the router drops longer ones."""
AGENT_GETS = ("observation", "rx")
"""Topics with one key for each agent, which only that agent gets."""
ALL_MESSAGES = [
    *("put", "delete", "declare_subscriber", "query", "reply", "declare_queryable"),
    *("liveliness_token", "liveliness_query", "declare_liveliness_subscriber"),
]
INGRESS, EGRESS = ["ingress"], ["egress"]
"""From a user to the router, and from the router to a user."""
BOTH = INGRESS + EGRESS
Rule = dict[str, Any]


class AccessError(RuntimeError):
    """A file of passwords cannot be used; the text says why in one line."""


class Login(NamedTuple):
    """A user's name and password."""

    user: str
    password: str


class AccessControl(NamedTuple):
    """What a router needs for the access control of one run."""

    users: Path
    """The file of passwords."""
    run: str
    agents: int
    """Number of agents in the run."""

    def login(self, user: str) -> Login:
        """Return a user's login. Raises AccessError where the file has none."""
        return login_of(self.users, user)

    def config(self) -> dict[str, Any]:
        """Return Zenoh's access control, which denies what no rule allows."""
        keys = Keys(self.run)
        agents = [agent_name(agent) for agent in range(self.agents)]
        operators = [user for user in _passwords(self.users) if user == OPERATOR]
        others = [user for user in _passwords(self.users) if user not in (*agents, OPERATOR)]
        rules = [_rule("everything", [EVERY_KEY], ALL_MESSAGES, BOTH)]
        policies = [{"rules": ["everything"], "subjects": others}] if others else []
        allowed = {user: _query_rules(user, [keys.of("control")]) for user in operators}
        allowed |= {name: _agent_rules(name, keys, agent) for agent, name in enumerate(agents)}
        for user, own in allowed.items():
            rules += own
            policies.append({"rules": [rule["id"] for rule in own], "subjects": [user]})
        users = (*agents, *operators, *others)
        return {
            "enabled": True,
            "default_permission": "deny",
            "rules": rules,
            "subjects": [{"id": user, "usernames": [user]} for user in users],
            "policies": policies,
        }


def size_limits() -> list[Rule]:
    """Return Zenoh's filters by size for the topics that agents put."""
    return [
        {
            "id": f"size of {topic}",
            "flows": INGRESS,
            "messages": ["put"],
            "key_exprs": [Keys.any_run(topic, "*")],
            "size_limit": max_b,
        }
        for topic, max_b in MAX_AGENT_PUT_B.items()
    ]


def write_users(path: Path, users: Iterable[str]) -> None:
    """Write a new file of passwords, readable by its owner alone. Raises OSError."""
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


def _agent_rules(name: str, keys: Keys, agent: int) -> list[Rule]:
    """Return the rules of one agent: its own topics, its liveliness, and the query of its setup."""
    puts = [keys.of(topic, agent) for topic in MAX_AGENT_PUT_B]
    gets = [keys.of("over"), *(keys.of(topic, agent) for topic in AGENT_GETS)]
    return [
        _rule(f"{name} puts", puts, ["put"], INGRESS),
        _rule(f"{name} has subscribers", puts, ["declare_subscriber"], EGRESS),
        _rule(f"{name} subscribes", gets, ["declare_subscriber"], INGRESS),
        _rule(f"{name} gets", gets, ["put"], EGRESS),
        _rule(f"{name} is alive", [keys.of("alive", name)], ["liveliness_token"], INGRESS),
        *_query_rules(name, [keys.of("setup", agent)]),
    ]


def _query_rules(user: str, key_exprs: list[str]) -> list[Rule]:
    """Return the rules that let a user send queries and get their replies."""
    return [
        _rule(f"{user} queries", key_exprs, ["query"], INGRESS),
        _rule(f"{user} gets replies", key_exprs, ["reply", "declare_queryable"], EGRESS),
    ]


def _rule(name: str, key_exprs: list[str], messages: list[str], flows: list[str]) -> Rule:
    return {
        "id": name,
        "permission": "allow",
        "flows": flows,
        "messages": messages,
        "key_exprs": key_exprs,
    }
