"""Which queues give members to which, by the shares of a team (queue level; Sec. 3, stage ii)."""

from collections.abc import Sequence

from agent.structure.queue_map import QueueMap


def transfers(
    formation: QueueMap, counts: Sequence[int], shares: Sequence[int]
) -> dict[int, list[int]]:
    """Return for each queue with too many members how many each other queue may take from it.

    Every agent with the same counts finds the same. counts, shares: members of each queue. The
    queues of one leader may all give to all that lack members, since it sees every candidate. Under
    several leaders each transfer has one giver, so that no two leaders fill one gap; the nearest
    queues come first.
    """
    missing = [share - counts[queue] for queue, share in enumerate(shares)]
    if missing == [0] * len(missing):
        return {}
    if len(set(formation.home)) == 1:
        takers = [max(0, each) for each in missing]
        return {giver: takers for giver, each in enumerate(missing) if each < 0 and any(takers)}
    found: dict[int, list[int]] = {}
    for giver, taker in formation.nearest_pairs:
        number = min(-missing[giver], missing[taker])
        if number > 0:
            found.setdefault(giver, [0] * len(counts))[taker] += number
            missing[giver] += number
            missing[taker] -= number
    return found
