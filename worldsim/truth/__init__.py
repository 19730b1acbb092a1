"""The true state of the world as arrays over the fleet: vehicles, sensors and obstacles."""
