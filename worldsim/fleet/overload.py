"""Overload: what a free-running fleet does when its ticks come late. No clock: time is an argument.

``go`` reports it. ``slow`` also lowers the speed of simulated time in steps until the ticks are in
time, and raises it again. ``abort`` ends the run.
"""

from collections import deque
from collections.abc import Mapping
from typing import Literal, assert_never

OnOverload = Literal["go", "slow", "abort"]

LOOK_EVERY_S = 0.5
"""How often the ticks are looked at [s; wall time, as all times below]."""
SHORT_S, SHORT_FRACTION = 2.0, 0.05
LONG_S, LONG_FRACTION = 10.0, 0.01
"""An overload begins when so many ticks of the last SHORT_S or of the last LONG_S are late."""
OVER_FRACTION = 0.01
"""It is over when fewer are late, in both."""

FAR_TOO_FAST = 0.25
"""From this share of late ticks on, a look halves the speed."""
HALF, DOWN, UP = 0.5, 0.8, 1.1
LEAST_FACTOR = 0.1
LEAST_SPEED = 0.01
"""The speed never falls below this share of the requested one, nor below this speed."""
PATIENCE_S, MOST_PATIENCE_S = 2.0, 32.0
"""How long the ticks must be in time before the speed rises."""

REMEDIES = "use --lockstep, fewer agents or a lower --speed"


class LateShare:
    """The share of late ticks in the last seconds."""

    def __init__(self) -> None:
        self._looks: deque[tuple[float, int, int]] = deque()

    def add(self, now_s: float, ticks: int, late: int) -> None:
        """Add the ticks since the last call."""
        self._looks.append((now_s, ticks, late))
        while self._looks[0][0] <= now_s - LONG_S:
            self._looks.popleft()

    def of_last(self, seconds: float) -> float:
        """Return the share of late ticks in the last ``seconds``, up to LONG_S [s]."""
        since_s = self._looks[-1][0] - seconds if self._looks else 0.0
        found = [(ticks, late) for at_s, ticks, late in self._looks if at_s > since_s]
        return sum(late for _, late in found) / max(1, sum(ticks for ticks, _ in found))


class LateSpells:
    """Times in which the host made ticks late, though perhaps few of the whole run's.

    Agents that get their news late may for a while break an invariant that rests on it.
    """

    def __init__(self) -> None:
        self._share = LateShare()
        self._worst, self._under = (0.0, 0.0), ""
        self._noted: dict[str, int] = {}
        self.violated_in_time: set[str] = set()
        """The invariants of which a violation was found while no ticks were late."""

    def add(self, now_s: float, ticks: int, late: int, time_s: float, attack: str = "") -> None:
        """Take the ticks since the last call, by a wall time and a simulated time [s].

        attack: which intruders attack meanwhile, in words; empty: none.
        """
        self._share.add(now_s, ticks, late)
        now = self._share.of_last(SHORT_S), time_s
        if now > self._worst:
            self._worst, self._under = now, attack

    def note(self, violations: Mapping[str, int]) -> None:
        """Take the number of violations of each invariant so far."""
        if violations != self._noted:
            late = max(self._share.of_last(SHORT_S), self._share.of_last(LONG_S))
            if late < OVER_FRACTION:
                more = (name for name, n in violations.items() if n > self._noted.get(name, 0))
                self.violated_in_time.update(more)
            self._noted = dict(violations)

    def __str__(self) -> str:
        share, time_s = self._worst
        if share < SHORT_FRACTION:
            return ""
        share_text = f"{percent(share)} of the ticks of {SHORT_S:g} s were late"
        under = f", while {self._under}" if self._under else ""
        return f"the host was too slow for a while: {share_text}, at {time_s:.1f} s{under}"


class SpeedLaw:
    """How fast simulated time runs, as a share of the requested speed: down at once, up slowly.

    A step up that is followed by late ticks is undone, and the patience before the next one
    doubles: near its limit a host is not overloaded again and again. It halves when a second step
    up follows.
    """

    def __init__(self, least_factor: float) -> None:
        self.factor = self.least = 1.0
        self.least_factor = least_factor
        self._patience_s = PATIENCE_S
        self._quiet_since_s = 0.0
        self._raised = False

    def look(self, now_s: float, late_share: float) -> None:
        """Take the share of late ticks since the last look."""
        if late_share >= OVER_FRACTION:
            self._lower(now_s, late_share)
        elif self.factor < 1.0 and now_s - self._quiet_since_s >= self._patience_s:
            self._raise(now_s)
        elif now_s - self._quiet_since_s >= MOST_PATIENCE_S:
            self._patience_s, self._raised = PATIENCE_S, False

    def _lower(self, now_s: float, late_share: float) -> None:
        step = HALF if late_share >= FAR_TOO_FAST else DOWN
        if self._raised:
            self._patience_s = min(2.0 * self._patience_s, MOST_PATIENCE_S)
            step = 1.0 / UP
        self._raised = False
        self._quiet_since_s = now_s
        self.factor = max(self.least_factor, self.factor * step)
        self.least = min(self.least, self.factor)

    def _raise(self, now_s: float) -> None:
        if self._raised:
            self._patience_s = max(0.5 * self._patience_s, PATIENCE_S)
        self._raised = True
        self._quiet_since_s = now_s
        self.factor = min(1.0, self.factor * UP)


