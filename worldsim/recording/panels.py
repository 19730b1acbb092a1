"""The panels of plain words: what is flown, what a view draws, and what its colours mean.

There is a panel for each question that a tab of the layout answers.
"""

from collections.abc import Sequence
from math import isfinite

from netem.conditions import LinkModels
from netem.wire.channels import LOCAL
from worldsim.recording import palette
from worldsim.scenario.tables import Scenario
from worldsim.scenario.target_frame import path_of

MAX_QUEUES = 16
"""Of more queues, the first are listed."""
MOTION, NETWORK, STRUCTURE, FAULTS = "motion", "network", "structure", "faults"
QUESTIONS = {
    MOTION: "How does the team move, and does it keep clear?",
    NETWORK: "Who hears whom, and where does the network fail?",
    STRUCTURE: "Who leads whom, and who takes which place?",
    FAULTS: "What goes wrong, and for how long?",
}
"""The question that each tab answers, by its name."""
FORMING = "q_structure"
"""The controller that is known to take up formations."""
SYMBOLS = {
    MOTION: "Box with an arrow: a vehicle and its nose. Trail: its last 4 s, in the colour that it"
    " had. Brown: an obstacle. Red lines in the plots: limits.",
    NETWORK: "Grey line: one hears the other. Amber: within range, but not heard. Red: cut by a"
    " fault. Disc: the side of a partition (A white, B grey). Red sphere: a jam. Violet line:"
    " from a vehicle to where a neighbour takes it to be. Pairs out of range are hidden.",
    STRUCTURE: "A queue is a line of slots behind a vertex. The agent at a vertex leads: its label"
    " says so. Thick line: from an agent to the one that it follows, gold in tier 1, then paler."
    " Large dot: where an agent flies to.",
    FAULTS: "White cross: dead. Hollow box: paused. Disc: the side of a partition (A white, B"
    " grey). Red sphere: a jam. A label says what is wrong with its agent.",
}
"""What a tab's 3D view draws."""
FORMATION_SYMBOLS = "Wire sphere: a slot; an agent in it is in place. Thin line: a queue."
UNJUDGED = "The verdict comes when the run has ended: this recording has not, or was cut off."


def panel(question: str, scenario: Scenario, colours: str) -> str:
    """Return the panel of a tab as Markdown; colours: what they mean at present."""
    slots = question != NETWORK and scenario.control.controller == FORMING
    return "\n\n".join(
        [
            f"**{QUESTIONS[question]}**",
            f"{flown(scenario)} {radio(scenario)}",
            f"{SYMBOLS[question]} {FORMATION_SYMBOLS if slots else ''}".strip(),
            colours,
        ]
    )


def flown(scenario: Scenario) -> str:
    """Return what a scenario flies, as a sentence."""
    fleet, control = scenario.fleet, scenario.control
    moves = ", in a frame that moves" if len(path_of(scenario.frame).waypoints) > 1 else ""
    known = control.controller == FORMING
    formation = f", from the formation {scenario.formation.name} on" if known else ""
    return (
        f"Scenario {scenario.name}: {fleet.agents} agents fly {scenario.duration_s:g} s under"
        f" {control.controller}{formation}{moves}."
    )


def radio(scenario: Scenario) -> str:
    """Return the radio's conditions at the start, as a sentence."""
    model = LinkModels(scenario.netem).of_channel(LOCAL)
    reach = f"{model.reach_m:g} m of range" if isfinite(model.reach_m) else "no limit of range"
    jitter = f" +- {model.jitter_ms:g}" if model.jitter_ms else ""
    delay = [f"{model.delay_ms:g}{jitter} ms of delay"] if model.delay_ms or jitter else []
    loss = [f"{model.loss_percent:g} % of frames lost"] if model.loss_percent else []
    bursts = ["losses in bursts"] if model.gemodel is not None else []
    rate = [f"{model.rate_kbit:g} kbit/s"] if isfinite(model.rate_kbit) else []
    clean = [] if loss or bursts else ["no losses"]
    return f"Radio: {', '.join([reach, *delay, *loss, *bursts, *rate, *clean])}."


def queue_colours(formation: str, queues: Sequence[str]) -> str:
    """Return what colours mean in a formation, by its name and the names of its queues."""
    names = [f"{_colour(index)} {name}" for index, name in enumerate(queues)]
    more = [f"{len(names) - MAX_QUEUES} more"] if len(names) > MAX_QUEUES else []
    listed = ", ".join([*names[:MAX_QUEUES], *more])
    return (
        f"**Now: {formation}.** Colours are its queues: {listed}; gold: the vertex that queues"
        " share; pale: no place yet; red: a vehicle in distress, without a place."
    )


def agent_colours() -> str:
    """Return what colours mean where no agent has claimed a place."""
    return "No formation: each agent has a colour of its own, in its label and its curves."


def verdict(texts: Sequence[str]) -> str:
    """Return the verdict of a run as Markdown: one text for each expectation."""
    return "\n".join(f"- {text}" for text in texts) if texts else "Nothing was expected."


def _colour(queue: int) -> str:
    names = palette.QUEUE_COLOUR_NAMES
    return names[queue % len(names)]
