"""For every test: Ctrl-C means Ctrl-C."""

import signal

# A shell that starts this run in the background has it ignore SIGINT, and whatever a test starts
# would inherit that; the tests of Ctrl-C send it to what they start.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
