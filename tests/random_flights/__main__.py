"""Fly random scenarios of all kinds: no exception, no hang, no I1, equal traces when flown twice.

    python -m tests.random_flights --base 7 --count 1000 --jobs 2

Prints one table at the end; exit 1 if any flight failed. The results are kept in a folder, so the
same command goes on where it was interrupted. ``NUMBER.toml`` in it is the scenario of a flight
that failed: fly it with ``qswarm sim``.
"""

import argparse
import sys
from functools import partial
from pathlib import Path

from tests.random_flights.campaign import Campaign, report
from tests.random_flights.generate import STEPS, scenario


def arguments(about: str | None, steps: int) -> argparse.ArgumentParser:
    """Return the options that every campaign has."""
    parser = argparse.ArgumentParser(
        description=about, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--base", type=int, default=1, help="seed of all numbers")
    parser.add_argument("--count", type=int, default=100, help="how many to fly")
    parser.add_argument("--from", dest="first", type=int, default=0, help="the first number")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--steps", type=int, default=steps, help="of all agents, in a flight")
    parser.add_argument("--deadline", type=float, default=120.0, help="of one number [s]")
    parser.add_argument("--twice-every", type=int, default=1, help="0: fly none twice")
    parser.add_argument("--out", type=Path, help="folder of the results; default: in runs/")
    return parser


def main() -> int:
    given = arguments(__doc__, STEPS).parse_args()
    campaign = Campaign(
        partial(scenario, given.base, steps=given.steps),
        given.out or Path("runs") / f"random-flights-{given.base}",
        given.jobs,
        given.deadline,
        given.twice_every,
    )
    rows = campaign.fly(range(given.first, given.first + given.count))
    print(report(rows))
    return 1 if any("failure" in row for row in rows.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
