"""The Q-structure: trees, leaders, counts and ranks, by local knowledge alone (Sec. 3.1, E14-E17)."""
