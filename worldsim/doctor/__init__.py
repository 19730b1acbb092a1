"""What this host can do with qswarm: its parts, and the fleets that it flies in real time."""
