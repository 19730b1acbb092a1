"""Schemes of the literature that the paper compares itself with, flown as controllers."""
