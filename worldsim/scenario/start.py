"""The start of a fleet: drawn in a box, or listed vehicle by vehicle."""

from typing import Annotated

from msgspec import Meta

from agent.config import Table
from agent.messages import FlightPosition

Extent = Annotated[float, Meta(ge=0, le=1e5)]
"""A length [m] that may be zero."""
Degrees = Annotated[float, Meta(ge=-360, le=360)]


class BoxStart(Table, frozen=True, tag="box", tag_field="kind"):
    """Random positions in a box, at least ``spacing_m`` apart, with random headings."""

    centre_m: FlightPosition = (0.0, 0.0, 0.0)  # world frame
    size_m: tuple[Extent, Extent, Extent] = (5.0, 5.0, 3.0)  # along x, y, z
    spacing_m: Extent = 0.6


class ListStart(Table, frozen=True, tag="list", tag_field="kind"):
    """A position, and if given a heading, for each agent; without headings all are 0."""

    positions_m: tuple[FlightPosition, ...]  # world frame
    yaws_deg: tuple[Degrees, ...] | None = None  # from +x towards +y
