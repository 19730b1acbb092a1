"""Metrics, invariants and the verdict of a run, from the truth alone."""
