"""The JSON Schema of a scenario file, for editors: what each key may hold by itself.

A file may name a formation's file where a resolved scenario holds the formation.
"""

from typing import Any

import msgspec

from worldsim.scenario.tables import Scenario

DIALECT = "https://json-schema.org/draft/2020-12/schema"
FORMATION_FILE = {
    "title": "FormationFile",
    "description": "A formation in a file of its own, relative to this one.",
    "type": "object",
    "properties": {"file": {"type": "string"}},
    "required": ["file"],
    "additionalProperties": False,
}


def schema() -> dict[str, Any]:
    """Return the schema of a scenario file, under its published dialect."""
    (root,), tables = msgspec.json.schema_components([Scenario], ref_template="#/$defs/{name}")
    scenario = tables["Scenario"]
    inline = scenario["properties"]["formation"]
    scenario["properties"]["formation"] = {"anyOf": [{"$ref": "#/$defs/FormationFile"}, inline]}
    later = tables["EventTable"]["properties"]
    later["formation"] = {"anyOf": [{"type": "string"}, later["formation"]]}
    return {
        "$schema": DIALECT,
        "title": "A scenario of qswarm",
        **root,
        "$defs": _portable({**tables, "FormationFile": FORMATION_FILE}),
    }


def _portable(value: Any) -> Any:
    r"""Write patterns as every dialect of regular expressions reads them: $ for \Z."""
    if isinstance(value, dict):
        return {
            key: inner.replace(r"\Z", "$") if key == "pattern" else _portable(inner)
            for key, inner in value.items()
        }
    return [_portable(inner) for inner in value] if isinstance(value, list) else value
