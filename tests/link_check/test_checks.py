"""Every parameter of a link, 100 000 packets each, within its 99.9 % interval."""

from pathlib import Path

import msgspec
import numpy as np
import pytest

from netem.link import mean_loss
from netem.link_model import LinkModel
from netem.link_parameters import GilbertElliott, PathLoss
from worldsim.link_check.checks import Finding, findings
from worldsim.link_check.intervals import kolmogorov_smirnov, loss_bound
from worldsim.link_check.packets import Flight, conditions_of
from worldsim.link_check.parameter_sets import parameter_sets
from worldsim.scenario.file import load

LATE = {"delay_ms": 200.0, "jitter_ms": 40.0}
LINKS = {
    "clean": LinkModel(range_m=6.0, delay_ms=20.0),
    "half lost, late": LinkModel(loss_percent=50.0, **LATE),
    "normal": LinkModel(distribution="normal", **LATE),
    "pareto": LinkModel(distribution="pareto", **LATE),
    "paretonormal": LinkModel(distribution="paretonormal", **LATE),
    "never before it was sent": LinkModel(delay_ms=10.0, jitter_ms=40.0, distribution="normal"),
    "correlated": LinkModel(delay_correlation_percent=60.0, **LATE),
    "bursts": LinkModel(gemodel=GilbertElliott(2.0, 20.0)),
    "mixed bursts": LinkModel(gemodel=GilbertElliott(5.0, 30.0, 80.0, 2.0), loss_percent=10.0),
    "alternating bursts": LinkModel(gemodel=GilbertElliott(70.0, 90.0)),
    "rare": LinkModel(duplicate_percent=5.0, corrupt_percent=3.0, loss_percent=20.0),
    "reordered": LinkModel(delay_ms=100.0, reorder_percent=25.0),
    "reordered, shaped": LinkModel(reorder_percent=10.0, distribution="pareto", **LATE),
    "soft edge": LinkModel(path_loss=PathLoss(2.7, 40.0, 65.0, shadowing_db=6.0)),
    "rate": LinkModel(rate_kbit=250.0, rate_overhead_b=42, limit=50),
}


@pytest.mark.parametrize("link", LINKS.values(), ids=LINKS)
def test_every_parameter_is_within_its_interval(link):
    found = list(findings(link, seed=1))
    assert found
    assert [finding for finding in found if not finding.ok] == []


@pytest.mark.parametrize(
    ("actual", "configured"),
    [
        (LinkModel(loss_percent=49.0), LinkModel(loss_percent=50.0)),
        (
            LinkModel(gemodel=GilbertElliott(2.4, 20.0)),
            LinkModel(gemodel=GilbertElliott(2.0, 20.0)),
        ),
        (LinkModel(delay_ms=9.0), LinkModel(delay_ms=10.0)),
        (LinkModel(jitter_ms=9.0, delay_ms=50.0), LinkModel(jitter_ms=10.0, delay_ms=50.0)),
        (LinkModel(duplicate_percent=4.5), LinkModel(duplicate_percent=5.0)),
        (LinkModel(corrupt_percent=5.5), LinkModel(corrupt_percent=5.0)),
        (LinkModel(rate_kbit=101.0), LinkModel(rate_kbit=100.0)),
        (LinkModel(range_m=5.9), LinkModel(range_m=6.0)),
    ],
)
def test_a_link_with_another_value_is_detected(monkeypatch, actual, configured):
    conditions = conditions_of(configured)

    def other(model):
        return conditions_of(actual if conditions_of(model) == conditions else model)

    monkeypatch.setattr("worldsim.link_check.packets.conditions_of", other)
    assert [finding for finding in findings(configured, 1) if not finding.ok]


def test_two_links_and_two_channels_lose_independently():
    link = LinkModel(loss_percent=50.0)
    series = [Flight(link, seed, channel).first["cause"] for seed in (1, 2) for channel in (0, 1)]
    for at, one in enumerate(series):
        for other in series[:at]:
            assert abs(float(np.mean(one == other)) - 0.5) < 0.0052


def test_the_interval_of_bursts_is_the_correlated_one():
    """p (1-p) (1+rho) / (1-rho), rho = 1-p-r."""
    bursty, plain = LinkModel(gemodel=GilbertElliott(2.0, 20.0)), LinkModel(loss_percent=100.0 / 11)
    assert mean_loss(bursty) == pytest.approx(mean_loss(plain))
    assert loss_bound(bursty, 1000) / loss_bound(plain, 1000) == pytest.approx((1.78 / 0.22) ** 0.5)


def test_equal_distributions_have_no_distance_with_steps_or_without():
    steps = np.array([0.0] * 30 + [1.0] * 70)
    assert kolmogorov_smirnov(steps, steps) == 0.0
    assert kolmogorov_smirnov(steps, np.array([0.0] * 40 + [1.0] * 60)) == pytest.approx(0.1)


def test_a_finding_is_ok_within_its_tolerance():
    assert Finding("x", 1.0, 1.1, 0.11).ok
    assert not Finding("x", 1.0, 1.2, 0.11).ok


def test_the_parameter_sets_of_a_scenario_are_its_different_links():
    scenario = load(Path("deploy/scenarios/bursty-9.toml"))
    names = [each.name for each in parameter_sets(scenario)]
    assert names == ["local", "multihop", "0 to 5, local", "0 to 5, multihop"]
    same = msgspec.structs.replace(scenario, netem=conditions_of(LINKS["clean"]))
    assert [each.name for each in parameter_sets(same)] == ["local"]
