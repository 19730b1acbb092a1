"""The start of a run: it waits for all processes, or ends with the reason."""

from collections.abc import Callable

import pytest

from netem.wire.bus import RefusedError
from worldsim.fleet import startup
from worldsim.fleet.launcher_link import ManualLink
from worldsim.fleet.startup import StartupError, assemble, shortened


class FakeStartup:
    """A start at which some processes stay missing, or whose medium refuses the run."""

    def __init__(self, missing: list[str], refusal: str | None = None) -> None:
        self._missing = missing
        self._refusal = refusal

    def configure_mediums(self, speed: float) -> bool:
        if self._refusal is not None:
            raise RefusedError(self._refusal)
        return True

    def answer_setup_requests(self) -> None:
        """No agent asks."""

    def missing(self) -> list[str]:
        return self._missing


def assembled(fake: FakeStartup, should_stop: Callable[[], bool] = lambda: False) -> bool:
    return assemble(fake, 1.0, should_stop, ManualLink(list))


def test_a_start_ends_when_all_are_present_or_a_stop_is_requested() -> None:
    assert assembled(FakeStartup([]))
    assert not assembled(FakeStartup(["agent-1"]), lambda: True)


def test_a_start_names_the_processes_that_did_not_come(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(startup, "STARTUP_WITHIN_S", 0.05)
    with pytest.raises(StartupError, match=r"^not started within 0\.05 s: agent-1$"):
        assembled(FakeStartup(["agent-1"]))


def test_a_start_gives_the_reason_when_the_medium_refuses() -> None:
    with pytest.raises(StartupError, match=r"^netem refused the run: serves another$"):
        assembled(FakeStartup([], "serves another"))


def test_long_lists_of_names_are_shortened() -> None:
    names = [f"agent-{agent}" for agent in range(9)]
    assert shortened(names[:5]) == names[:5]
    assert shortened(names) == [*names[:5], "4 more"]
