"""Random timelines: events of every kind, many of them at the same times and over each other."""

from collections.abc import Callable
from math import ceil

from worldsim.search.draws import Draw, Tables
from worldsim.search.fleets import lattice
from worldsim.search.formations import formation
from worldsim.search.radios import fault
from worldsim.search.surroundings import moving

MODES = ("stuck", "silent", "wrong")
ONCE = {"join", "formation", "frame", "heal", "restart", "resume"}
"""Actions that nothing undoes."""


class Timeline:
    """Draws the events of one scenario, whose other tables are given."""

    def __init__(self, draw: Draw, scenario: Tables, slowest: float) -> None:
        self._draw = draw
        self._scenario = scenario
        self._slowest = slowest
        self._agents = scenario["fleet"]["agents"]
        self._sensors = sorted({*scenario["vehicle"]["sensors"]})
        self._times: list[float] = []
        self._clock_is_behind = False

    def events(self) -> list[Tables]:
        """Return the events of a whole timeline."""
        count = self._draw.among((0, 1, 2, 4, 8))
        return [self._event() for _ in range(count)]

    def next_event(self, draw: Draw) -> Tables:
        """Return one more event, from draws of its own."""
        self._draw = draw
        return self._event()

    def _event(self) -> Tables:
        draw = self._draw
        kinds: list[tuple[int, Callable[[], Tables]]] = [
            (5, self._process),
            (1, self._other_process),
            (2, lambda: {"join": self._join()}),
            (6, lambda: fault(draw, self._agents, self._spacing)),
            (2, lambda: {"formation": self._formation()}),
            (2, lambda: {"frame": self._frame()}),
            (2, lambda: {"sensor": self._sensor()}),
            (2, self._agent_fault),
        ]
        makers = [maker for weight, maker in kinds for _ in range(weight)]
        made = draw.among(makers)()
        event: Tables = {"at_s": self._time(), **made}
        if "clock" in event:
            event["clock"]["offset_s"] = self._offset_s(event["clock"]["offset_s"], event["at_s"])
        if draw.chance(0.6) and not event.keys() & {"join", "formation", "frame", "heal"}:
            event["for_s"] = self._lasting(event["at_s"])
        return event

    @property
    def _spacing(self) -> float:
        spacing: float = self._scenario["control"]["spacing_m"]
        return spacing

    def _time(self) -> float:
        """Return a time of one decimal; some are when another event begins or ends."""
        if self._times and self._draw.chance(0.3):
            return self._draw.among(self._times)
        found = self._draw.number(0.0, 0.9 * self._scenario["duration_s"], 1)
        self._times.append(found)
        return found

    def _lasting(self, at_s: float) -> float:
        found = max(0.1, self._draw.number(0.1, 0.5 * self._scenario["duration_s"], 1))
        if round(at_s + found, 1) < self._scenario["duration_s"]:
            self._times.append(round(at_s + found, 1))
        return found

    def _process(self) -> Tables:
        kind = self._draw.among(("kill", "kill", "leave", "pause", "restart", "resume"))
        return {kind: self._selectors(by_place=kind not in ("restart", "resume"))}

    def _other_process(self) -> Tables:
        """Netem down, or the world paused: its kill would leave nothing to look at."""
        if self._draw.chance(0.2):
            return {"disk_full": True}
        made: Tables = {self._draw.among(("kill", "pause")): ["netem"]}
        return made if self._draw.chance(0.8) else {"pause": ["world"], "for_s": 0.1}

    def _selectors(self, by_place: bool) -> list[int | str]:
        draw, agents = self._draw, self._agents
        choices: list[Callable[[], list[int | str]]] = [
            lambda: list(draw.some(range(agents), draw.whole(1, max(1, agents // 2)))),
            lambda: [f"random:{draw.whole(1, max(1, agents // 2))}"],
            lambda: [draw.whole(0, agents - 1)],
        ]
        if by_place:
            choices += [lambda: ["vertex:V1"], lambda: ["queue:Q1"]]
        return ["all"] if draw.chance(0.04) else draw.among(choices)()

    def _join(self) -> int | Tables:
        draw, count = self._draw, self._draw.whole(1, 3)
        listed = self._scenario["fleet"]["start"]["kind"] == "list"
        if not listed and draw.chance(0.5):
            return count
        pitch = self._scenario["control"]["separation_m"] * draw.number(1.0, 4.0)
        away = draw.point(5.0)
        return {
            "count": count,
            "start": {"kind": "list", "positions_m": lattice(draw, count, pitch, away)},
        }

    def _formation(self) -> Tables | str:
        least = self._scenario["control"]["separation_m"] + 0.25
        tables = formation(self._draw, self._agents, self._spacing, least)
        name: Tables | str = tables.get("file", tables)
        return name

    def _frame(self) -> Tables:
        draw = self._draw
        if draw.chance(0.3):
            return {"yaw_deg": draw.number(-180, 180, 0)}
        here = self._scenario["frame"]["waypoints_m"][-1]
        table = moving(draw, self._slowest, here)
        table.pop("start_s", None)
        return table

    def _agent_fault(self) -> Tables:
        draw = self._draw
        kinds: list[Callable[[], Tables]] = [
            lambda: {"clock": self._clock()},
            lambda: {"slow": {"delay_s": draw.among((0.02, 0.05, 0.2, 1.0, 5.0))}},
            lambda: {"starve": self._starve()},
            lambda: {"intruder": {"per_s": draw.scale(1.0, 9000.0)}},
        ]
        if self._all_range:  # others know of vehicles by their poses alone
            kinds.append(lambda: {"pose": self._pose()})
        made = draw.among(kinds)()
        for table in made.values():
            table["agents"] = self._selectors(by_place=True)
        return made

    @property
    def _all_range(self) -> bool:
        """Whether every vehicle has the proximity sensor."""
        tables = [self._scenario["vehicle"]]
        tables += [{**tables[0], **each.get("vehicle", {})} for each in self._scenario["agent"]]
        return all("proximity" in each["sensors"] for each in tables)

    def _pose(self) -> Tables:
        draw = self._draw
        bias_m = draw.point(draw.among((0.05, 0.5, 5.0)))
        noise_m = draw.among((0.0, 0.02, 0.3))
        return {"bias_m": bias_m, "noise_m": noise_m, "bias_yaw_deg": draw.number(-180, 180, 0)}

    def _starve(self) -> Tables:
        draw, tick_s = self._draw, 1.0 / self._scenario["fleet"].get("tick_hz", 20.0)
        period_s = draw.among((max(0.05, 1.25 * tick_s), 0.5, 3.0))
        least = ceil(100.0 * tick_s / period_s)  # it must run for a tick of each period
        return {"cpu_percent": draw.whole(least, 99), "period_s": period_s}

    def _clock(self) -> Tables:
        draw = self._draw
        offset_s = draw.among((0.05, -0.05, 0.3, -0.3, 3.0, -3.0, 100.0, -100.0))
        drift_ppm = draw.among((10.0, -500.0, 10_000.0, -10_000.0))
        return {"offset_s": offset_s, "drift_ppm": drift_ppm}

    def _offset_s(self, offset_s: float, at_s: float) -> float:
        """Return an offset by which no clock may show less than 0 s: one of all is negative."""
        if offset_s >= 0.0 or self._clock_is_behind:
            return abs(offset_s)
        self._clock_is_behind = True
        return max(offset_s, -round(0.5 * at_s, 1)) or 1.0

    def _sensor(self) -> Tables:
        table: Tables = {"agents": self._selectors(by_place=True), "mode": self._draw.among(MODES)}
        if self._sensors and self._draw.chance(0.5):
            table["kind"] = self._draw.among(self._sensors)
        return table


def repeated_and_ended(draw: Draw, events: list[Tables], duration_s: float) -> list[Tables]:
    """Return events of which some happen again, and some are ended before their time."""
    found = [dict(each) for each in events]
    for number, event in enumerate(events):
        at_s, for_s = event["at_s"], event.get("for_s", 0.0)
        if event.keys() & ONCE or not draw.chance(0.2):
            continue
        found[number]["name"] = name = f"fault-{number}"
        if draw.chance(0.5):
            found[number]["every_s"] = round(for_s + draw.number(0.5, 5.0, 1), 1)
        end_s = round(at_s + draw.number(0.1, for_s or 3.0, 1), 1)
        if at_s < end_s < min(duration_s, at_s + (for_s or duration_s)):
            found.append({"at_s": end_s, "end": name})
    return found
