r"""Whether one set of constants serves several tests of one material, and which test needs others.

About the fit of all tests, residuals r of readings whose errors have the covariance S depend on changes d of the law's
parameters, and on stiffnesses that the tests in H have of their own:

.. math:: r = J d + w \sum_{m \in H} A_m a_m + e, \qquad a_m \sim N(0, I), \quad e \sim N(0, S),

with :math:`A_m` the sensitivities to the stiffnesses at the readings of test m alone, each scaled to the size of its
forces. H is none of the tests, one of them, or all; the restricted likelihood with :math:`S + w^2 \sum A_m A_m^T`, in
the mean over sizes w, says how probable each is (D. A. Harville, J. Am. Stat. Assoc. 72 (1977) 320-338). Of two tests
that differ nobody can say which is the material's.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular
from scipy.special import logsumexp, softmax

from legfem.common.numbers import percent
from legfem.common.units import FloatArray
from legfem.inverse.least_squares import inverse_in_units
from legfem.specimens.model_discrepancy import log_density

_SIZES = (0.1, 0.3, 1.0)
"""Prior standard deviations of the relative force by which a test that stands apart differs; each as probable."""
_TOGETHER, _ONE_APART = 0.5, 0.45
"""Probabilities beforehand that one set of constants serves all, and all but one; that no two agree is rarer."""
_SAID, _SURE = 0.5, 0.75
"""Probabilities of one law for all: below the first the tests are said to disagree, and between both it is open."""

_TOLD = (0.2, 5.0)
"""Factors between which a difference, linear in the constants, has a value."""

type Places = Mapping[str, NDArray[np.int_]]
"""Places of the readings of every test, by its name."""


@dataclass(frozen=True)
class ApartTest:
    """One of several tests beside the others."""

    name: str
    probability: float
    """That it alone needs constants of its own; 0 of two tests, which can't tell."""
    factor: float
    """Its force over what the others' constants make it."""
    factor_sd: float

    @property
    def ci95(self) -> tuple[float, float]:
        """95 % interval of the factor."""
        return self.factor - 1.96 * self.factor_sd, self.factor + 1.96 * self.factor_sd

    @property
    def text(self) -> str:
        """The factor with its interval."""
        least, most = _TOLD
        if not least < self.factor < most:
            return f"under {least:g} times" if self.factor < 1 else f"over {most:g} times"
        low, high = self.ci95
        return f"{self.factor:.2f} ({low:.2f} to {high:.2f}) times"


@dataclass(frozen=True)
class TestsAgreement:
    """What tests of one material say of one set of constants."""

    __test__ = False  # pytest's

    tests: tuple[ApartTest, ...]
    together: float
    """Probability that one set serves all."""

    @property
    def each(self) -> float:
        """Probability that every test needs its own."""
        return max(0.0, 1.0 - self.together - sum(one.probability for one in self.tests))

    @property
    def disagree(self) -> bool:
        """Whether that is said."""
        return self.together < _SAID

    @property
    def differ(self) -> bool:
        """Whether that is said, or a test's force is another than the others' constants make it, with 95 %."""
        return self.disagree or any(one.ci95[0] > 1.0 or one.ci95[1] < 1.0 for one in self.tests)

    @property
    def apart(self) -> ApartTest | None:
        """The test that stands apart, if one does."""
        most = max(self.tests, key=lambda one: one.probability)
        return most if most.probability > _SAID else None

    @property
    def left_out(self) -> dict[tuple[str, ...], float]:
        """Tests that the material's constants are not read from, with the probability that it is these."""
        names = [one.name for one in self.tests]
        found: dict[tuple[str, ...], float] = {(): self.together}
        found |= {(one.name,): one.probability for one in self.tests}
        for name in names:
            others = tuple(other for other in names if other != name)
            found[others] = found.get(others, 0.0) + self.each / len(names)
        return found

    @property
    def text(self) -> str:
        """The finding as sentences."""
        beside = "Forces beside what the other tests' constants make them: "
        beside += ", ".join(f"{one.name} {one.text}" for one in self.tests)
        if not self.disagree:
            leaves = "The tests leave open whether one" if self.together < _SURE or self.differ else "One"
            return (
                f"{leaves} set of constants serves all tests within their errors and what the law misses of each "
                f"(probability {percent(self.together)}). {beside}."
            )
        first = (
            f"The tests disagree: one set of constants does not serve all (probability {percent(1 - self.together)})"
        )
        if self.apart is None:
            return f"{first}. {beside}."
        return (
            f"{first}. The test {self.apart.name} stands apart from the others ({percent(self.apart.probability)}): "
            f"its forces are {self.apart.text} what their constants make them."
        )

    @property
    def remedy(self) -> str:
        """What to do where they disagree, as sentences."""
        of = f"of {self.apart.name}" if self.apart else "of each test"
        return (
            f"Check the rig, sizes and specimens {of}, and diagnose the folder; if they are right, try the other laws "
            "(--law yeoh, --law exponential): one may serve all tests. Until then a test's constants hold for it alone."
        )


