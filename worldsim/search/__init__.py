"""Scenarios drawn at random, how near each came to trouble, and smaller ones: pure, without IO."""
