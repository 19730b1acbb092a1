"""Random properties that a run must show: loose ones, so that most flights keep them."""

from worldsim.search.draws import Draw, Tables

FIGURES = ("separation_m", "slot_error_m", "speed_mps", "turn_deg", "running", "parted")
OF_TEAM = ("running", "parted")


def properties(draw: Draw, made: Tables) -> list[Tables]:
    """Return some properties of a drafted scenario."""
    return [_property(draw, made) for _ in range(draw.whole(1, 3))]


def _property(draw: Draw, made: Tables) -> Tables:
    table: Tables = _condition(draw)
    table["must"] = must = draw.among(("always", "eventually", "settle", "sometimes"))
    if draw.chance(0.3):
        table["name"] = "a property"
    if must in ("eventually", "settle") and draw.chance(0.5):
        table["within_s"] = draw.number(1.0, 30.0, 1)
    if draw.chance(0.3):
        table["from_s"] = round(0.2 * made["duration_s"], 1)
    if draw.chance(0.3):
        table["to_s"] = round(0.8 * made["duration_s"], 1)
    table["counted"] = draw.among(("all", "undisturbed"))
    if draw.chance(0.3):
        table["where"] = [_condition(draw)]
    return table


def _condition(draw: Draw) -> Tables:
    table: Tables = {}
    if draw.chance(0.2):
        table["signal"] = "known"
    else:
        table["figure"] = draw.among(FIGURES)
    if table.get("figure") not in OF_TEAM:
        table["over"] = draw.among(("each", "mean", "least", "most", "spread"))
    if draw.chance(0.7):
        table["at_most"] = 1e6
    if draw.chance(0.5) or "at_most" not in table:
        table["at_least"] = 0.0
    return table
