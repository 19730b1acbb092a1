"""`qswarm fuzz` finds a planted bug, shrinks it, keeps what replays it, and goes on where it was."""

from pathlib import Path

import pytest

pytestmark = pytest.mark.pure


def test_a_planted_bug_is_found_shrunk_and_replayed(tmp_path: Path) -> None:
    """A vehicle that flies on when its command has expired: seed SEED pauses or kills somebody."""
