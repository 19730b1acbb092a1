"""The code that flies a run, as hashes beside its agents' inputs: a replay says what changed."""

from pathlib import Path
from typing import Final

import msgspec

from agent.config import Control
from agent.controller import BUILT_IN
from worldsim.results.controller_code import code_sha256
from worldsim.results.provenance import ROOT

FILE: Final = "code.json"
PACKAGES: Final = ("agent", "netem")
"""The packages of which an agent's process is made."""


class FlownCode(msgspec.Struct, frozen=True):
    """Hashes of the code that flies an agent; "" where no file of it is found."""

    controller: str  # its name, or the command of one that is a program
    controller_sha256: str | None  # of its package or program; None for one of this project
    agent_sha256: str  # of this project's packages

    def changes_to(self, now: "FlownCode") -> str | None:
        """Return what is another code now, in words; None: nothing."""
        if not self.controller_sha256 == now.controller_sha256 != "":
            known = self.controller_sha256 and now.controller_sha256
            changed = "has changed" if known else "cannot be compared: its files are not found"
            return f"the code of the controller {self.controller!r} {changed}"
        if self.agent_sha256 != now.agent_sha256:
            return "the code of qswarm's agents has changed"
        return None


def code_of(control: Control) -> FlownCode:
    """Return the code as it is now."""
    name, command = control.controller, control.command
    own = name in BUILT_IN
    return FlownCode(
        controller=" ".join(command) if command else name,
        controller_sha256=None if own else code_sha256(name, command),
        agent_sha256="".join(code_sha256(package, None, str(ROOT)) for package in PACKAGES),
    )


def keep_code(folder: Path, control: Control) -> None:
    """Write the code as it is now into a folder."""
    (folder / FILE).write_bytes(msgspec.json.encode(code_of(control)))


def kept_code(folder: Path) -> FlownCode | None:
    """Return the code that a folder tells of; None where it tells of none."""
    try:
        return msgspec.json.decode((folder / FILE).read_bytes(), type=FlownCode)
    except (OSError, msgspec.MsgspecError):
        return None
