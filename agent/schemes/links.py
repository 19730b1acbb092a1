"""What a scheme needs to hear: links, as the comparison after Lemma 7 of the paper counts them.

Each scheme's module has a function ``links_needed``: which others a member must hear directly, in
its situation, in order to fly. Whether it hears them is another matter: needed links that are heard
are the ones that it uses. What the safety filter needs is not counted, as it is the same for all.
"""

from typing import NamedTuple

NOBODY = -1
"""Instead of an agent's id."""


class Situation(NamedTuple):
    """One member among its team at one time, all by id."""

    own: int
    team: frozenset[int]  # all members that fly, itself included
    same_queue: frozenset[int]
    """Those that it hears and whose place is on a queue of its own: R_c,i, whose size is N_c,i."""
    leader: int  # whom it follows in a fixed graph, NOBODY for none
    vertex_agent: int  # who holds the main queue vertex, NOBODY for none
