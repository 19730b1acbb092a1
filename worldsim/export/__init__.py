"""A run's tables as files for other tools: Parquet, CSV, and MCAP for Foxglove."""
