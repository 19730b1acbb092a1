"""Sweeps: a grid of scenarios by seeds, its statistics, tables and figures; two compared."""
