"""Components follow every link by itself, and a team is judged only by what its agents can know."""

from dataclasses import replace
from itertools import product
from math import inf

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agent.codec import add_checksum, encode
from agent.comms.neighbours import MAX_AGE_S
from agent.messages import Gossip
from netem.link_parameters import Conditions, DirectedLink, LinkKeys, PathLoss
from netem.rate_queue import RateQueue
from tests.agent.comms.builders import beacon, record
from tests.judge.test_held_formation import radio
from tests.recording.flights import straight_flight, wedge
from worldsim.engine.virtual import fly
from worldsim.judge.connectivity import LEAST_FRAME_B, Components, Connectivity
from worldsim.judge.radio_events import ConditionsChanged
from worldsim.judge.tick import Tick
from worldsim.scenario.file import parse

AGENTS = 5
LOSSES = (0.0, 30.0, 99.0, 100.0)
DEAF = """
name = "deaf"
seed = {seed}
duration_s = 25.0
[fleet]
agents = 4
[formation]
name = "line"
vertices = {{ V1 = [0, 0, 0] }}
queue = [{{ name = "Q", vertices = ["V1"], shape = {{ kind = "ray", direction = [-1, 0, 0] }} }}]
[netem]
range_m = 6.0
{links}
"""


def links_of(losses: dict[tuple[int, int], float]) -> tuple[DirectedLink, ...]:
    return tuple(DirectedLink(source=a, to=b, loss_percent=p) for (a, b), p in losses.items())


def components_under(conditions: Conditions, tick: Tick | None = None) -> Components:
    scenario = msgspec.structs.replace(wedge(AGENTS), netem=conditions)
    return Connectivity(scenario).components(tick or next(straight_flight(scenario)))


def reached(usable: set[tuple[int, int]]) -> list[set[int]]:
    """Return for each agent whom its news reaches, found by following links."""
    found = []
    for agent in range(AGENTS):
        known = {agent}
        while more := {b for a, b in usable if a in known} - known:
            known |= more
        found.append(known)
    return found


def parts(usable: set[tuple[int, int]]) -> list[list[int]]:
    """Return the groups of agents whose news reaches one another."""
    news = reached(usable)
    groups = {tuple(b for b in sorted(news[a]) if a in news[b]) for a in range(AGENTS)}
    return sorted(list(group) for group in groups)


losses_of_links = st.lists(
    st.sampled_from(LOSSES), min_size=AGENTS * (AGENTS - 1), max_size=AGENTS * (AGENTS - 1)
).map(
    lambda drawn: dict(
        zip(((a, b) for a, b in product(range(AGENTS), repeat=2) if a != b), drawn, strict=True)
    )
)


@given(losses=losses_of_links)
def test_components_are_those_whose_news_reaches_one_another(
    losses: dict[tuple[int, int], float],
) -> None:
    found = components_under(Conditions(link=links_of(losses)))
    usable = {pair for pair, percent in losses.items() if percent < 100.0}
    assert found.members() == parts(usable)
    for rows, closed in zip(found.members(), found.closed.tolist(), strict=True):
        foreign = any(b in rows and a not in rows for a, b in usable)
        assert closed is not foreign


@given(losses=losses_of_links)
def test_the_loss_is_of_the_worst_link_that_is_needed(
    losses: dict[tuple[int, int], float],
) -> None:
    found = components_under(Conditions(link=links_of(losses)))
    for percent in LOSSES[:-1]:
        usable = {pair for pair, lost in losses.items() if lost <= percent}
        holds = parts(usable) == found.members()
        assert holds is (percent >= 100.0 * found.loss - 1e-9)


@pytest.mark.parametrize("by_event", [False, True])
def test_links_that_an_event_changes_count_from_then_on(by_event: bool) -> None:
    deaf = links_of({(other, 3): 100.0 for other in range(AGENTS) if other != 3})
    scenario, change = wedge(AGENTS), Conditions(link=deaf)
    connectivity = Connectivity(scenario)
    if by_event:
        keys = msgspec.structs.asdict(change)
        connectivity.handle_event(
            ConditionsChanged(
                t_s=0.0, agent=None, planned=True, number=1, conditions=change, **keys
            )
        )
    found = connectivity.components(next(straight_flight(scenario)))
    assert len(found.members()) == (2 if by_event else 1)


