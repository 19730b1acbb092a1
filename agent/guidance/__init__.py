"""From a place to a velocity: Algorithms 1, 2 and 4, potentials and the safety filter."""
