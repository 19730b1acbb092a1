"""Allocation of places: every agent solves one assignment over the agents it knows (E24).

It minimises the sum of squared distances; a place is cheaper by ``hysteresis_m2`` for the agent
that claims it. Agents with the same knowledge find the same assignment, without negotiation or a
leader. Agents with less knowledge find nearly the same, and the claims they hear settle the rest.
"""

from collections.abc import Container, Sequence
from heapq import heapify, heappop, heapreplace
from math import sqrt
from typing import Final

from agent.controller import Peer
from agent.messages import Place, Vector

HYSTERESIS_M2: Final = 0.5
CONFLICT_M: Final = 0.05
"""Of two agents that claim one place, the nearer by more than this keeps it, else the lower id."""
GAIN_M2: Final = 1e-9
UNPLACED_M2: Final = 0.0
"""Cost of having no place: the same for every agent, so that the nearest get the places."""
ROUNDING: Final = 1e-12
"""Least saving of an exchange, as a share of its cost before. Far from the origin, sums of squares
round by more than GAIN_M2, and two exchanges that seem to save could undo each other for ever."""


def allocate(
    team: Sequence[Peer],
    places: Sequence[Place],
    slots: Sequence[Vector],
    hysteresis_m2: float = HYSTERESIS_M2,
    exchange_ids: Container[int] | None = None,
) -> dict[int, Place | None]:
    """Return the place of each team member, by id; None where there are too few places.

    team: sorted by id. places and their slots [m; world frame]: at most as many as team members, in
    the same order in every agent. Claims come first, then the nearest pairs, then pairwise
    exchanges until none saves anything. exchange_ids: members whose exchanges are tried in addition
    to those of members without an undisputed claim; None: all members.
    """
    claims = _undisputed(team, {place: column for column, place in enumerate(places)}, slots)
    costs = _Costs([peer.position for peer in team], slots, claims, hysteresis_m2)
    chosen = _filled_greedily(claims, costs)
    to_try = {
        chosen[row]
        for row, peer in enumerate(team)
        if exchange_ids is None or claims[row] is None or peer.id in exchange_ids
    }
    _exchange(chosen, costs, to_try)
    return {
        peer.id: places[column] if column < len(places) else None
        for peer, column in zip(team, chosen, strict=True)
    }


def own_place(
    own_id: int, team: Sequence[Peer], places: Sequence[Place], slots: Sequence[Vector]
) -> Place | None:
    """Return one member's place, nearly as :func:`allocate` gives it but at less cost.

    It tries only exchanges of this member, of members without an undisputed claim, and of those
    whom these displace. Two other members with claims find their own exchange and announce it. If
    the claims share out all places, the cost is N steps.
    """
    held = _columns_if_settled(team, places)
    if held is not None and not _has_gainful_exchange(own_id, team, held, slots):
        return places[held[own_id]]
    exchange_ids = (own_id,) if held is None else None
    return allocate(team, places, slots, exchange_ids=exchange_ids)[own_id]


def _columns_if_settled(team: Sequence[Peer], places: Sequence[Place]) -> dict[int, int] | None:
    """Return each member's claimed column, by id; None unless the claims share out all places."""
    if len(places) != len(team):
        return None
    column_of = {place: column for column, place in enumerate(places)}
    held: dict[int, int] = {}
    for peer in team:
        column = column_of.pop(peer.place, None) if peer.place is not None else None
        if column is None:
            return None
        held[peer.id] = column
    return held


def _has_gainful_exchange(
    own_id: int, team: Sequence[Peer], held: dict[int, int], slots: Sequence[Vector]
) -> bool:
    """Whether an exchange between the own agent and another would save something."""
    me = next(peer.position for peer in team if peer.id == own_id)
    mine = slots[held[own_id]]
    kept = _squared_distance(me, mine) - 2.0 * HYSTERESIS_M2
    for peer in team:
        if peer.id != own_id:
            theirs = slots[held[peer.id]]
            now = kept + _squared_distance(peer.position, theirs)
            saved = now - _squared_distance(me, theirs) - _squared_distance(peer.position, mine)
            if saved > GAIN_M2:
                return True
    return False


class _Costs:
    """Cost of each column (place) for each row (member) [m^2], computed on demand.

    It is the squared distance, less the hysteresis for the row that claims the column.
    """

    def __init__(
        self,
        positions: Sequence[Vector],
        slots: Sequence[Vector],
        claims: Sequence[int | None],
        hysteresis_m2: float,
    ) -> None:
        self._positions = positions
        self._slots = slots
        self._claims = claims
        self.hysteresis_m2 = hysteresis_m2
        self._rows: dict[int, list[float]] = {}

    def row(self, row: int) -> list[float]:
        """Return the cost of every column for one row [m^2]."""
        found = self._rows.get(row)
        if found is None:
            found = self._rows[row] = self._row(row)
        return found

    def of(self, row: int, column: int) -> float:
        """Return the cost of one column for one row [m^2]."""
        known = self._rows.get(row)
        if known is not None:
            return known[column]
        if column >= len(self._slots):
            return UNPLACED_M2
        cost = _squared_distance(self._positions[row], self._slots[column])
        return cost - self.hysteresis_m2 if self._claims[row] == column else cost

    def _row(self, row: int) -> list[float]:
        nowhere = [UNPLACED_M2] * (len(self._positions) - len(self._slots))
        found = _squared_distances(self._positions[row], self._slots) + nowhere
        claimed = self._claims[row]
        if claimed is not None:
            found[claimed] -= self.hysteresis_m2
        return found


