"""The table: one line for each stage of a row, over its seeds."""

from collections import Counter
from collections.abc import Iterable
from math import ceil
from statistics import median
from typing import Any

from tests.structure_figures.flights import SeedRow

NAME_WIDTH, STAGE_WIDTH, FIGURES_WIDTH = 28, 14, 68
SHOWN = 8
"""Most seeds that are named."""
HEADER = (
    f"{'row':{NAME_WIDTH}}{'stage':{STAGE_WIDTH}}{'exact':>7} {'median/p90/max s':>17}"
    f" {'bound s':>10} {'changes':>9} {'after':>5} {'away s':>6}"
    "  sep m  local+multihop B/s  CPU s  broken; failed seeds"
)
Stage = dict[str, Any]


def lines(name: str, seeds: list[SeedRow]) -> list[str]:
    """Return a row's lines: a stage each; the first one also has what holds for the whole row."""
    flights = [each for each in seeds if "failure" not in each]
    stages = _by_stage(flights)
    heads = [name, *[""] * (len(stages) - 1)]
    told = [
        f"{head:{NAME_WIDTH}}{rows[0]['stage']:{STAGE_WIDTH}}{stage_figures(rows, len(seeds))}"
        for head, rows in zip(heads, stages, strict=False)
    ] or [f"{name:{NAME_WIDTH + STAGE_WIDTH}}{'':{FIGURES_WIDTH}}"]
    told[0] += "  " + _whole(flights, seeds)
    errors = [f"    seed {each['seed']}: {each['detail']}" for each in seeds if "failure" in each]
    return [*told, *errors]


def stage_figures(rows: list[Stage], seeds: int) -> str:
    """Return the figures of one stage over its seeds, ``seeds`` of which were flown."""
    times = sorted(each["converge_s"] for each in rows if each["converge_s"] is not None)
    bounds = [each["bound_s"] for each in rows if each["bound_s"] is not None]
    changes = sum(each["changes_mean"] for each in rows) / len(rows)
    most = max(each["changes_most"] for each in rows)
    after = sum(each["changes_after"] for each in rows)
    away_s = max(each["away_s"] for each in rows)
    exact = f"{len(times)}/{seeds}" if rows[0]["forms"] else "-"
    return (
        f"{exact:>7} {spread(times):>17}"
        f" {f'{median(bounds):.1f}/{max(bounds):.1f}' if bounds else '-':>10}"
        f" {f'{changes:.2f}/{most}':>9} {after:>5} {away_s:>6.1f}"
    )


def spread(times: list[float]) -> str:
    """Return median, 90th percentile (nearest rank) and largest of some times [s], in order."""
    if not times:
        return "-"
    return f"{median(times):.1f}/{times[ceil(0.9 * len(times)) - 1]:.1f}/{times[-1]:.1f}"


def has_failed(seed: SeedRow) -> bool:
    """Return whether a seed shows what must not be."""
    if "failure" in seed or seed["broken"]:
        return True
    stages = [each for each in seed["stages"] if each["forms"]]
    return any(each["converge_s"] is None or each["changes_after"] > 0 for each in stages)


def _by_stage(flights: list[SeedRow]) -> list[list[Stage]]:
    """Return for each stage its figures in each flight."""
    count = max((len(each["stages"]) for each in flights), default=0)
    return [
        [each["stages"][index] for each in flights if index < len(each["stages"])]
        for index in range(count)
    ]


def _whole(flights: list[SeedRow], seeds: list[SeedRow]) -> str:
    """Return what holds for a whole row."""
    failed = [each["seed"] for each in seeds if has_failed(each)]
    broken = Counter(name for each in flights for name in each["broken"])
    ends = f"{_counted(broken)}; {_named(failed)}"
    if not flights:
        return ends
    apart = [each["separation_m"] for each in flights if each["separation_m"] is not None]
    sent = "+".join(_mean_sent(flights, channel) for channel in flights[0]["bytes_per_s"])
    cpu_s = sum(each["cpu_s"] for each in flights) / len(flights)
    return f"{min(apart, default=0.0):5.3f}  {sent:>18}  {cpu_s:5.1f}  {ends}"


def _mean_sent(flights: list[SeedRow], channel: str) -> str:
    return f"{sum(each['bytes_per_s'][channel] for each in flights) / len(flights):.0f}"


def _counted(counts: Counter[str]) -> str:
    return " ".join(f"{name}x{count}" for name, count in sorted(counts.items())) or "-"


def _named(seeds: Iterable[int]) -> str:
    known = list(seeds)
    more = f" and {len(known) - SHOWN} more" if len(known) > SHOWN else ""
    return ",".join(map(str, known[:SHOWN])) + more or "-"
