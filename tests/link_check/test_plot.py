"""The picture of a link check: measured beside configured, or words where there is no data."""

import pytest
from matplotlib.axes import Axes

from netem.link import reception_probability
from netem.link_model import LinkModel
from netem.link_parameters import GilbertElliott, PathLoss
from worldsim.link_check.intervals import share_bound
from worldsim.link_check.parameter_sets import ParameterSet
from worldsim.link_check.plot import DISTANCES, PACKETS, draw

EDGE = PathLoss(3.0, 40.0, 66.0)


def row(link: LinkModel) -> list[Axes]:
    return draw([ParameterSet("local", 0, link)], seed=1).axes


def words(axes: Axes) -> list[str]:
    return [each.get_text() for each in axes.texts]


def test_a_link_that_loses_everything_has_words_instead_of_empty_axes() -> None:
    delays, bursts, _ = row(LinkModel(loss_percent=100.0))
    assert (words(delays), words(bursts)) == (["nothing was delivered"], ["longer than 40 frames"])
    assert [len(axes.get_yticks()) for axes in (delays, bursts)] == [0, 0]


def test_a_link_that_loses_nothing_has_no_bursts() -> None:
    delays, bursts, _ = row(LinkModel(delay_ms=10.0))
    assert (words(delays), words(bursts)) == ([], ["no losses"])


def test_shares_of_bursts_start_at_zero() -> None:
    _, bursts, _ = row(LinkModel(gemodel=GilbertElliott(5.0, 25.0)))
    assert words(bursts) == []
    assert bursts.get_ylim()[0] >= 0.0


@pytest.mark.parametrize(
    "link", [LinkModel(range_m=8.0, path_loss=EDGE), LinkModel(range_m=6.0), LinkModel()]
)
def test_reception_is_measured_along_its_curve(link: LinkModel) -> None:
    measured = {line.get_label(): line for line in row(link)[2].lines}["measured"]
    points = measured.get_xydata().tolist()
    assert len(points) == DISTANCES
    for distance_m, share in points:
        edge = link.path_loss
        within = reception_probability(edge, distance_m) if edge is not None else 1.0
        configured = within if distance_m <= link.range_m else 0.0
        assert abs(share - configured) <= share_bound(configured, PACKETS // DISTANCES) + 1e-9
