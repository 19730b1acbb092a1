"""Ground truth as arrays over the fleet: vehicles, their senses, the world that steps them."""
