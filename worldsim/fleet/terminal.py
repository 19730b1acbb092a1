"""What a person sees of a fleet while it flies: a line that follows it, and lines that stay."""

import time
from math import inf

from rich.console import Console
from rich.live import Live
from rich.text import Text

from worldsim.fleet.launcher_link import PRINT_EVERY_S, Progress


class Terminal:
    """Shows progress in place on a terminal, and as a plain line now and then elsewhere."""

    def __init__(self, console: Console) -> None:
        self._console = console
        # No refresh thread of rich's: children are forked from this process.
        self._live = Live(console=console, auto_refresh=False, transient=True)
        self._print_at_s = -inf

    def say(self, text: str) -> None:
        """Say something that stays."""
        self._console.print(text, markup=False, highlight=False, soft_wrap=True)

    def show(self, progress: Progress) -> None:
        """Show how far the flight is."""
        if self._console.is_terminal:
            self._live.start()
            self._live.update(Text(str(progress), no_wrap=True, overflow="ellipsis"), refresh=True)
        elif time.monotonic() >= self._print_at_s:
            self._print_at_s = time.monotonic() + PRINT_EVERY_S
            self.say(str(progress))

    def close(self) -> None:
        """Leave only what stays."""
        self._live.stop()
