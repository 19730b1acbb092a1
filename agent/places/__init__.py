"""Places in a formation as one agent sees them: where they are, and which are taken by bodies."""
