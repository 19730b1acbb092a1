"""Parameters of a user's own controller: its scenario's [control.parameters], checked and typed.

A controller declares them as a msgspec structure, the class attribute ``Parameters``, with their
types, bounds and defaults. Its constructor then takes them beside the setup. ``Parameters = dict``
takes any, unchecked. A controller without this attribute takes none.
"""

from collections.abc import Mapping
from typing import Any

import msgspec

ATTRIBUTE = "Parameters"


class ParametersError(ValueError):
    """Parameters that a controller does not take, or a declaration that is none."""


def parameters_type(controller: type) -> type[msgspec.Struct] | None:
    """Return the structure of a controller's parameters; None where it takes none, or any.

    Raises ParametersError where ``Parameters`` is something else.
    """
    kind = getattr(controller, ATTRIBUTE, None)
    if kind is None or kind is dict:
        return None
    if not (isinstance(kind, type) and issubclass(kind, msgspec.Struct)):
        raise ParametersError(f"{controller.__name__}.{ATTRIBUTE} is not a msgspec.Struct")
    return kind


def takes_any(controller: type) -> bool:
    """Return whether a controller takes any parameters, unchecked."""
    return getattr(controller, ATTRIBUTE, None) is dict


def unknown_parameters(kind: type[msgspec.Struct], given: Mapping[str, Any]) -> list[str]:
    """Return the names that a structure does not have, in order."""
    known = {field.encode_name for field in msgspec.structs.fields(kind)}
    return [name for name in given if name not in known]


def made(controller: type, setup: Any, given: Mapping[str, Any]) -> Any:
    """Return a controller made with its setup, and with its parameters where it takes some.

    Raises ParametersError, and what the constructor raises.
    """
    if takes_any(controller):
        return controller(setup, dict(given))
    kind = parameters_type(controller)
    if kind is None:
        if given:
            raise ParametersError(f"{controller.__name__} takes no parameters")
        return controller(setup)
    unknown = unknown_parameters(kind, given)
    if unknown:
        raise ParametersError(f"{controller.__name__} has no parameter {unknown[0]!r}")
    try:
        return controller(setup, msgspec.convert(given, kind))
    except msgspec.ValidationError as error:
        raise ParametersError(f"parameters of {controller.__name__}: {error}") from error
