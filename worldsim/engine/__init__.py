"""The engine of a run, pure: slot loop, membership, operations, telemetry, virtual time."""
