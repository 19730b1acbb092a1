"""Scenario files: TOML in, typed and checked tables out, or an error naming file and key."""
