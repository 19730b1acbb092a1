"""The laws hold for the forms that fly."""

import pytest

from tests.laws.laws import LAWS


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_law_holds(law):
    law()
