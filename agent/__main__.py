"""One agent by hand: ``python -m agent --id 0 --run mine --connect tcp/127.0.0.1:7447``."""

import argparse
import sys
from pathlib import Path

from agent.process import run

DESCRIPTION = """\
One agent of a fleet: it senses and hears, decides, commands its vehicle and speaks to the others.

It asks the world of its run for its setup (formation, limits, controller) and flies until the run
is over. It can be started before the world is."""

EPILOG = """\
exit status: 0 the run is over, or SIGTERM came; 1 the world is gone; 2 no router, no such agent
or no such controller"""


def main(arguments: list[str] | None = None) -> int:
    """Fly as the command line says; return the exit status."""
    parser = argparse.ArgumentParser(
        prog="python -m agent",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--id", required=True, type=int, metavar="I", help="which agent, counted from 0"
    )
    parser.add_argument("--run", required=True, metavar="NAME", help="the run that it belongs to")
    parser.add_argument(
        "--connect", required=True, metavar="ENDPOINT", help="the router: tcp/127.0.0.1:7447"
    )
    parser.add_argument(
        "--credentials", type=Path, metavar="FILE", help="passwords, where the router wants one"
    )
    options = parser.parse_args(arguments)
    return run(options.id, options.run, options.connect, users=options.credentials)


if __name__ == "__main__":
    sys.exit(main())
