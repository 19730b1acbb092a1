"""A scenario of two agents that converges in a moment."""

SMALL = """
name = "small"
duration_s = 5.0
[fleet]
agents = 2
start = { kind = "list", positions_m = [[0.3, 0, 0], [-1.3, 0, 0]] }
[formation]
name = "line"
vertices = { V1 = [0, 0, 0] }
queue = [{ name = "Q1", vertices = ["V1"], shape = { kind = "ray", direction = [-1, 0, 0] } }]
"""
