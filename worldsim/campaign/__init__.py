"""Many runs at once: seeds, each in a child process that is watched."""
