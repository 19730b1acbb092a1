"""Measures CPU time, traffic and fleets of processes: the figures behind `qswarm bench`."""
