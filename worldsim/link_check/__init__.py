"""Measures what links do: packets through the medium, compared with the configured parameters."""
