"""When agents count as observed again after a planned stop."""

from worldsim.fleet.reconnection import LONG_PAUSE_S, SETTLING_S, WITHIN_S, Reconnection


def test_an_agent_is_awaited_until_it_has_answered_a_later_observation() -> None:
    awaited = Reconnection(speed=2.0)
    assert not awaited.awaits(0)
    awaited.begin([0, 1, 2], 10.0)
    awaited.hear(0, 9.9)
    awaited.hear(1, 10.0)
    assert [awaited.awaits(agent) for agent in range(4)] == [True, False, True, False]
    assert awaited.missing([0, 1]) == (0,), "agent 2 is not running any more"
    awaited.cancel()
    assert (awaited.since_s, awaited.awaits(0)) == (None, False)


def test_after_a_long_pause_sessions_are_given_time_to_begin_anew() -> None:
    awaited = Reconnection(speed=2.0)
    awaited.begin([0], 10.0, paused_s=LONG_PAUSE_S + 0.1)
    awaited.hear(0, 10.0 + 2.0 * SETTLING_S - 0.1)
    assert awaited.awaits(0)
    awaited.hear(0, 10.0 + 2.0 * SETTLING_S)
    assert not awaited.awaits(0)


def test_waiting_has_an_end() -> None:
    awaited = Reconnection(speed=2.0)
    assert not awaited.is_late(1e9)
    awaited.begin([0], 10.0)
    assert not awaited.is_late(10.0 + 2.0 * WITHIN_S)
    assert awaited.is_late(10.1 + 2.0 * WITHIN_S)
