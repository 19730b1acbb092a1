"""Sensing: ray patterns, a map of scanned points, surface motion, and sensor health."""
