"""How a command tells the outcome of its runs: in words or as JSON, and in a JUnit file."""

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple, TextIO

from worldsim.results.exit_status import EXIT_STATUS, INCONCLUSIVE
from worldsim.results.junit import check_junit_file, write_junit
from worldsim.results.overall import FailedRun, Made, Overall, Result
from worldsim.results.run_folder import RunDirectoryError
from worldsim.results.summary import Summary
from worldsim.results.verdict_text import closing_line, closing_lines, table, verdict


class Output(NamedTuple):
    """The options --quiet, --json and --junit of the commands that run scenarios."""

    quiet: bool = False
    json: bool = False
    junit: Path | None = None
    silent: bool = False  # a run that is flown again tells nothing

    @property
    def stream(self) -> TextIO:
        """Where progress and words go: with --json, stdout is left to the document."""
        return sys.stderr if self.json else sys.stdout

    def check(self, out: Path | None) -> None:
        """Raise RunDirectoryError where the JUnit file could not be written after the flight.

        out: the folder that the flight will make; None: one named after scenario and time.
        """
        if self.junit is not None:
            check_junit_file(self.junit, out)

    def conclude(self, result: Result, recorded: bool) -> int:
        """Tell the outcome of one run; return its exit status."""
        folder, summary = result
        if self.silent:
            return EXIT_STATUS[summary["outcome"]]
        if self.quiet:
            self._tell(closing_line(summary, folder, recorded), summary)
        elif self.stream.isatty():
            from worldsim.results.closing_table import show_verdict  # noqa: PLC0415 - loads rich

            show_verdict(self.stream, summary, folder, recorded)
            self._print_document(summary)
        else:
            self._tell(verdict(summary, folder, recorded), summary)
        return self._report([result], EXIT_STATUS[summary["outcome"]])

    def fail(self, run: FailedRun) -> None:
        """Note in the JUnit file that a run ended without a summary."""
        self._report([run], EXIT_STATUS[run.outcome])

    def conclude_many(self, made: Sequence[Made], overall: Overall, folder: Path) -> int:
        """Tell the outcome of many runs in ``folder``; return the exit status over all."""
        words = closing_lines(overall, folder) if self.quiet else table(overall, folder)
        self._tell(words, overall)
        return self._report(made, EXIT_STATUS[overall["outcome"]], overall["reason"])

    def _tell(self, words: str, document: Summary | Overall) -> None:
        if not (self.json and self.quiet):
            print(words, file=self.stream)
        self._print_document(document)

    def _print_document(self, document: Summary | Overall) -> None:
        if self.json:
            print(json.dumps(document, indent=2, allow_nan=False))

    def _report(self, made: Sequence[Made], status: int, cut_off_by: str | None = None) -> int:
        """Write the JUnit file; return the exit status, which is no pass where that failed."""
        if self.junit is None:
            return status
        try:
            write_junit(self.junit, made, cut_off_by)
        except RunDirectoryError as error:
            print(error, file=sys.stderr)
            return status or INCONCLUSIVE
        return status
