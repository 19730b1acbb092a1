"""Random conditions of the radio, and random radio faults."""

from collections.abc import Callable

from worldsim.search.draws import Draw, Tables

SHAPES = ("uniform", "normal", "pareto", "paretonormal")


def conditions(draw: Draw, agents: int, spacing: float) -> Tables:
    """Return the radio's conditions, with some channels and links of their own."""
    table = link(draw)
    if draw.chance(0.6):
        table["range_m"] = round(spacing + draw.scale(1.0, 12.0), 2)
    for channel in ("local", "multihop"):
        if draw.chance(0.2):
            table[channel] = link(draw)
    if agents > 1 and draw.chance(0.3):
        table["link"] = links(draw, agents)
    return table


def links(draw: Draw, agents: int) -> list[Tables]:
    """Return links with conditions of their own."""
    pairs = [(a, b) for a in range(agents) for b in range(agents) if a != b]
    chosen = draw.some(pairs, draw.whole(1, 4))
    return [{"from": a, "to": b, **link(draw)} for a, b in chosen]


def link(draw: Draw) -> Tables:
    """Return keys of a link; most links are good, and some lose nearly everything."""
    table: Tables = {}
    if draw.chance(0.5):
        table["loss_percent"] = draw.among((100.0, 90.0, 50.0, 20.0, draw.number(0.0, 100.0)))
    if draw.chance(0.5):
        table |= delay(draw)
    for key in ("duplicate_percent", "corrupt_percent"):
        if draw.chance(0.25):
            table[key] = draw.scale(0.1, 40.0)
    if draw.chance(0.25):
        table |= queue(draw)
    if draw.chance(0.2):
        table["gemodel"] = bursts(draw)
    if draw.chance(0.1):
        table["path_loss"] = path_loss(draw)
    return table


def delay(draw: Draw) -> Tables:
    """Return keys of delay, jitter and reordering."""
    table: Tables = {"delay_ms": draw.among((20.0, 200.0, draw.scale(0.1, 2000.0)))}
    if draw.chance(0.6):
        table["jitter_ms"] = draw.scale(0.1, 400.0)
        table["distribution"] = draw.among(SHAPES)
        table["delay_correlation_percent"] = draw.number(0.0, 99.0)
    if draw.chance(0.3):
        table["reorder_percent"] = draw.number(0.1, 60.0)
    return table


def queue(draw: Draw) -> Tables:
    """Return a rate with its queue."""
    table: Tables = {"rate_kbit": draw.scale(1.0, 2000.0)}
    if draw.chance(0.5):
        table |= {"rate_overhead_b": draw.whole(0, 200), "limit": draw.whole(1, 200)}
    return table


def bursts(draw: Draw) -> Tables:
    """Return a Gilbert-Elliott model."""
    table: Tables = {"p_percent": draw.number(0.1, 30.0), "r_percent": draw.number(1.0, 100.0)}
    if draw.chance(0.3):
        table |= {"loss_bad_percent": draw.number(20, 100), "loss_good_percent": draw.number(0, 20)}
    return table


def path_loss(draw: Draw) -> Tables:
    """Return a log-distance path loss with shadowing."""
    return {
        "exponent": draw.number(1.5, 5.0),
        "reference_distance_m": draw.among((1.0, draw.scale(0.1, 5.0))),
        "reference_loss_db": draw.number(20.0, 50.0),
        "budget_db": draw.number(50.0, 90.0),
        "shadowing_db": draw.number(0.5, 10.0),
    }


def fault(draw: Draw, agents: int, spacing: float) -> Tables:
    """Return one radio fault under its key."""
    kinds: list[Callable[[], Tables]] = [
        lambda: {"partition": partition(draw, agents)},
        lambda: {"jam": {"centre_m": draw.point(4.0), "radius_m": draw.scale(0.2, 8.0)}},
        lambda: {"flap": flap(draw, agents)},
        lambda: {"netem": {"loss_percent": 100.0, **conditions(draw, agents, spacing)}},
        lambda: {"heal": True},
        lambda: {"sabotage": sabotage(draw, agents)},
    ]
    return draw.among(kinds)()


def partition(draw: Draw, agents: int) -> Tables | list[list[int]]:
    """Return a partition of any kind."""
    mixed = draw.some(range(agents), agents)
    cuts = sorted(draw.some(range(1, agents), draw.whole(1, 3))) if agents > 1 else []
    groups = [mixed[a:b] for a, b in zip([0, *cuts], [*cuts, agents], strict=True)]
    if draw.chance(0.3):
        groups = groups[:-1] or groups
    kind = draw.among(("clean", "clean", "one_way", "bridge", "ring"))
    if kind == "clean" and draw.chance(0.5):
        return groups
    if kind == "bridge" and len(mixed) > 2:
        return {"groups": [mixed[:-1]], "kind": kind, "bridge": mixed[-1:]}
    return {"groups": groups, "kind": "clean" if kind == "bridge" else kind}


def flap(draw: Draw, agents: int) -> Tables:
    """Return links that come and go."""
    table: Tables = {"period_s": draw.scale(0.05, 8.0)}
    pairs = [[a, b] for a in range(agents) for b in range(agents) if a != b]
    if pairs and draw.chance(0.5):
        table["links"] = draw.some(pairs, draw.whole(1, 6))
    return table


def sabotage(draw: Draw, agents: int) -> Tables:
    """Return what somebody sends in the name of agents."""
    victims: list[int | str] = draw.some(range(agents), draw.whole(1, max(1, agents // 2)))
    table: Tables = {
        "kind": draw.among(("replay", "spoof", "garbage", "flood")),
        "agents": draw.among((victims, ["random:1"], ["vertex:V1"], ["all"])),
    }
    if table["kind"] == "replay":
        table["delay_s"] = draw.scale(0.01, 10.0)
    else:
        table["per_s"] = draw.scale(0.5, 100.0)
    return table