class Episodes:
    """When an overload begins and ends."""

    def __init__(self) -> None:
        self._share = LateShare()
        self._overloaded = False

    def begins(self, now_s: float, ticks: int, late: int) -> bool:
        """Add the ticks since the last call; return whether an overload begins now."""
        self._share.add(now_s, ticks, late)
        short, long = self._share.of_last(SHORT_S), self._share.of_last(LONG_S)
        if self._overloaded:
            self._overloaded = max(short, long) >= OVER_FRACTION
            return False
        self._overloaded = (now_s >= SHORT_S and short >= SHORT_FRACTION) or (
            now_s >= LONG_S and long >= LONG_FRACTION
        )
        return self._overloaded

    def __str__(self) -> str:
        short = self._share.of_last(SHORT_S)
        if short >= SHORT_FRACTION:
            return f"late: {percent(short)} of the ticks in the last {SHORT_S:g} s"
        return f"late: {percent(self._share.of_last(LONG_S))} of the ticks in the last {LONG_S:g} s"


def percent(share: float) -> str:
    """Return a share in percent, as it is printed."""
    return f"{100.0 * share:.{0 if share >= 0.1 else 1}f} %"


class Overload:
    """Follows the late ticks of one run, and decides what is done about them.

    requested: speed of simulated time [simulated s in a wall s].
    """

    def __init__(self, requested: float, policy: OnOverload) -> None:
        self.requested = requested
        self.policy = policy
        self.abort_reason: str | None = None
        """Why the run must end now, or None."""
        self._law = SpeedLaw(min(1.0, max(LEAST_FACTOR, LEAST_SPEED / requested)))
        self._episodes = Episodes()
        self._look_at_s = LOOK_EVERY_S
        self._ticks = self._late = 0
        self._told_least = False

    @property
    def speed(self) -> float:
        """Speed of simulated time at present [simulated s in a wall s]."""
        return self.requested * self._law.factor

    @property
    def slowed(self) -> bool:
        """Whether the speed is below the requested one."""
        return self._law.factor < 1.0

    @property
    def least_speed(self) -> float:
        """The least speed so far."""
        return self.requested * self._law.least

    def note(self, now_s: float, ticks: int, late: int) -> str | None:
        """Note new ticks, and how many of them were late; return what to report, or None.

        now_s: wall time since the run began [s].
        """
        self._ticks += ticks
        self._late += late
        if now_s < self._look_at_s or not self._ticks:
            return None
        self._look_at_s = now_s + LOOK_EVERY_S
        ticks, late, self._ticks, self._late = self._ticks, self._late, 0, 0
        match self.policy:
            case "go":
                begins = self._episodes.begins(now_s, ticks, late)
                return f"{self._episodes}; {REMEDIES}, or --on-overload slow" if begins else None
            case "slow":
                return self._slow(now_s, late / ticks)
            case "abort":
                return self._abort() if self._episodes.begins(now_s, ticks, late) else None
            case _:
                assert_never(self.policy)

    def _slow(self, now_s: float, late_share: float) -> str | None:
        before = self._law.factor
        self._law.look(now_s, late_share)
        factor = self._law.factor
        if factor < 1.0 <= before:
            return f"late: {percent(late_share)} of the ticks; simulated time is slowed"
        if before < 1.0 <= factor:
            self._told_least = False
            return f"the ticks are in time again, at {self.speed:.3g} x real time"
        stuck = factor == before == self._law.least_factor and late_share >= SHORT_FRACTION
        if not stuck or self._told_least:
            return None
        self._told_least = True
        return f"late even at the least speed, {self.speed:.2g} x real time; {REMEDIES}"

    def _abort(self) -> str:
        self.abort_reason = f"overload ({self._episodes}; --on-overload abort)"
        return f"{self._episodes}; the run ends (--on-overload abort); {REMEDIES}"
