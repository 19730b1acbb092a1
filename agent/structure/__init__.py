"""The Q-structure: trees, leaders, counts and numbers by local knowledge (Sec. 3.1, E14-E17)."""
