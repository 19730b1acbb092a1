"""Drafts of scenarios, repaired: what a check objects to is left out, and the rest checked again.

A draft that needs many repairs, or whose fault is in a table that it needs, is drawn anew.
"""

import re
from collections import Counter
from collections.abc import Callable
from pathlib import Path

from worldsim.engine.preflight import VIRTUAL_COMMAND_TICKS, admit
from worldsim.engine.start_reach import start_warnings
from worldsim.scenario.file import as_toml, parse
from worldsim.scenario.rules import warnings_for
from worldsim.scenario.tables import Scenario
from worldsim.scenario.toml import ScenarioError
from worldsim.search.draws import Tables

REPAIRS = 12
NAMED = re.compile(r"^.*?\.toml: (?P<key>[\w.\[\]]+): ", re.DOTALL)
PART = re.compile(r"(\w+)(?:\[(\d+)\])?")
NEEDED = ("fleet", "fleet.agents", "formation", "control", "vehicle", "duration_s")
"""Tables and keys that no repair leaves out."""
Objection = Callable[[str], str]
"""Returns what a check says about a scenario's text; empty: it accepts it without a warning."""


def loaded(text: str, file: Path) -> Scenario:
    """Return a scenario as it flies in virtual time. Raises ScenarioError.

    file: whose folder the paths in the text are relative to.
    """
    return admit(parse(text, file), file, VIRTUAL_COMMAND_TICKS)


def cautions(scenario: Scenario) -> frozenset[str]:
    """Return the keys that `qswarm check` warns of."""
    return frozenset(each.key for each in (*warnings_for(scenario), *start_warnings(scenario)))


def objection(
    text: str, file: Path = Path("drawn.toml"), allowed: frozenset[str] = frozenset()
) -> str:
    """Return the first error or warning that `qswarm check` has for a scenario; empty: none.

    allowed: keys of which it may warn.
    """
    try:
        scenario = loaded(text, file)
    except ScenarioError as error:
        return str(error)
    for caution in (*warnings_for(scenario), *start_warnings(scenario)):
        if caution.key not in allowed:
            return f"{file}: {caution.key}: warning: {caution.detail}"
    return ""


def accepted(
    tables: Tables,
    objections: Counter[str],
    objection: Objection,
    kept: frozenset[str] = frozenset(),
) -> str | None:
    """Return the text that a check accepts without a word; None where repairs do not help.

    objections: counts the keys that were objected to. kept: tables that stay as they are; what a
    check objects to there goes with an event, as it goes together with the events.
    """
    for _ in range(REPAIRS):
        text = as_toml(tables)
        said = objection(text)
        if not said:
            return text
        named = NAMED.match(said)
        key = named["key"] if named else "another key"
        objections[re.sub(r"\[\d+\]", "", key)] += 1
        if key.partition(".")[0].partition("[")[0] in kept:
            key = f"event[{_cause(tables, objection, said)}]"
        if not without(tables, key):
            return None
    return None


def _cause(tables: Tables, objection: Objection, said: str) -> int:
    """Return the last event without which a check does not say the same; else the last of all."""
    events = tables.get("event") or []
    for index in reversed(range(len(events))):
        others = {**tables, "event": events[:index] + events[index + 1 :]}
        if objection(as_toml(others)) != said:
            return index
    return len(events) - 1


def without(tables: Tables, key: str) -> bool:
    """Leave out a key, a table, or the item of a list; return whether there was one to spare."""
    outer: Tables = tables
    inner, last = tables, ""
    for name, index in PART.findall(key):
        if not isinstance(inner, dict) or name not in inner:
            return False
        if index:
            if not 0 <= int(index) < len(inner[name]):
                return False
            del inner[name][int(index)]
            return True
        outer, inner, last = inner, inner[name], name
    if not last or (outer is tables and last in NEEDED) or key in NEEDED:
        return False
    del outer[last]
    return True
