"""Where vehicles start: drawn in a box, or given one by one."""

from typing import Annotated

from msgspec import Meta

from agent.config import Table
from agent.messages import Metres

Triple = tuple[Metres, Metres, Metres]
Extent = Annotated[float, Meta(ge=0, le=1e5)]
Degrees = Annotated[float, Meta(ge=-360, le=360)]


class BoxStart(Table, frozen=True, tag="box", tag_field="kind"):
    """Random starts in a box, at least ``spacing_m`` apart, with random headings."""

    centre_m: Triple = (0.0, 0.0, 0.0)
    size_m: tuple[Extent, Extent, Extent] = (5.0, 5.0, 3.0)
    spacing_m: Extent = 0.6


class ListStart(Table, frozen=True, tag="list", tag_field="kind"):
    """Starts given one by one; headings left out are 0."""

    positions_m: tuple[Triple, ...]
    yaws_deg: tuple[Degrees, ...] | None = None
