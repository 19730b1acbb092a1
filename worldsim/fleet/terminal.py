"""The launcher's terminal output: a progress line that is updated in place, and lasting lines."""

import sys
import time
from math import inf
from typing import TextIO, cast

from rich.console import Console
from rich.live import Live
from rich.text import Text

from worldsim.fleet.ipc import Progress
from worldsim.fleet.launcher_link import PRINT_EVERY_S
from worldsim.results.output_streams import Unescaped, escaped


def console_on(stream: TextIO) -> Console:
    """Return a console that draws on a stream of this process."""
    return Console(file=cast(TextIO, Unescaped(stream)))


class Terminal:
    """Shows progress in place on a terminal; elsewhere prints it as a line now and then.

    quiet: shows errors only.
    """

    def __init__(self, console: Console | None = None, *, quiet: bool = False) -> None:
        self._console = console = console if console is not None else console_on(sys.stdout)
        self._quiet = quiet
        # Without rich's refresh thread: this process forks children.
        self._live = Live(console=console, auto_refresh=False, transient=True)
        self._print_at_s = -inf

    def print(self, text: str) -> None:
        """Print a lasting line, unless quiet."""
        if not self._quiet:
            self.print_error(text)

    def print_error(self, text: str) -> None:
        """Print a lasting line on an error, also when quiet."""
        self._console.print(escaped(text), markup=False, highlight=False, soft_wrap=True)

    def show(self, progress: Progress) -> None:
        """Show the state of the running fleet."""
        if self._quiet:
            return
        if self._console.is_terminal:
            self._live.start()
            self._live.update(Text(escaped(str(progress))), refresh=True)
        elif time.monotonic() >= self._print_at_s:
            self._print_at_s = time.monotonic() + PRINT_EVERY_S
            self.print(str(progress))

    def close(self) -> None:
        """Remove the progress line."""
        self._live.stop()
