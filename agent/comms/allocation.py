"""Who takes which place: one assignment that every agent solves over the agents it knows (E24).

The least sum of squared distances, where a place is cheaper by ``hysteresis_m2`` for the agent
that claims it. Agents that know the same find the same, with no negotiation and nobody in charge;
agents that know less find nearly the same, and the claims heard mend the rest.
"""

from collections.abc import Sequence
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
) -> dict[int, Place | None]:
    """Return a place for each member of the team, by id; None where there are too few.

    team: sorted by id; places, slots [m; world frame]: as many as the team has members, or fewer;
    in the same order in every agent. Claims come first, then the nearest pairs, then pairwise
    exchanges until none saves anything.
    """
    nowhere = [UNPLACED_M2] * (len(team) - len(places))
    squares = [[_square(peer.position, slot) for slot in slots] + nowhere for peer in team]
    column_of = {place: column for column, place in enumerate(places)}
    claims = _undisputed(team, column_of, squares)
    for row, column in enumerate(claims):
        if column is not None:
            squares[row][column] -= hysteresis_m2
    chosen = _filled(claims, squares)
    _exchange(chosen, squares)
    return {
        peer.id: places[column] if column < len(places) else None
        for peer, column in zip(team, chosen, strict=True)
    }


def own_place(
    own_id: int, team: Sequence[Peer], places: Sequence[Place], slots: Sequence[Vector]
) -> Place | None:
    """Return one member's place as :func:`allot` gives it, without solving what is settled.

    Where everybody claims a place and no two the same, only an exchange with oneself can concern
    one: that is looked at first, at a cost that grows with N instead of its square.
    """
    held = _settled(team, places)
    if held is not None and not _gains(own_id, team, held, slots):
        return places[held[own_id]]
    return allot(team, places, slots)[own_id]


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


def _undisputed(
    team: Sequence[Peer], column_of: dict[Place, int], squares: list[list[float]]
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
            theirs = _cost_m(team[rival], squares[rival][column])
            if _cost_m(peer, squares[row][column]) >= theirs - CONFLICT_M:
                continue
            kept[rival] = None
        holder[column] = row
        kept[row] = column
    return kept


def _cost_m(peer: Peer, square: float) -> float:
    return sqrt(square) if peer.cost_m is None else peer.cost_m


def _filled(claims: list[int | None], squares: list[list[float]]) -> list[int]:
    """Return a column for every row: the claimed one, else greedily the nearest pair first."""
    chosen = list(claims)
    taken = set(claims)
    open_rows = [row for row, column in enumerate(claims) if column is None]
    open_columns = [column for column in range(len(claims)) if column not in taken]
    pairs = sorted(
        (squares[row][column], row, column) for row in open_rows for column in open_columns
    )
    for _, row, column in pairs:
        if chosen[row] is None and column not in taken:
            chosen[row] = column
            taken.add(column)
    return [column for column in chosen if column is not None]


def _exchange(chosen: list[int], squares: list[list[float]]) -> None:
    """Exchange the columns of two rows wherever that saves something, until nothing does.

    In the order of the columns, not of the rows: who is called what decides nothing.
    """
    count = len(chosen)
    holders = sorted(range(count), key=chosen.__getitem__)
    improved = True
    while improved:
        improved = False
        for i in range(count):
            a = holders[i]
            row_a = squares[a]
            for j in range(i + 1, count):
                b = holders[j]
                row_b = squares[b]
                saved = row_a[i] + row_b[j] - row_a[j] - row_b[i]
                if saved > GAIN_M2 and saved > ROUNDING * (row_a[i] + row_b[j]):
                    holders[i], holders[j] = b, a
                    a, row_a = b, row_b
                    improved = True
    for column, row in enumerate(holders):
        chosen[row] = column


def _square(a: Vector, b: Vector) -> float:
    dx, dy, dz = a[0] - b[0], a[1] - b[1], a[2] - b[2]
    return dx * dx + dy * dy + dz * dz
