"""Communication: broadcasts, neighbours, records of members, and missions."""
