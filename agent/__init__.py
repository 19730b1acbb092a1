"""One agent of the team: its pure core, and the process shells around it."""

from netem import compiled

compiled.prefer()
