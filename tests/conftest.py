"""For every test: Ctrl-C means Ctrl-C, a closed terminal ends what runs in it; little garbage."""

import gc
import signal

# A shell that starts this run in the background has it ignore SIGINT, and nohup has it ignore
# SIGHUP. Whatever a test starts would inherit that; some tests send these signals.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
    signal.signal(signal.SIGHUP, signal.SIG_DFL)

# As in a run (worldsim.commands.app), the collector looks for reference cycles less often.
gc.set_threshold(200_000)


def pytest_collection_finish() -> None:
    """Exempt the thousands of collected tests from garbage collection."""
    gc.freeze()
