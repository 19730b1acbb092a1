"""The parameter sets of a scenario: each different link that its radio has at any time."""

from collections.abc import Iterator
from typing import NamedTuple

from netem.conditions import NetworkConditions
from netem.faults import FaultOrder, RadioEvent
from netem.link_model import LinkModel
from netem.wire.channels import CHANNELS, NUMBERS, Channel
from worldsim.scenario.tables import Scenario


class ParameterSet(NamedTuple):
    """One link model of a scenario."""

    name: str
    """Which links have it, and from when on."""
    channel: Channel
    """The channel on which it is measured."""
    link: LinkModel


def parameter_sets(scenario: Scenario) -> list[ParameterSet]:
    """Return the different link models of a scenario, each once, in the order of its tables."""
    found: dict[LinkModel, ParameterSet] = {}
    for since, network in _networks(scenario):
        for each in _links(since, network):
            found.setdefault(each.link, each)
    return list(found.values())


def _networks(scenario: Scenario) -> Iterator[tuple[str, NetworkConditions]]:
    yield "", NetworkConditions(scenario.netem)
    for number, event in enumerate(scenario.event):
        if event.netem is not None:
            network = NetworkConditions(scenario.netem)
            network.apply(FaultOrder(number, event.at_s, RadioEvent.of(event.netem)))
            yield f", from {event.at_s:g} s on", network


def _links(since: str, network: NetworkConditions) -> Iterator[ParameterSet]:
    models = network.models
    for channel, name in zip(NUMBERS, CHANNELS, strict=True):
        yield ParameterSet(f"{name}{since}", channel, models.of_channel(channel))
    for link in network.conditions.link:
        for channel, name in zip(NUMBERS, CHANNELS, strict=True):
            model = models.of_link(channel, link.source, link.to)
            yield ParameterSet(f"{link.source} to {link.to}, {name}{since}", channel, model)
