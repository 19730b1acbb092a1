"""The parameters of a link, declared once: key, unit, bounds and default.

A scenario's tables (``LinkKeys``) and the medium's models (``netem.link_model.LinkModel``) both
have the fields of ``LinkParameters``. Names and units are those of tc-netem and ns-3.
"""

from math import inf
from typing import Annotated, Any, Generic, Literal, NamedTuple, TypeVar, get_type_hints

import msgspec
from msgspec import Meta

from netem.wire.frame import AgentId

LEAST = 0.001
"""Least value of a quantity that must be above 0, in the unit of its key."""
MIN_RATE_KBIT = 0.001
"""A byte takes 8 s; at a lower rate a frame would be on the air longer than any flight."""

Metres = Annotated[float, Meta(ge=LEAST, le=1e6)]
Milliseconds = Annotated[float, Meta(ge=0, le=60_000)]
Percent = Annotated[float, Meta(ge=0, le=100)]
Correlation = Annotated[float, Meta(ge=0, lt=100)]
Distribution = Literal["uniform", "normal", "pareto", "paretonormal"]
RateKbit = Annotated[float, Meta(ge=MIN_RATE_KBIT, le=1e9)]
OverheadB = Annotated[int, Meta(ge=0, le=10_000)]
QueueLimit = Annotated[int, Meta(ge=1, le=1_000_000)]

Absent = TypeVar("Absent")
"""What a field is when no value is given: None in a scenario's table; Never in a model."""
LEFT_OUT: Any = None


class Parameter(NamedTuple):
    """What holds for a parameter of a link beside its type and bounds."""

    default: Any
    """The value where no table gives one."""
    of_sender: bool = False
    """Whether it belongs to the sender's queue; a link that sets it has a queue of its own."""


class Table(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A table of the radio's conditions; unknown keys are refused."""


class GilbertElliott(Table, frozen=True):
    """Losses in bursts: the Gilbert-Elliott model (tc-netem's p, r, 1-h, 1-k).

    A link is in a good or a bad state. p_percent: chance to turn bad, for each frame.
    r_percent: chance to turn good again; a burst lasts 100 / r_percent frames on average.
    loss_bad_percent, loss_good_percent: share of frames lost in each state.
    """

    p_percent: Percent
    r_percent: Percent
    loss_bad_percent: Percent = 100.0
    loss_good_percent: Percent = 0.0


class PathLoss(Table, frozen=True):
    """A soft edge of the range: log-distance path loss with log-normal shadowing for each frame.

    The loss over d [m] is reference_loss_db + 10 exponent log10(d / reference_distance_m), and at
    least reference_loss_db. budget_db: the loss at which half of the frames are received.
    shadowing_db: the standard deviation of the shadowing.
    """

    exponent: Annotated[float, Meta(ge=LEAST, le=10)]
    reference_loss_db: Annotated[float, Meta(ge=0, le=300)]
    budget_db: Annotated[float, Meta(ge=0, le=300)]
    reference_distance_m: Metres = 1.0
    shadowing_db: Annotated[float, Meta(ge=LEAST, le=50)] = 4.0


class LinkParameters(msgspec.Struct, Generic[Absent], frozen=True, forbid_unknown_fields=True):
    """All parameters of a link. To add one, declare it here, give it its effect in netem.link."""

    range_m: Annotated[Metres | Absent, Parameter(inf)] = LEFT_OUT
    """d_c [m]: hard limit of the distance between sender and receiver."""
    delay_ms: Annotated[Milliseconds | Absent, Parameter(0.0)] = LEFT_OUT
    """Mean delay [ms]."""
    jitter_ms: Annotated[Milliseconds | Absent, Parameter(0.0)] = LEFT_OUT
    """Scale of the random part of the delay [ms]; the sum is never negative."""
    delay_correlation_percent: Annotated[Correlation | Absent, Parameter(0.0)] = LEFT_OUT
    """Correlation of a frame's jitter with that of the link's frame before [%]."""
    distribution: Annotated[Distribution | Absent, Parameter("uniform")] = LEFT_OUT
    """Shape of the jitter: a key of ``random_draws.SHAPES``."""
    loss_percent: Annotated[Percent | Absent, Parameter(0.0)] = LEFT_OUT
    """Independent losses [% of frames]; a frame must also pass ``gemodel``."""
    duplicate_percent: Annotated[Percent | Absent, Parameter(0.0)] = LEFT_OUT
    """Frames that are sent twice [%]."""
    corrupt_percent: Annotated[Percent | Absent, Parameter(0.0)] = LEFT_OUT
    """Frames that arrive with one bit flipped [%]."""
    reorder_percent: Annotated[Percent | Absent, Parameter(0.0)] = LEFT_OUT
    """Frames that skip the delay and so overtake earlier ones [%]."""
    rate_kbit: Annotated[RateKbit | Absent, Parameter(inf, of_sender=True)] = LEFT_OUT
    """Rate at which frames leave the sender's queue [kbit/s]."""
    rate_overhead_b: Annotated[OverheadB | Absent, Parameter(0, of_sender=True)] = LEFT_OUT
    """Bytes that a frame takes in addition to its payload [B]."""
    limit: Annotated[QueueLimit | Absent, Parameter(1000, of_sender=True)] = LEFT_OUT
    """Length of the sender's queue [frames]; the default is tc-netem's."""
    gemodel: GilbertElliott | None = None
    """Losses in bursts."""
    path_loss: PathLoss | None = None
    """A soft edge within ``range_m``."""


def _declared() -> dict[str, Parameter]:
    hints = get_type_hints(LinkParameters, include_extras=True)
    return {
        key: note
        for key in LinkParameters.__struct_fields__
        for note in getattr(hints[key], "__metadata__", ())
        if isinstance(note, Parameter)
    }


DEFAULTS = {key: parameter.default for key, parameter in _declared().items()}
"""The value of each key that no table gives; keys that are missing here default to None."""
RATE_KEYS = tuple(key for key, parameter in _declared().items() if parameter.of_sender)
"""Keys of the sender's queue, one queue for each sender and channel."""


class LinkKeys(LinkParameters[None], frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """Keys of a link; a key that is left out has the value of the table around it."""


class DirectedLink(LinkKeys, frozen=True, kw_only=True, rename={"source": "from"}):
    """One directed link's own values."""

    source: AgentId
    to: AgentId


class Conditions(LinkKeys, frozen=True):
    """The radio's conditions: both channels, a channel's own values, a link's own values."""

    local: LinkKeys = LinkKeys()
    multihop: LinkKeys = LinkKeys()
    link: tuple[DirectedLink, ...] = ()
