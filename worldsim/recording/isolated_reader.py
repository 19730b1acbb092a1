"""Reading a recording in a process of its own: rerun's reader aborts on some damaged files."""

import pickle
import signal
import subprocess
import sys
from pathlib import Path

from worldsim.recording.readback import (
    DamagedError,
    Readback,
    RecordingError,
    check_recording,
    read_run,
)


def read_run_apart(path: Path) -> Readback:
    """Return the run that a recording holds. Raises RecordingError.

    The file is read by a child process, so that a damaged one can only end the child.
    """
    check_recording(path)
    command = [sys.executable, "-P", "-m", __name__, str(path)]
    child = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, check=False)
    if child.returncode:
        raise DamagedError(f"{path}: damaged: {_death(child.returncode, child.stderr)}")
    # The child is this module's own code, so what it sends may be unpickled.
    result: Readback | RecordingError = pickle.loads(child.stdout)
    if isinstance(result, RecordingError):
        raise result
    return result


def _death(status: int, stderr: bytes) -> str:
    if status < 0:
        return f"its reader was ended by {signal.Signals(-status).name}"
    lines = stderr.decode(errors="replace").split("\n")
    return next((line.strip() for line in reversed(lines) if line.strip()), "its reader failed")


def main(path: Path) -> None:
    """Read a recording, and write what it holds, or why it cannot be read, to stdout."""
    result: Readback | RecordingError
    try:
        result = read_run(path)
    except RecordingError as error:
        result = error
    sys.stdout.buffer.write(pickle.dumps(result))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
