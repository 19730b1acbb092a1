"""A fleet of real processes: launching, conducting and watching them."""
