"""What things cost in CPU time: the figures behind `qswarm bench`."""
