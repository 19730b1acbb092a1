"""Formations, queues and their shapes (Definitions 3 and 4 of the paper)."""
