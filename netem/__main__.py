"""The medium by hand: ``python -m netem --listen tcp/127.0.0.1:7447``."""

import argparse
import sys

from netem.compiled import tell_if_unfit
from netem.process import run

DESCRIPTION = """\
The emulated radio between the agents, and the Zenoh router that all processes of a run connect to.

It serves the first run whose world asks for it, refuses all others, and ends with that run.
The conditions of the radio (range, delay, loss) come from the world's scenario."""

EPILOG = """\
a fleet by hand, each in its own shell:
  python -m netem --listen tcp/127.0.0.1:7447
  python -m worldsim deploy/scenarios/wedge-9.toml --connect tcp/127.0.0.1:7447 --out runs/mine \\
      --run mine
  for i in 0 1 2 3 4 5 6 7 8; do
      python -m agent --id $i --run mine --connect tcp/127.0.0.1:7447 &
  done

exit status: 0 the run ended or SIGTERM arrived; 1 the world is gone; 2 it could not listen"""


def main(arguments: list[str] | None = None) -> int:
    """Serve by the command line; return the exit status."""
    parser = argparse.ArgumentParser(
        prog="python -m netem",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--listen",
        required=True,
        metavar="ENDPOINT",
        help="endpoint on loopback: tcp/127.0.0.1:7447, unixsock-stream//run/qswarm.sock",
    )
    endpoint = parser.parse_args(arguments).listen
    tell_if_unfit()
    return run(endpoint)


if __name__ == "__main__":
    sys.exit(main())
