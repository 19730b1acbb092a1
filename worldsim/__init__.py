"""The world: it owns the truth, conducts time, judges, records, and launches fleets."""