def agreement_document(found: TestsAgreement | None) -> dict[str, Any] | None:
    """Return the finding as JSON types; None without one."""
    if found is None:
        return None
    tests = [
        {"name": one.name, "stands_apart": one.probability, "force_over_others": one.factor, "ci95": list(one.ci95)}
        for one in found.tests
    ]
    return {"one_law_for_all": found.together, "tests": tests}


def agreement_of_tests(
    residual: FloatArray,
    force: FloatArray,
    jacobian: FloatArray,
    own: FloatArray,
    covariance: FloatArray,
    tests: Places,
) -> TestsAgreement:
    """Return how tests agree.

    Parameters
    ----------
    residual
        (n,): measured less predicted, about the fit of all.
    force
        (n,) as predicted, in the same unit.
    jacobian
        (n, p): by all free parameters.
    own
        (n, k): by stiffnesses, of which tests may have their own.
    covariance
        (n, n) of the readings' errors, with what the law misses within a test.
    tests
        Places of their readings.
    """
    columns = {}
    for name, places in tests.items():
        by = np.where(np.isin(np.arange(len(own)), places)[:, None], own, 0.0)
        size = np.linalg.norm(by, axis=0)
        columns[name] = np.linalg.norm(force[places]) * by[:, size > 0] / size[size > 0]
    every = np.hstack(list(columns.values()))
    alone = columns if len(tests) > 2 else {}
    shapes = [every[:, :0], *alone.values(), every]
    sizes = np.square(_SIZES)
    densities = [[log_density(covariance + w * by @ by.T, residual, jacobian) for w in sizes] for by in shapes]
    priors = [_TOGETHER, *(_ONE_APART / len(alone) for _ in alone), 1 - _TOGETHER - (_ONE_APART if alone else 0.0)]
    chances = softmax(logsumexp(densities, axis=1) + np.log(priors))
    by_itself = dict(zip(alone, chances[1:].tolist(), strict=False))
    found = [
        ApartTest(
            name, by_itself.get(name, 0.0), *_factor(residual, force, jacobian, columns[name], covariance, places)
        )
        for name, places in tests.items()
    ]
    return TestsAgreement(tuple(found), float(chances[0]))


def _factor(
    residual: FloatArray,
    force: FloatArray,
    jacobian: FloatArray,
    own: FloatArray,
    covariance: FloatArray,
    places: NDArray[np.int_],
) -> Sequence[float]:
    """Return a test's force over what the others make it, and its standard deviation, if it alone has own constants."""
    lower = cholesky(covariance, lower=True)
    by = np.hstack([jacobian, own])
    prior = np.eye(by.shape[1])[jacobian.shape[1] :] / _SIZES[-1]
    inverse = inverse_in_units(np.vstack([solve_triangular(lower, by, lower=True), prior]))
    found = inverse[:, : len(residual)] @ solve_triangular(lower, residual, lower=True)
    mine, others = force[places], np.arange(by.shape[1]) < jacobian.shape[1]
    along = mine @ by[places]
    # Extrapolated far, the others' force could vanish.
    theirs = max(mine @ mine + along[others] @ found[others], 0.05 * (mine @ mine))
    excess = along[~others] @ found[~others] / theirs
    return 1 + float(excess), float(np.linalg.norm(np.where(others, -excess, 1.0) * along / theirs @ inverse))
