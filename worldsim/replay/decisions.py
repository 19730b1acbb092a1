"""What an agent decided in a run beside what it decides in a replay: where the two part."""

from typing import NamedTuple

from agent.messages import Command, Vector

NAMES = ("wants", "flies", "turns to", "tilts to", "force", "target", "place", "signals", "sends")


class Decision(NamedTuple):
    """What a controller decides at a step, as far as a run's log holds it."""

    wanted: Vector  # [m/s; world frame]
    velocity: Vector  # after the safety filter [m/s; world frame]
    yaw: float  # [rad; world frame]
    tilt: tuple[float, float]  # [rad]
    force: float  # [m/s]
    target: Vector | None  # [m; world frame]
    place: tuple[int, int] | None
    signals: dict[str, float]
    sent: tuple[int, int]  # datagrams, and their bytes


def decision_of(command: Command) -> Decision:
    """Return the decision in a command; what else it tells is not the controller's."""
    telemetry = command.telemetry
    report = telemetry.report
    return Decision(
        wanted=telemetry.wanted,
        velocity=command.velocity,
        yaw=command.yaw,
        tilt=command.tilt,
        force=telemetry.force,
        target=telemetry.target,
        place=telemetry.place,
        signals={} if report is None else dict(report.signals),
        sent=(0, 0) if report is None else report.sent,
    )


class DecisionComparison:
    """Compares the decisions of a replay with those of the run, up to the first that differs."""

    def __init__(self) -> None:
        self._same = 0
        self._difference: str | None = None

    def note(self, time_s: float, flown: Command | None, now: Command) -> None:
        """Compare one step. flown: the command in the run; None: it is not known."""
        if flown is None or self._difference is not None:
            return
        before, after = decision_of(flown), decision_of(now)
        if before == after:
            self._same += 1
            return
        rows = zip(NAMES, before, after, strict=True)
        name, then, today = next(row for row in rows if row[1] != row[2])
        self._difference = f"from {time_s:.3f} s on: it {name} {_shown(today)}, not {_shown(then)}"

    @property
    def text(self) -> str | None:
        """What the comparison found, in words; None where no decision of the run is known."""
        if self._difference is not None:
            return f"decides otherwise than in the run {self._difference}"
        if self._same == 0:
            return None
        steps = "step" if self._same == 1 else "steps"
        return f"decides as in the run, at {self._same} {steps} up to here"


def _shown(value: object) -> str:
    if isinstance(value, tuple):
        return "(" + ", ".join(map(_shown, value)) + ")"
    if isinstance(value, dict):
        return " ".join(f"{name} = {number:.6g}" for name, number in value.items()) or "none"
    if isinstance(value, float):
        return f"{value:.6g}"
    return "none" if value is None else str(value)
