"""The wire: frames, keys, sessions and messaging. Imports nothing else of this project."""
