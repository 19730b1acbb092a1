"""Who takes which place: one assignment that every agent solves over the agents it knows (E24).

The least sum of squared distances, where a place is cheaper by ``hysteresis_m2`` for the agent
that claims it. Agents that know the same find the same, with no negotiation and nobody in charge;
agents that know less find nearly the same, and the claims heard mend the rest.
"""

from collections.abc import Container, Sequence
from heapq import heapify, heappop, heapreplace
from math import sqrt

from agent.controller import Peer
from agent.messages import Place, Vector

HYSTERESIS_M2 = 0.5
CONFLICT_M = 0.05
"""Two that claim one place: the nearer by more than this keeps the claim, else the lower id."""
GAIN_M2 = 1e-9
UNPLACED_M2 = 0.0
"""What it costs to have no place: the same for all, so that the nearest get the places."""
ROUNDING = 1e-12
"""An exchange saves this share of what it costs at least: far from home, sums of squares round by
more than GAIN_M2, and two exchanges that seem to save something could undo each other for ever."""


def allot(
    team: Sequence[Peer],
    places: Sequence[Place],
    slots: Sequence[Vector],
    hysteresis_m2: float = HYSTERESIS_M2,
    concerned: Container[int] | None = None,
) -> dict[int, Place | None]:
    """Return a place for each member of the team, by id; None where there are too few.

    team: sorted by id; places, slots [m; world frame]: as many as the team has members, or fewer;
    in the same order in every agent. Claims come first, then the nearest pairs, then pairwise
    exchanges until none saves anything. concerned: ids of those whose exchanges are looked at
    besides those of members without an undisputed claim; everybody's when left out.
    """
    claims = _undisputed(team, {place: column for column, place in enumerate(places)}, slots)
    costs = _Costs([peer.position for peer in team], slots, claims, hysteresis_m2)
    chosen = _filled(claims, costs)
    looked_at = {
        chosen[row]
        for row, peer in enumerate(team)
        if concerned is None or claims[row] is None or peer.id in concerned
    }
    _exchange(chosen, costs, looked_at)
    return {
        peer.id: places[column] if column < len(places) else None
        for peer, column in zip(team, chosen, strict=True)
    }


def own_place(
    own_id: int, team: Sequence[Peer], places: Sequence[Place], slots: Sequence[Vector]
) -> Place | None:
    """Return one member's place much as :func:`allot` gives it, without solving what is settled.

    Exchanges are looked at where they concern oneself, or who has no undisputed claim, or whom
    these displace. Two others with claims see for themselves what they would save, and say so.
    Where everybody has one, that is a matter of N steps.
    """
    held = _settled(team, places)
    if held is not None and not _gains(own_id, team, held, slots):
        return places[held[own_id]]
    concerned = (own_id,) if held is None else None
    return allot(team, places, slots, concerned=concerned)[own_id]


def _settled(team: Sequence[Peer], places: Sequence[Place]) -> dict[int, int] | None:
    """Return the column each member claims, by id, if the claims share out all places."""
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


def _gains(
    own_id: int, team: Sequence[Peer], held: dict[int, int], slots: Sequence[Vector]
) -> bool:
    """Whether an exchange between oneself and another would save something."""
    me = next(peer.position for peer in team if peer.id == own_id)
    mine = slots[held[own_id]]
    kept = _square(me, mine) - 2.0 * HYSTERESIS_M2
    for peer in team:
        if peer.id != own_id:
            theirs = slots[held[peer.id]]
            now = kept + _square(peer.position, theirs)
            if now - _square(me, theirs) - _square(peer.position, mine) > GAIN_M2:
                return True
    return False


class _Costs:
    """What columns cost rows [m^2]: squared distances, less the hysteresis for who claims one.

    Found where it is asked for.
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
        """Return what every column costs one row."""
        found = self._rows.get(row)
        if found is None:
            found = self._rows[row] = self._row(row)
        return found

    def of(self, row: int, column: int) -> float:
        """Return what a column costs a row."""
        known = self._rows.get(row)
        if known is not None:
            return known[column]
        if column >= len(self._slots):
            return UNPLACED_M2
        cost = _square(self._positions[row], self._slots[column])
        return cost - self.hysteresis_m2 if self._claims[row] == column else cost

    def _row(self, row: int) -> list[float]:
        nowhere = [UNPLACED_M2] * (len(self._positions) - len(self._slots))
        found = _squares(self._positions[row], self._slots) + nowhere
        claimed = self._claims[row]
        if claimed is not None:
            found[claimed] -= self.hysteresis_m2
        return found


def _undisputed(
    team: Sequence[Peer], column_of: dict[Place, int], slots: Sequence[Vector]
) -> list[int | None]:
    """Return each row's claim, with at most one row to a column.

    The nearer keeps a claim, if by more than noise, else the lower id. How near is what each says
    of the moment it claimed: what is known of the other's present position is old, and each of
    two in flight would find itself the nearer.
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
            if _cost_m(peer, slot) >= _cost_m(team[rival], slot) - CONFLICT_M:
                continue
            kept[rival] = None
        holder[column] = row
        kept[row] = column
    return kept


def _cost_m(peer: Peer, slot: Vector) -> float:
    return sqrt(_square(peer.position, slot)) if peer.cost_m is None else peer.cost_m


def _filled(claims: Sequence[int | None], costs: _Costs) -> list[int]:
    """Return a column for every row: the claimed one, else greedily the nearest pair first."""
    chosen = list(claims)
    taken = {column for column in claims if column is not None}
    free = [column for column in range(len(claims)) if column not in taken]
    nearest = [(*_cheapest(costs.row(row), free), row) for row in _open(claims)]
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


def _open(claims: Sequence[int | None]) -> list[int]:
    """Return the rows without a claim."""
    return [row for row, column in enumerate(claims) if column is None]


def _cheapest(costs: Sequence[float], columns: Sequence[int]) -> tuple[float, int]:
    """Return the least cost of some columns, and the first of which it is."""
    return min([(costs[column], column) for column in columns])


def _exchange(chosen: list[int], costs: _Costs, pending: set[int]) -> None:
    """Exchange the columns of two rows wherever that saves something, until nothing does.

    pending: the columns looked at, and after them those exchanged; in the order of the columns, not
    of the rows: who is called what decides nothing.
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
    """Return the column that its holder best exchanges this one for; None where none saves.

    holders: the row of each column; held: what it costs that row [m^2].
    """
    mine, kept = costs.row(holders[column]), held[column]
    # What lies farther saves nothing: a cost is at least minus the hysteresis.
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


def _squares(here: Vector, there: Sequence[Vector]) -> list[float]:
    x, y, z = here
    return [(dx := x - a) * dx + (dy := y - b) * dy + (dz := z - c) * dz for a, b, c in there]


def _square(a: Vector, b: Vector) -> float:
    dx, dy, dz = a[0] - b[0], a[1] - b[1], a[2] - b[2]
    return dx * dx + dy * dy + dz * dz
