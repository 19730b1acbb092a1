"""One agent's controller asked again, with what it was given in a run: to look, or to step in."""
