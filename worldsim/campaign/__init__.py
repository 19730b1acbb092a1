"""Many runs at once: seeds, spread over worker processes."""
