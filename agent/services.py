"""Services: what the agent around a controller does by itself, for controllers that ask for it.

A controller names them in its class attribute ``services``; one without it asks for all. What it
does not ask for costs no byte on the air.
"""

from typing import Literal, NamedTuple, get_args

Service = Literal["beacons", "missions", "records", "hierarchy"]
"""beacons: the agent tells its state on the local channel, and hears its neighbours. missions: it
passes on missions that a neighbour lacks. records: it passes on the table of all members, where the
allocation or vehicles without sight need one. hierarchy: it sends a controller's Words."""
SERVICES: tuple[Service, ...] = get_args(Service)
ATTRIBUTE = "services"


class ServicesError(ValueError):
    """Services that do not exist, or that lack another one; the text says which."""


class Services(NamedTuple):
    """The services that one agent offers its controller."""

    beacons: bool
    missions: bool
    records: bool
    hierarchy: bool


def services_of(controller: type, chosen: tuple[str, ...] | None) -> Services:
    """Return the services for a controller. chosen: by the scenario, instead of its own wish.

    Raises ServicesError.
    """
    asked = getattr(controller, ATTRIBUTE, SERVICES) if chosen is None else chosen
    if isinstance(asked, str):
        raise ServicesError(f"{asked!r} is no list of services; ({asked!r},) is one")
    names = set(asked)
    for name in asked:
        if name not in SERVICES:
            raise ServicesError(f"{name!r} is no service; allowed: {', '.join(SERVICES)}")
    if names and "beacons" not in names:
        raise ServicesError(f"without 'beacons' there are no {', '.join(sorted(names))}")
    return Services(*(name in names for name in SERVICES))
