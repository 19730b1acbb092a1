"""Command line of one agent: ``python -m agent --id 0 --run mine --connect tcp/127.0.0.1:7447``."""

import argparse
import os
import sys
from pathlib import Path

from agent.process import run
from netem.compiled import tell_if_unfit

DESCRIPTION = """\
One agent of a fleet: it flies its vehicle and communicates with the other agents.

It asks the world of its run for its setup (formation, limits, controller) and flies until the run
is over. It may be started before the world."""

EPILOG = """\
exit status: 0 the run is over, or SIGTERM was received; 1 the world is gone; 2 no router, no such
agent or no such controller"""


def main(arguments: list[str] | None = None) -> int:
    """Parse the command line and fly the agent; return the exit status."""
    parser = argparse.ArgumentParser(
        prog="python -m agent",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--id", required=True, type=int, metavar="I", help="the agent's id, counted from 0"
    )
    parser.add_argument("--run", required=True, metavar="NAME", help="the name of its run")
    parser.add_argument(
        "--connect", required=True, metavar="ENDPOINT", help="the router, e.g. tcp/127.0.0.1:7447"
    )
    parser.add_argument(
        "--credentials",
        type=Path,
        metavar="FILE",
        help="file of passwords, if the router wants one",
    )
    options = parser.parse_args(arguments)
    tell_if_unfit()
    return run(options.id, options.run, options.connect, users=options.credentials)


if __name__ == "__main__":
    status = main()
    sys.stdout.flush()
    # A thread that a controller has started must not keep the process.
    os._exit(status)
