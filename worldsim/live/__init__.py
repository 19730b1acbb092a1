"""The live view of a run: its growing recording, passed on to viewers while it flies."""
