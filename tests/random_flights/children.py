"""Work in forked children with a deadline: a hang, a crash and an exception each have a name."""

import resource
import traceback
from collections.abc import Callable, Iterable, Iterator
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from pathlib import Path
from time import monotonic
from typing import Any, NamedTuple

MEMORY_B = 3 << 30
"""A flight that takes more than this fails with MemoryError."""
FORK = get_context("fork")
Work = Callable[[int], dict[str, Any]]


class Child(NamedTuple):
    """A child at work on one number."""

    number: int
    process: Any
    answer: Connection
    until: float
    """When it is hung [s; monotonic]."""


class Answer(NamedTuple):
    """What became of one number: a row of plain values."""

    number: int
    row: dict[str, Any]


def answers(numbers: Iterable[int], work: Work, jobs: int, deadline_s: float) -> Iterator[Answer]:
    """Yield the row of each number, in the order in which they end.

    A row has "failure" and "detail" where the work did not return: "exception", "hang" or "crash".
    """
    waiting, active = iter(numbers), list[Child]()
    try:
        while True:
            for number in waiting:
                active.append(_begun(number, work, deadline_s))
                if len(active) >= jobs:
                    break
            if not active:
                return
            for child in _ended(active):
                active.remove(child)
                yield Answer(child.number, _row(child, deadline_s))
    finally:
        for child in active:
            child.process.kill()
            child.process.join()


def _begun(number: int, work: Work, deadline_s: float) -> Child:
    ours, theirs = FORK.Pipe(duplex=False)
    process = FORK.Process(target=_work, args=(work, number, theirs), daemon=True)
    process.start()
    theirs.close()
    return Child(number, process, ours, monotonic() + deadline_s)


def _work(work: Work, number: int, answer: Connection) -> None:
    most_b = _address_space_b() + MEMORY_B
    resource.setrlimit(resource.RLIMIT_AS, (most_b, most_b))
    try:
        row = work(number)
    except BaseException as error:  # whatever it is, it is what this flight showed
        row = {"failure": "exception", "detail": _last_line(error), "where": traceback.format_exc()}
    answer.send(row)


def _address_space_b() -> int:
    """Return the address space of this process [B]: a child begins with all that its parent has."""
    pages = int(Path("/proc/self/statm").read_text("ascii").split()[0])
    return pages * resource.getpagesize()


def _last_line(error: BaseException) -> str:
    return " ".join(f"{type(error).__name__}: {error}".split())[:300]


def _ended(active: list[Child]) -> list[Child]:
    """Wait until a child has answered, has ended or is hung; return those."""
    first = min(child.until for child in active)
    ready = wait([child.answer for child in active], max(0.0, first - monotonic()))
    now = monotonic()
    return [child for child in active if child.answer in ready or child.until <= now]


def _row(child: Child, deadline_s: float) -> dict[str, Any]:
    try:
        if child.answer.poll():
            row: dict[str, Any] = child.answer.recv()
            return row
        return {"failure": "hang", "detail": f"no answer in {deadline_s:g} s"}
    except EOFError:
        child.process.join(5.0)
        return {"failure": "crash", "detail": f"exit status {child.process.exitcode}"}
    finally:
        child.process.kill()
        child.process.join()
        child.answer.close()
