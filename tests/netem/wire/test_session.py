"""Sessions outlive the pauses of processes: the router would wait for one that it closes."""

import json

import pytest
import zenoh

from netem.wire.session import client_config, router_config

LONGEST_RUN_S = 86_400
"""See worldsim.scenario.tables."""


@pytest.mark.parametrize(
    "config",
    [client_config("tcp/127.0.0.1:7447", 1.0), router_config("tcp/127.0.0.1:7447")],
    ids=["client", "router"],
)
def test_no_pause_of_a_run_outlasts_the_lease(config: zenoh.Config) -> None:
    lease_ms = json.loads(str(config.get_json("transport/link/tx/lease")))
    assert lease_ms >= 1000 * LONGEST_RUN_S
