"""Which numbers to try next, so that margins fall: by optuna's tree of Parzen estimators.

Each gene is a parameter of its own, in [0, 1). Half of the trials are still drawn at random; those
teach the estimator too. Given the same trials and scores in the same order, it proposes the same.
"""

from collections.abc import Iterator, Mapping
from importlib.util import find_spec
from typing import Any, Final

from worldsim.search.draws import Genes

GENERATION: Final = 16
"""So many trials are proposed before any of them has flown: more could fly at once."""
GUIDED: Final = ("team/", "start/", "vehicle/", "radio/", "hurt/", "faults/", "event/")
"""The parts of a scenario whose numbers are chosen; the others stay random."""


def is_available() -> bool:
    """Return whether optuna is installed, the optional extra `search`."""
    return find_spec("optuna") is not None


class Guide:
    """Proposes the genes of trials, and learns from their scores."""

    def __init__(self, seed: int) -> None:
        import optuna  # noqa: PLC0415 - an optional extra

        optuna.logging.set_verbosity(optuna.logging.WARNING)
        sampler = optuna.samplers.TPESampler(seed=seed, n_startup_trials=GENERATION)
        self._study = optuna.create_study(direction="minimize", sampler=sampler)
        self._range = optuna.distributions.FloatDistribution(0.0, 1.0)
        self._trial_of = optuna.trial.create_trial
        self._failed = optuna.trial.TrialState.FAIL

    def propose(self) -> Mapping[str, float]:
        """Return genes; each is chosen when it is looked up."""
        return _Proposed(self._study.ask())

    def withdraw(self, proposed: Mapping[str, float]) -> None:
        """Close a proposal; what was made of it is learned by ``learn``."""
        if isinstance(proposed, _Proposed):
            self._study.tell(proposed.trial, state=self._failed)

    def learn(self, genes: Genes, score: float) -> None:
        """Take the score of a trial that has flown; low is near a violation."""
        chosen = {name: value for name, value in genes.items() if name.startswith(GUIDED)}
        ranges: dict[str, Any] = dict.fromkeys(chosen, self._range)
        self._study.add_trial(self._trial_of(params=chosen, distributions=ranges, value=score))


class _Proposed(Mapping[str, float]):
    """The genes of one proposal."""

    def __init__(self, trial: Any) -> None:
        self.trial = trial

    def __getitem__(self, name: str) -> float:
        if not name.startswith(GUIDED):
            raise KeyError(name)
        # A draw is below 1.
        return min(float(self.trial.suggest_float(name, 0.0, 1.0)), 1.0 - 2.0**-53)

    def __iter__(self) -> Iterator[str]:
        return iter(self.trial.params)

    def __len__(self) -> int:
        return len(self.trial.params)