def _undisputed(
    team: Sequence[Peer], column_of: dict[Place, int], slots: Sequence[Vector]
) -> list[int | None]:
    """Return each row's claim, with at most one row for a column.

    The nearer row keeps a claim if the difference exceeds noise, else the lower id. The distances
    compared are those each reported of the moment it claimed: known positions of others are old,
    and each of two agents in flight would find itself the nearer.
    """
    holder: dict[int, int] = {}
    kept: list[int | None] = [None] * len(team)
    for row, peer in enumerate(team):
        column = column_of.get(peer.place) if peer.place is not None else None
        if column is None:
            continue
        rival = holder.get(column)
        if rival is not None:
            slot = slots[column]
            if (
                _claimed_distance_m(peer, slot)
                >= _claimed_distance_m(team[rival], slot) - CONFLICT_M
            ):
                continue
            kept[rival] = None
        holder[column] = row
        kept[row] = column
    return kept


def _claimed_distance_m(peer: Peer, slot: Vector) -> float:
    return sqrt(_squared_distance(peer.position, slot)) if peer.cost_m is None else peer.cost_m


def _filled_greedily(claims: Sequence[int | None], costs: _Costs) -> list[int]:
    """Return a column for every row: the claimed one, else the nearest pairs first."""
    chosen = list(claims)
    taken = {column for column in claims if column is not None}
    free = [column for column in range(len(claims)) if column not in taken]
    nearest = [(*_cheapest(costs.row(row), free), row) for row in _rows_without_claim(claims)]
    heapify(nearest)
    while nearest:
        _, column, row = nearest[0]
        if column in taken:
            free = [column for column in free if column not in taken]
            heapreplace(nearest, (*_cheapest(costs.row(row), free), row))
        else:
            heappop(nearest)
            chosen[row] = column
            taken.add(column)
    return [column for column in chosen if column is not None]


def _rows_without_claim(claims: Sequence[int | None]) -> list[int]:
    """Return the rows without a claim."""
    return [row for row, column in enumerate(claims) if column is None]


def _cheapest(costs: Sequence[float], columns: Sequence[int]) -> tuple[float, int]:
    """Return the least cost among some columns, and the first column that has it."""
    return min([(costs[column], column) for column in columns])


def _exchange(chosen: list[int], costs: _Costs, pending: set[int]) -> None:
    """Exchange the columns of two rows wherever that saves something, until nothing does.

    pending: the columns to try; exchanged columns are tried again. The order is that of the
    columns, so that agent ids decide nothing.
    """
    holders = sorted(range(len(chosen)), key=chosen.__getitem__)
    held = [costs.of(row, column) for column, row in enumerate(holders)]
    while pending:
        column = min(pending)
        other = _best_exchange(column, holders, held, costs)
        if other is None:
            pending.remove(column)
            continue
        pending.add(other)
        a, b = holders[column], holders[other]
        holders[column], holders[other] = b, a
        held[column], held[other] = costs.row(b)[column], costs.row(a)[other]
    for column, row in enumerate(holders):
        chosen[row] = column


def _best_exchange(column: int, holders: list[int], held: list[float], costs: _Costs) -> int | None:
    """Return the column whose exchange with this one saves most; None where none saves.

    holders: the row of each column; held: the column's cost for that row [m^2].
    """
    mine, kept = costs.row(holders[column]), held[column]
    # A farther column saves nothing: a cost is at least minus the hysteresis.
    bound = kept + costs.hysteresis_m2
    near = [
        other
        for other, (cost, theirs) in enumerate(zip(mine, held, strict=True))
        if cost - theirs < bound
    ]
    best, found = GAIN_M2, None
    for other in near:
        before = kept + held[other]
        saved = before - mine[other] - costs.of(holders[other], column)
        if saved > best and saved > ROUNDING * before:
            best, found = saved, other
    return found


def _squared_distances(here: Vector, there: Sequence[Vector]) -> list[float]:
    x, y, z = here
    return [(dx := x - a) * dx + (dy := y - b) * dy + (dz := z - c) * dz for a, b, c in there]


def _squared_distance(a: Vector, b: Vector) -> float:
    dx, dy, dz = a[0] - b[0], a[1] - b[1], a[2] - b[2]
    return dx * dx + dy * dy + dz * dz
