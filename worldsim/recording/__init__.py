"""The recording of a run: written with rerun, read back, verified and shown in the viewer."""
