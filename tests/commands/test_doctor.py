"""doctor: every part is told, and a host that flies no fleet fails."""

import pytest

from tests.commands.conftest import Command
from worldsim.bench.measures import InvalidFigureError
from worldsim.doctor import capacity, checks
from worldsim.doctor.capacity import Capacity

FREE = Capacity(cpu_us=750.0, cores=2.0, others=0.0, late_percent=0.0)


def test_the_doctor_tells_every_part_and_then_what_it_measures(
    qswarm: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(checks, "SLEEPS", 2)
    monkeypatch.setattr(capacity, "virtual_steps_per_s", lambda: 32_000.0)
    monkeypatch.setattr(capacity, "measured_capacity", lambda: FREE)
    printed = qswarm("doctor")
    assert (printed.status, printed.err) == (0, "")
    names = [line.partition(":")[0] for line in printed.out.splitlines() if line[0] != " "]
    assert names == [
        "qswarm", "host", "cores", "clock", "Python", "code", "Zenoh", "viewer", "film",
        "extra cluster", "extra export", "virtual time", "processes",
    ]  # fmt: skip


def test_a_host_that_flies_no_fleet_fails(qswarm: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    def unflown() -> Capacity:
        raise InvalidFigureError("no summary, exit status 2: no router answers")

    monkeypatch.setattr(checks, "SLEEPS", 2)
    monkeypatch.setattr(capacity, "virtual_steps_per_s", lambda: 1.0)
    monkeypatch.setattr(capacity, "measured_capacity", unflown)
    printed = qswarm("doctor")
    assert printed.status == 1
    last = printed.out.splitlines()[-1]
    assert last.endswith(
        "a fleet of 16 cannot be flown: no summary, exit status 2: no router answers"
    )
