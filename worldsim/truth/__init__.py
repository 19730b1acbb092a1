"""Ground truth as arrays over the fleet: vehicles, what they sense, and the world that steps them."""
