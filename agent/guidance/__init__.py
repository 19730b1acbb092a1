"""From a place in a queue to a velocity: Algorithms 1, 2 and 4, potentials and the safety filter."""
