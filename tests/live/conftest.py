"""The command line and the small scenario, as the tests of commands have them."""

from tests.commands.conftest import qswarm, small

__all__ = ["qswarm", "small"]
