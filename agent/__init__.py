"""What flies: one agent of the team, a pure core and the process shell round it."""
