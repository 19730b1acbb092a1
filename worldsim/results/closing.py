"""How a command tells the outcome of its runs: in words or as JSON."""

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple, TextIO

from worldsim.results.exit_status import EXIT_STATUS
from worldsim.results.overall import Made, Overall, Result
from worldsim.results.summary import Summary
from worldsim.results.verdict_text import closing_line, closing_lines, table, verdict


class Output(NamedTuple):
    """The options --quiet and --json of the commands that run scenarios."""

    quiet: bool = False
    json: bool = False

    @property
    def stream(self) -> TextIO:
        """Where progress and words go: with --json, stdout is left to the document."""
        return sys.stderr if self.json else sys.stdout

    def conclude(self, result: Result, recorded: bool) -> int:
        """Tell the outcome of one run; return its exit status."""
        folder, summary = result
        if self.quiet:
            words = closing_line(summary, folder, recorded)
        else:
            words = verdict(summary, folder, recorded)
        return self._tell(words, summary)

    def conclude_many(self, made: Sequence[Made], overall: Overall, folder: Path) -> int:
        """Tell the outcome of many runs in ``folder``; return the exit status over all."""
        words = closing_lines(overall, folder) if self.quiet else table(overall, folder)
        return self._tell(words, overall)

    def _tell(self, words: str, document: Summary | Overall) -> int:
        if not self.json:
            print(words)
        else:
            if not self.quiet:
                print(words, file=sys.stderr)
            print(json.dumps(document, indent=2, allow_nan=False))
        return EXIT_STATUS[document["outcome"]]
