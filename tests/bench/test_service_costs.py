"""What services cost is measured between flights with none and with all of them."""

from agent.services import SERVICES
from tests.service_costs import scenario_of
from worldsim.engine.virtual import fly


def sent_b(services):
    flight = fly(scenario_of(services, 1.0))
    rows = flight.loop.radio_use.bytes_per_s(flight.medium_counters)
    return sum(sum(row) for row in rows.values())


def test_an_agent_sends_only_with_services():
    assert sent_b(()) == 0.0 < sent_b(SERVICES)