@pytest.mark.parametrize("conditions", [
    Conditions(loss_percent=100.0),
    Conditions(corrupt_percent=100.0),
    Conditions(multihop=LinkKeys(loss_percent=100.0)),
    Conditions(path_loss=PathLoss(exponent=3.0, reference_loss_db=80.0, budget_db=40.0)),
    Conditions(multihop=LinkKeys(range_m=0.01)),
])  # fmt: skip
def test_agents_that_hear_nothing_are_components_of_their_own(conditions: Conditions) -> None:
    assert len(components_under(conditions).members()) == AGENTS


def test_path_loss_parts_a_team_where_nothing_gets_through() -> None:
    """Within reach, its loss is that of the distance."""
    edge = PathLoss(exponent=3.0, reference_loss_db=40.0, budget_db=60.0, shadowing_db=1.0)
    (tick, *_) = straight_flight(wedge(AGENTS))
    for far_m, together in ((4.0, True), (30.0, False)):
        position = np.array([[k * far_m, 0.0, 0.0] for k in range(AGENTS)])
        found = components_under(Conditions(path_loss=edge), replace(tick, position=position))
        assert (len(found.members()) == 1) is together
        assert 0.0 <= found.loss < 1.0


def violations(scenario: str) -> dict[str, int]:
    tallies = fly(parse(scenario)).loop.judge.invariants()
    return {name: tally.violations for name, tally in tallies.items() if tally.violations}


@pytest.mark.parametrize(("seed", "kind"), [*enumerate(("deaf", "mute", "both", "deaf", "both"))])
def test_an_agent_cut_off_by_its_links_is_nobodys_fault(seed: int, kind: str) -> None:
    """It claims a place that another has too, because it cannot know of the other."""
    agent = seed % 4
    others = [other for other in range(4) if other != agent]
    pairs = [(other, agent) for other in others] * (kind != "mute")
    pairs += [(agent, other) for other in others] * (kind != "deaf")
    tables = [f"[[netem.link]]\nfrom = {a}\nto = {b}\nloss_percent = 100" for a, b in pairs]
    assert violations(DEAF.format(seed=seed, links="\n".join(tables))) == {}


def test_a_team_that_is_cut_by_an_event_is_judged_by_its_parts() -> None:
    tables = ", ".join(f"{{ from = {a}, to = 3, loss_percent = 100 }}" for a in range(3))
    event = f"[[event]]\nat_s = 8.0\nfor_s = 10.0\nnetem = {{ link = [{tables}] }}"
    assert violations(DEAF.format(seed=7, links=event)) == {}


def test_the_shortest_frames_are_as_short_as_agents_can_send() -> None:
    empty = Gossip(id=0, stamp_s=0.0, records=(record(0, 0),), piece=None)
    shortest = [len(add_checksum(encode(each))) for each in (beacon(0, 0, 0.0), empty)]
    assert shortest == list(LEAST_FRAME_B)


@pytest.mark.parametrize(
    ("rate_kbit", "limit", "ends_s"),
    [(0.2, 1000, 0.0), (1.0, 1000, 5.206), (1.0, 3, inf), (20.0, 1000, 23.9), (26.0, 1000, inf)],
)
def test_a_queue_that_grows_ends_the_spread_of_news_when_its_frames_are_too_old(
    rate_kbit: float, limit: int, ends_s: float
) -> None:
    """Played back: beacons that enter a sender's queue at 20 Hz, and their age as they leave."""
    scenario = wedge(AGENTS)
    network = Connectivity(scenario)
    slow = Conditions(rate_kbit=rate_kbit, limit=limit)
    network.handle_event(radio((7.0, 0, slow))[0])
    tick = next(straight_flight(scenario))
    for at_s in (6.9, 7.0 + 0.99 * min(ends_s, 1e3), 7.0 + 1.01 * min(ends_s, 1e3)):
        passes = at_s < 7.0 + ends_s
        assert network.spreads(replace(tick, time_s=at_s)).local is passes
    queue, sent = RateQueue(), [0.05 * k for k in range(1200)]
    waits = {at_s: queue.enter(at_s, LEAST_FRAME_B[0], rate_kbit, limit) for at_s in sent}
    leaves = {at_s + wait: wait for at_s, wait in waits.items() if wait is not None}
    assert all(wait <= MAX_AGE_S for at_s, wait in leaves.items() if at_s < 0.95 * ends_s)
    assert all(wait > MAX_AGE_S for at_s, wait in leaves.items() if at_s > 1.05 * ends_s)
