"""Two runs and two sweeps compared: where traces part, and what differs by cell and seed."""

from pathlib import Path

import numpy as np
import pytest

from worldsim.judge.tick import Tick
from worldsim.results.run_folder import RunDirectoryError
from worldsim.sweep.flight_row import FlightRow
from worldsim.sweep.pair_text import sweep_pair_text
from worldsim.sweep.run_pair import parting_of
from worldsim.sweep.sweep_pair import Flights, PairKey, compare_sweeps

FOLDERS = (Path("a"), Path("b"))


def tick(
    index: int, x_m: float = 0.0, rank: int = 0, alive: bool = True, joined: bool = False
) -> Tick:
    """Three agents, of which the second is as given, and the third joins the world or not."""
    position = np.zeros((3, 3))
    position[1, 0], position[2] = x_m, 1.0 if joined else np.nan
    place = np.zeros((3, 2), np.int16)
    place[1, 1] = rank
    nothing = np.full(3, np.nan)
    return Tick(
        index, index * 0.05, position, np.zeros((3, 3), np.float32), np.zeros((3, 3), np.float32),
        place, nothing.astype(np.float32), nothing, np.array([True, alive, False]),
        np.zeros((0, 2), np.int32), np.zeros(3, np.int64),
    )  # fmt: skip


def test_equal_recordings_do_not_part() -> None:
    assert parting_of([tick(0), tick(1)], [tick(0), tick(1)]) is None


@pytest.mark.parametrize(
    ("other", "what"),
    [
        (tick(1, x_m=1e-15), "its positions are 1e-15 m apart"),
        (tick(1, joined=True), "it is in the world of one of them alone"),
        (tick(1, rank=2), "it claims another place"),
        (tick(1, alive=False), "its process runs in one of them alone"),
    ],
)
def test_the_first_tick_that_differs_is_found(other: Tick, what: str) -> None:
    parting = parting_of([tick(0), tick(1), tick(2)], [tick(0), other, tick(2, x_m=3.0)])
    agent = 2 if other.position[2, 0] == 1.0 else 1
    assert parting == {"tick": 1, "t_s": 0.05, "agent": agent, "what": what}


def test_a_run_that_ends_early_parts_there() -> None:
    parting = parting_of([tick(0)], [tick(0), tick(1)])
    assert parting == {"tick": 1, "t_s": 0.05, "agent": None, "what": "the first ended"}


def flights(passing: int, converge_s: float, seeds: int = 20, trace: str = "") -> Flights:
    rows: dict[PairKey, FlightRow] = {}
    for seed in range(seeds):
        rows[PairKey((("netem.loss_percent", "50"),), seed)] = {
            "cell": 0,
            "seed": seed,
            "outcome": "pass" if seed < passing else "fail",
            "reason": None,
            "figures": {"converge_s": converge_s + seed + 0.01 * (seed % 3)},
            "trace_sha256": f"{trace}{seed}",
        }
    return rows


def test_differences_are_paired_by_seed() -> None:
    # Times spread over 20 s: unpaired, a difference of 0.5 s could not be seen.
    pair = compare_sweeps(FOLDERS, flights(18, 5.0), flights(8, 5.5, trace="b"))
    (cell,) = pair["cells"]
    assert (cell["pairs"], cell["same_traces"]) == (20, 0)
    times, shares = cell["figures"]["converge_s"], cell["pass_share"]
    assert times is not None
    assert shares is not None
    assert times["difference"] == pytest.approx(0.5)
    assert times["low"] == pytest.approx(0.5)
    assert shares["difference"] == pytest.approx(-0.5)
    assert shares["high"] is not None
    assert shares["high"] < -0.2
    assert "0.90 -> 0.40: -0.50 (-0." in sweep_pair_text(pair)


def test_flights_without_a_partner_are_counted_and_said() -> None:
    pair = compare_sweeps(FOLDERS, flights(8, 5.0, seeds=10), flights(8, 5.0, seeds=14))
    assert pair["unpaired"] == (0, 4)
    assert pair["cells"][0]["same_traces"] == 10
    assert sweep_pair_text(pair).endswith("4 flights of b have no partner")


def test_sweeps_without_a_common_flight_are_refused() -> None:
    with pytest.raises(RunDirectoryError, match="has no flight in common with a"):
        compare_sweeps(FOLDERS, flights(1, 5.0), {})
