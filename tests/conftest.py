"""For every test: Ctrl-C means Ctrl-C, and a closed terminal ends what runs in it."""

import signal

# A shell that starts this run in the background has it ignore SIGINT, and nohup has it ignore
# SIGHUP. Whatever a test starts would inherit that; some tests send these signals.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
