"""Reports of long waits."""

from worldsim.fleet.ipc import Stalled, world_sockets
from worldsim.fleet.launcher_link import LaunchedLink
from worldsim.fleet.progress import STALL_AFTER_S, StallReporter


def test_a_wait_is_reported_once_when_it_has_become_long() -> None:
    launcher, world = world_sockets()
    stall = StallReporter("agent-2's command of slot 5", LaunchedLink(world))
    stall.add_wait(STALL_AFTER_S - 0.5)
    assert launcher.receive() == []
    stall.add_wait(0.5)
    assert launcher.receive() == [Stalled("agent-2's command of slot 5")]
    stall.add_wait(10 * STALL_AFTER_S)
    assert launcher.receive() == []
    launcher.close()
    world.close()
