"""The guide proposes the same for the same scores, and learns where scores are low."""

from worldsim.search.draws import GeneDraw, Genes
from worldsim.search.guide import GENERATION, Guide

NAMES = ("team/1", "event/0/1", "event/0/2")


def score(genes: Genes) -> float:
    """Return a score that is low in a corner."""
    return sum(genes[name] for name in NAMES)


def proposals(generations: int) -> list[Genes]:
    """Return what a guide proposes, generation after generation, in which it learns."""
    guide, made = Guide(7), list[Genes]()
    for _ in range(generations):
        proposed = [guide.propose() for _ in range(GENERATION)]
        genes = [{name: each[name] for name in NAMES} for each in proposed]
        for each, its in zip(proposed, genes, strict=True):
            guide.withdraw(each)
            guide.learn(its, score(its))
        made += genes
    return made


def test_the_same_scores_lead_to_the_same_proposals_which_come_nearer() -> None:
    made = proposals(4)
    assert made == proposals(4)
    first, last = made[:GENERATION], made[-GENERATION:]
    assert sum(map(score, last)) < 0.6 * sum(map(score, first))


def test_other_parts_stay_random() -> None:
    draw = GeneDraw("seed", given=Guide(7).propose())
    unguided = draw.part("formation").number(0.0, 1.0, 9)
    assert unguided == GeneDraw("seed").part("formation").number(0.0, 1.0, 9)
    assert draw.part("event", 0).number(0.0, 1.0, 9) != GeneDraw("seed").part("event", 0).number(
        0.0, 1.0, 9
    )
