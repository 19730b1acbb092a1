"""What /proc says of a process: its state, its CPU time, its memory."""

import os
import re
from pathlib import Path
from typing import NamedTuple

_SWITCHES = re.compile(r"ctxt_switches:\s+(\d+)")
_PRIVATE = re.compile(r"^Private_(?:Clean|Dirty): +(\d+) kB$", re.MULTILINE)
_PAGE_B = os.sysconf("SC_PAGE_SIZE")
_CLOCK_HZ = os.sysconf("SC_CLK_TCK")


class ProcessState(NamedTuple):
    """The state of a process."""

    stopped: bool
    waits: bool  # for anything but a core or the disk
    cpu_s: float  # of all of its threads
    resident_b: int
    switches: int  # how often it was given a core


def process_state(pid: int) -> ProcessState | None:
    """Return the state of a process; None for none."""
    if not pid:
        return None
    try:
        stat = Path(f"/proc/{pid}/stat").read_text(encoding="ascii", errors="replace")
        status = Path(f"/proc/{pid}/status").read_text(encoding="ascii", errors="replace")
    except OSError:
        return None
    switches = sum(map(int, _SWITCHES.findall(status)))
    state, *fields = stat.rpartition(")")[2].split()
    cpu_s = (int(fields[10]) + int(fields[11])) / _CLOCK_HZ
    resident_b = int(fields[20]) * _PAGE_B
    return ProcessState(state in "Tt", state == "S", cpu_s, resident_b, switches)


def private_mb(pid: int) -> float | None:
    """Return the memory that a process shares with no other [MB]; None where it is unknown."""
    try:
        pages = Path(f"/proc/{pid}/smaps_rollup").read_text(encoding="ascii")
    except OSError:
        return None
    return sum(map(int, _PRIVATE.findall(pages))) * 1024 / 1e6
