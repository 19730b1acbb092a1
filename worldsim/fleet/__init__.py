"""A fleet of real processes: launched, driven slot by slot, and monitored."""
