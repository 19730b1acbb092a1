"""A problem of a scenario: the key at fault, and what is wrong with it."""

from typing import NamedTuple


class Problem(NamedTuple):
    """What is forbidden or unwise in a table."""

    key: str
    """Dotted, within the table that was checked; empty for the table itself."""
    detail: str
    """What is wrong, and what is allowed or would be better."""

    def within(self, table: str) -> "Problem":
        """Return the problem with its key as the table's parent names it."""
        return Problem(f"{table}.{self.key}", self.detail)
