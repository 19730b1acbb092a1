"""The JSON Schema of a scenario file, for editors: the allowed values of each key by itself.

Where a resolved scenario holds a formation, a file may name a formation file instead.
"""

from typing import Any

import msgspec

from worldsim.scenario.tables import Scenario

DIALECT = "https://json-schema.org/draft/2020-12/schema"
FORMATION_FILE = {
    "title": "FormationFile",
    "description": "A formation file, relative to this file, or a formation of the library.",
    "type": "object",
    "properties": {"file": {"type": "string"}},
    "required": ["file"],
    "additionalProperties": False,
}


def schema() -> dict[str, Any]:
    """Return the schema of a scenario file, in the dialect DIALECT."""
    (root,), tables = msgspec.json.schema_components([Scenario], ref_template="#/$defs/{name}")
    scenario = tables["Scenario"]
    inline = scenario["properties"]["formation"]
    scenario["properties"]["formation"] = {"anyOf": [{"$ref": "#/$defs/FormationFile"}, inline]}
    later = tables["EventTable"]["properties"]
    later["formation"] = {"anyOf": [{"type": "string"}, later["formation"]]}
    return {
        "$schema": DIALECT,
        "title": "qswarm scenario",
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
