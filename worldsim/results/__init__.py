"""The run folder: summary.json, events.jsonl, logs, and the verdict in words."""
