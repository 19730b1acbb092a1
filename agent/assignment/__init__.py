"""Places by assignment, for comparison: every agent knows all members and solves for all (E24)."""
