"""The slot loop and its clocks: virtual time, and processes with their launcher."""
