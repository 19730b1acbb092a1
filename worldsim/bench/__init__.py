"""Measures CPU time: the figures behind `qswarm bench`."""
