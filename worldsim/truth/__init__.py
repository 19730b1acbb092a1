"""The true state of the world: vehicles, sensors and obstacles."""
