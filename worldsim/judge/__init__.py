"""Metrics, invariants and the verdict, from the truth alone."""
