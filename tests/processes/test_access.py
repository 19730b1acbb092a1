"""Access control at the router: what each user may read and write, and what is denied."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import zenoh

from netem.wire.access import MAX_AGENT_PUT_B, AccessControl, AccessError, login_of, write_users
from netem.wire.bus import Bus, Subscriber, receive
from netem.wire.keys import Keys
from netem.wire.session import SessionError, open_client, open_router
from tests.processes.harness import QSWARM, Started, eventually

pytestmark = pytest.mark.processes

USERS = ("world", "operator", "agent-0", "agent-1")
KEYS = Keys("mine")


@pytest.fixture
def access(tmp_path: Path) -> AccessControl:
    write_users(tmp_path / "users", USERS)
    return AccessControl(tmp_path / "users", "mine", 2)


@pytest.fixture
def session_of(access: AccessControl, endpoint: str) -> Iterator[Callable[[str], zenoh.Session]]:
    opened = [open_router(endpoint, access=access)]

    def of(user: str) -> zenoh.Session:
        opened.append(open_client(endpoint, login=access.login(user)))
        return opened[-1]

    yield of
    for session in reversed(opened):
        session.close()


def test_the_file_of_passwords_is_readable_by_its_owner_only(access: AccessControl) -> None:
    assert access.users.stat().st_mode & 0o777 == 0o600
    assert len({access.login(user).password for user in USERS}) == len(USERS)
    with pytest.raises(AccessError, match="no password of agent-7"):
        login_of(access.users, "agent-7")
    with pytest.raises(AccessError, match="cannot be read"):
        login_of(access.users.with_name("none"), "world")


def test_without_the_right_password_no_session_opens(
    session_of: Callable[[str], zenoh.Session], access: AccessControl, endpoint: str
) -> None:
    for login in (None, access.login("agent-0")._replace(password="guess")):
        with pytest.raises(SessionError, match="no router answers"):
            open_client(endpoint, 0.5, login=login)


def test_an_agent_reads_its_own_radio_and_nothing_else(
    session_of: Callable[[str], zenoh.Session],
) -> None:
    world, spy = Bus(session_of("world"), KEYS), session_of("agent-0")
    own = Subscriber(spy, KEYS.of("rx", 0), 4)
    others = [
        Subscriber(spy, key, 64) for key in (KEYS.of("rx", 1), KEYS.all_of("rx"), "qswarm/**")
    ]
    puts = [world.publisher(topic, agent, lockstep=True) for topic in ("rx",) for agent in (0, 1)]
    puts += [world.publisher("truth"), world.publisher("observation", 1), world.publisher("tx", 1)]
    eventually(lambda: puts_reach(own, puts[0]), 5.0)
    for put in puts:
        put(b"secret")
    puts[0](b"last")
    received: list[bytes] = []
    eventually(lambda: received.extend(own.drain(64)) or b"last" in received, 5.0)
    # A wider subscription receives no more than the agent's own radio.
    assert others[0].drain(64) == []
    assert {bytes(each) for ring in others[1:] for each in ring.drain(64)} <= {
        b"probe",
        b"secret",
        b"last",
    }
    assert sum(each == b"secret" for each in received) == 1


def puts_reach(ring: Subscriber, put: Callable[[bytes], None]) -> bool:
    put(b"probe")
    return bool(ring.drain(64))


def test_an_agent_cannot_write_to_keys_of_other_processes(
    session_of: Callable[[str], zenoh.Session],
) -> None:
    listener, agent = session_of("world"), Bus(session_of("agent-0"), KEYS)
    own = Subscriber(listener, KEYS.of("command", 0), 64)
    topics = [(topic, 1) for topic in ("command", "tx", "arrivals", "rx", "observation")]
    # Nor to its own keys that only the world and netem write to.
    topics += [("rx", 0), ("observation", 0), ("over", None), ("truth", None), ("verdicts", None)]
    forbidden = [Subscriber(listener, KEYS.of(*each), 64) for each in topics]
    puts = [agent.publisher(*each) for each in topics]
    mine = agent.publisher("command", 0)
    eventually(lambda: puts_reach(own, mine), 5.0)
    for put in puts:
        put(b"forged")
    eventually(lambda: puts_reach(own, mine), 5.0)
    assert [ring.drain(64) for ring in forbidden] == [[]] * len(topics)


@pytest.mark.parametrize("topic", MAX_AGENT_PUT_B)
def test_the_router_drops_messages_that_are_too_long(
    session_of: Callable[[str], zenoh.Session], topic: str
) -> None:
    received = Subscriber(session_of("world"), KEYS.of(topic, 0), 64)
    put = Bus(session_of("agent-0"), KEYS).publisher(topic, 0)
    eventually(lambda: puts_reach(received, put), 5.0)
    longest = bytes(MAX_AGENT_PUT_B[topic])
    passed: list[bytes] = []

    def longest_passes() -> bool:
        """Put both again each time: a busy host may drop what is published."""
        put(longest + b"x")
        put(longest)
        passed.extend(received.drain(64))
        return longest in passed

    eventually(longest_passes, 5.0)
    assert longest + b"x" not in passed


@pytest.mark.parametrize("topic", MAX_AGENT_PUT_B)
def test_an_agent_does_not_receive_its_own_messages(
    session_of: Callable[[str], zenoh.Session], topic: str
) -> None:
    agent = session_of("agent-0")
    received, echo = (
        Subscriber(session_of("world"), KEYS.of(topic, 0), 64),
        Subscriber(agent, "qswarm/**", 64),
    )
    put = Bus(session_of("agent-0"), KEYS).publisher(topic, 0)
    eventually(lambda: puts_reach(received, put), 5.0)
    assert echo.drain(64) == []


def test_an_operator_may_only_ask(session_of: Callable[[str], zenoh.Session]) -> None:
    world, operator = session_of("world"), session_of("operator")
    questions = Bus(world, KEYS).queryable("control")
    over = Subscriber(world, KEYS.of("over"), 4)
    asking = Bus(operator, KEYS)
    asking.publisher("over")(b"forged")

    def answered() -> bool:
        replies = operator.get(KEYS.of("control"), payload=b"how is it?", timeout=2.0)
        query = receive(questions, 1.0)
        if query is None:
            return False
        with query:
            query.reply(query.key_expr, b"well")
        return [reply.ok.payload.to_bytes() for reply in replies if reply.ok] == [b"well"]

    eventually(answered, 10.0)
    assert over.drain(4) == []


def test_the_passwords_are_deleted_at_the_end_of_the_run(
    start: Callable[..., Started], scenario: Callable[[float], str], tmp_path: Path
) -> None:
    run = tmp_path / "run"
    fleet = start(*QSWARM, "run", scenario(2.0), "--no-recording", "--out", str(run))
    fleet.wait_for_output("minimum separation")
    assert (run / "users").exists()
    assert fleet.status(15.0) in (0, 1, 3)
    assert not (run / "users").exists()
