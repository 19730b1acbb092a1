"""Usage errors of the command line in one line: the option, what was given, what is needed."""

from collections.abc import Iterable
from typing import Any

import typer

NEEDED = {
    "int_parsing": "a whole number is needed",
    "int_parsing_size": "a smaller number is needed",
    "float_parsing": "a number is needed",
    "greater_than_equal": "at least {ge} is needed",
    "less_than_equal": "at most {le} is allowed",
}
"""What a value must be, by the type of pydantic's error; typer checks values with pydantic."""
MAX_SHOWN = 40


def usage_text(error: typer.TyperException, arguments: list[str], commands: Iterable[str]) -> str:
    """Return a usage error as one line that ends with the help to read.

    commands: names of all commands, to find the one in ``arguments``.
    """
    named = arguments[:1] if arguments and arguments[0] in commands else []
    text = " ".join(_text(error).split()).removesuffix(".")
    return f"qswarm: {text} (see {' '.join(['qswarm', *named])} --help)"


def _text(error: typer.TyperException) -> str:
    parameter: Any = getattr(error, "param", None)
    hint = getattr(error, "param_hint", None) or (parameter.opts[0] if parameter else None)
    if not isinstance(error, typer.BadParameter) or not error.message or hint is None:
        return error.format_message()
    return f"{hint}: {_in_words(error)}"


def _in_words(error: typer.BadParameter) -> str:
    cause: Any = error.__cause__
    problem = cause.errors()[0] if hasattr(cause, "errors") else None
    if problem is None or problem["type"] not in NEEDED:
        return error.message.removeprefix("Value error, ")
    given = repr(problem["input"]) if "parsing" in problem["type"] else str(problem["input"])
    needed = NEEDED[problem["type"]].format(**problem.get("ctx", {}))
    return f"got {given[:MAX_SHOWN]}; {needed}"
