"""Guidance: from a place to a safe velocity (Algorithms 1-4, potentials, safety filter)."""
