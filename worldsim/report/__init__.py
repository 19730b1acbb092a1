"""The report of a run: the paper's figures of it, and one page that needs nothing else."""
