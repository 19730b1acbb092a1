"""A tutorial as a newcomer meets it: files to save, commands to type, and what they should say."""

import os
import re
import subprocess
from pathlib import Path
from typing import NamedTuple

BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
FILE_NAME = re.compile(r"# (\S+\.(?:py|toml))\n")
NUMBER = re.compile(r"\d+(?:\.\d+)?")


class Block(NamedTuple):
    """A fenced block of a page: its language, and what stands in it."""

    language: str
    text: str


def blocks(page: str) -> list[Block]:
    """Return a page's fenced blocks, in order."""
    return [Block(*found) for found in BLOCK.findall(page)]


class Newcomer:
    """Does what a page says, word for word, in a home of their own."""

    def __init__(self, home: Path, environment: dict[str, str]) -> None:
        self._home = home
        self._folder = home
        self._environment = {**os.environ, **environment, "HOME": str(home)}
        self._seen: set[str] = set()

    def follow(self, block: Block) -> None:
        """Save a file, type commands, or look whether the last ones said what the page shows."""
        if block.language in ("python", "toml"):
            self._save(block.text)
        elif block.language == "sh":
            self._type(block.text)
        else:
            assert block.language == "text", block
            self._look(block.text)

    def _save(self, text: str) -> None:
        name = FILE_NAME.match(text)
        assert name is not None, f"a block without a file's name: {text}"
        (self._folder / name[1]).write_text(text)

    def _type(self, commands: str) -> None:
        done = subprocess.run(
            ["bash", "-euc", f'{commands}\npwd >"$HOME/folder"'],
            cwd=self._folder,
            env=self._environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=60.0,
            check=False,
        )
        assert done.returncode == 0, f"{commands}\n{done.stdout}"
        self._folder = Path((self._home / "folder").read_text().strip())
        self._seen = {self._blurred(line) for line in done.stdout.splitlines()}

    def _look(self, shown: str) -> None:
        missing = [line for line in shown.splitlines() if self._blurred(line) not in self._seen]
        assert missing == [], "\n".join(sorted(self._seen))

    def _blurred(self, line: str) -> str:
        """Return a line as it is on every host and in every version: figures may differ."""
        return NUMBER.sub("#", line.replace(str(self._home), "~"))
