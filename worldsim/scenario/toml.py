"""TOML files in, plain data out; an error is one line that names file and key."""

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

MAX_FILE_B = 1024 * 1024

Data = dict[str, Any]


class ScenarioError(ValueError):
    """Bad input, in one line: the file, the key, what is wrong and what is allowed.

    key: dotted; "" for the file as a whole.
    """

    def __init__(self, file: str | Path, key: str, detail: str) -> None:
        self.file = file
        self.key = key
        self.detail = detail
        super().__init__(_one_line(f"{file}: {key}: {detail}" if key else f"{file}: {detail}"))


def read(path: Path) -> str:
    """Return a file's text, without a byte order mark.

    Raises ScenarioError: no such file, too large, not UTF-8.
    """
    try:
        with path.open("rb") as file:
            raw = file.read(MAX_FILE_B + 1)
        if len(raw) > MAX_FILE_B:
            raise ScenarioError(path, "", f"too large; at most {MAX_FILE_B} bytes are allowed")
        return raw.decode("utf-8-sig")
    except FileNotFoundError:
        raise ScenarioError(path, "", "no such file") from None
    except UnicodeDecodeError as error:
        raise ScenarioError(path, "", f"byte {error.start} is not UTF-8") from error
    except (OSError, ValueError) as error:
        if isinstance(error, ScenarioError):
            raise
        reason = getattr(error, "strerror", None) or str(error)
        raise ScenarioError(path, "", f"cannot be read: {reason}") from error


def tables(text: str, file: str | Path) -> Data:
    """Return the tables of a TOML text. Raises ScenarioError with the line where it breaks."""
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ScenarioError(file, "", "not TOML: nested too deeply") from None
    except ValueError as error:
        raise ScenarioError(file, "", f"not TOML: {error}") from error


def override(data: Data, overrides: Mapping[str, str], file: str | Path) -> None:
    """Set dotted keys to values written as in TOML; a bare word is taken as text.

    Raises ScenarioError for a key that leads through a value that is not a table.
    """
    for dotted, text in overrides.items():
        *path, last = dotted.split(".")
        if not all((*path, last)):
            raise ScenarioError(file, dotted, "not a valid key; write it as table.key")
        table = data
        for depth, name in enumerate(path):
            table = table.setdefault(name, {})
            if not isinstance(table, dict):
                detail = "is not a table, so it has no keys to set"
                raise ScenarioError(file, ".".join(path[: depth + 1]), detail)
        table[last] = value_of(text)


def value_of(text: str) -> Any:
    """Return the value of a text written as in TOML; a bare word is text."""
    try:
        parsed = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):
        return text
    return parsed["value"] if len(parsed) == 1 else text


def _one_line(text: str) -> str:
    """Escape control characters: keys, values and paths come from outside."""
    return "".join(letter if letter.isprintable() else repr(letter)[1:-1] for letter in text)
