r"""What the law misses: a smooth error of unknown form; and whether one set of constants serves several tests.

Residuals r of readings whose errors have the covariance C are taken to have :math:`S = C + \sigma^2 K` with a smooth K
of the loading's depth, alike in all recordings of a kind, of several sizes and lengths (M. C. Kennedy, A. O'Hagan, J.
R. Stat. Soc. B 63 (2001) 425). With the sensitivities J of the parameters, which were fitted,

.. math:: \log p = -\tfrac12 \bigl(r_\perp^T S^{-1} r_\perp + \log|S| + \log|J^T S^{-1} J|\bigr)

(restricted likelihood: D. A. Harville, J. Am. Stat. Assoc. 72 (1977) 320-338). A law that fits has hardly any such
error; one that misses has as much as its residuals ask for, and its parameters' intervals carry what that may do to
them.

About the fit of all tests, residuals r of readings whose errors have the covariance S depend on changes d of the law's
parameters, and on stiffnesses that the tests in H have of their own:

.. math:: r = J d + w \sum_{m \in H} A_m a_m + e, \qquad a_m \sim N(0, I), \quad e \sim N(0, S),

with :math:`A_m` the sensitivities to the stiffnesses at the readings of test m alone, each scaled to the size of its
forces. H is none of the tests, one of them, or all; the restricted likelihood with :math:`S + w^2 \sum A_m A_m^T`, in
the mean over sizes w, says how probable each is (D. A. Harville, J. Am. Stat. Assoc. 72 (1977) 320-338). Of two tests
that differ nobody can say which is the material's.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular
from scipy.special import logsumexp, softmax

from legfem.common.numbers import percent
from legfem.common.units import FloatArray
from legfem.inverse.evidence import LENGTHS
from legfem.inverse.least_squares import inverse_in_units
from legfem.specimens.comparison import SpecimenComparison

_SIZES = tuple(float(size) for size in 0.001 * 2.0 ** np.arange(9))
"""Standard deviations over the greatest force."""
_HIDDEN = 3.0
"""Over the residuals' root mean square: a refit hides no more of an error than some times what it leaves."""
_LEAST = 0.15
"""Error's size at first touch over that at the largest force."""


@dataclass(frozen=True, eq=False)
class LawMisfit:
    """What a law misses."""

    rms: float
    """Root mean square of the residuals, over the greatest force."""
    log_densities: FloatArray
    """(1 + lengths, sizes): logarithms of the readings' density, without such an error in the first row."""
    readings: int
    covariance: FloatArray
    """(n, n), N2, in the mean over sizes and lengths by how probable they are."""

    def log_evidence(self, rms: float) -> float:
        """Return the logarithm of the density of a reading beside errors of any size, beforehand about one.

        Sizes have half a Cauchy distribution: another law may bend a curve by more than this one's residuals show.
        """
        sizes = np.array(_SIZES) / rms
        return float(logsumexp(self.log_densities + _log_priors(sizes / (1 + sizes**2)))) / self.readings


def misfit_of(
    comparison: SpecimenComparison, covariance: FloatArray, force: FloatArray, jacobian: FloatArray
) -> LawMisfit:
    """Return what a law misses.

    Parameters
    ----------
    comparison
        Forces alone, of n stations.
    covariance
        (n, n), N2, of their errors.
    force
        (n,), N, as the law predicts it from where contacts seem to be.
    jacobian
        (n, p), N: of the free parameters, each in units of its own size.
    """
    # Moved contacts are no misfit: the prior's pull on them is in what the densities compare, not in the size.
    residual, left = comparison.expected - force, comparison.measured - force
    peak = np.array([part.course.peak for part in comparison.tests])[comparison.part_of]
    shapes = list(_shapes(comparison, peak))
    none = log_density(covariance, residual, jacobian)
    densities = [[none] * len(_SIZES)]
    densities += [
        [log_density(covariance + size**2 * shape, residual, jacobian) for size in _SIZES] for shape in shapes
    ]
    rms = float(np.sqrt(np.mean((left / peak) ** 2)))
    likely = _log_priors((np.array(_SIZES) <= max(_HIDDEN * rms, _SIZES[0])).astype(float))
    weights = softmax(densities + likely)[1:] @ np.square(_SIZES)
    total = np.tensordot(weights, shapes, 1)
    return LawMisfit(rms, np.array(densities), len(residual), total)


def _log_priors(by_size: FloatArray) -> FloatArray:
    """Return logarithms of prior probabilities: half for none, the rest by size in proportion to weights."""
    row = 0.5 * by_size / (len(LENGTHS) * by_size.sum())
    with np.errstate(divide="ignore"):
        return np.log(np.vstack([np.full(len(_SIZES), 0.5 / len(_SIZES)), *[row] * len(LENGTHS)]))


def _shapes(comparison: SpecimenComparison, peak: FloatArray) -> Iterator[FloatArray]:
    """Yield the covariances of errors of all lengths, of the size of the greatest force."""
    share = np.concatenate([part.course.displacement / part.course.depth for part in comparison.tests])
    kinds = np.array([part.kind for part in comparison.tests])[comparison.part_of]
    scale = peak * (_LEAST + (1 - _LEAST) * np.abs(comparison.measured) / peak)
    alike = np.outer(scale, scale) * (kinds[:, None] == kinds)
    for length in LENGTHS:
        yield alike * np.exp(-0.5 * (np.subtract.outer(share, share) / length) ** 2)


def log_density(covariance: FloatArray, residual: FloatArray, jacobian: FloatArray) -> float:
    """Return the logarithm of the restricted likelihood of residuals (n,) whose covariance is (n, n)."""
    lower = cholesky(covariance, lower=True)
    left, by = (solve_triangular(lower, values, lower=True) for values in (residual, jacobian))
    basis, upper = np.linalg.qr(by)
    left = left - basis @ (basis.T @ left)
    sizes = np.concatenate([np.diag(lower), np.maximum(np.abs(np.diag(upper)), 1e-300)])
    return float(-0.5 * left @ left - np.log(sizes).sum() - 0.5 * len(left) * np.log(2 * np.pi))


def fitted_change(covariance: FloatArray, residual: FloatArray, jacobian: FloatArray) -> FloatArray:
    """Return what of residuals (n,) the parameters of a Jacobian (n, p) take up: generalised least squares."""
    lower = cholesky(covariance, lower=True)
    left, by = (solve_triangular(lower, values, lower=True) for values in (residual, jacobian))
    return np.asarray(jacobian @ np.linalg.lstsq(by, left)[0])


_APART_SIZES = (0.1, 0.3, 1.0)
"""Prior standard deviations of the relative force by which a test that stands apart differs; each as probable."""
_TOGETHER, _ONE_APART = 0.5, 0.45
"""Probabilities beforehand that one set of constants serves all, and all but one; that no two agree is rarer."""
_SAID, _SURE = 0.5, 0.75
"""Probabilities of one law for all: below the first the tests are said to disagree, and between both it is open."""

_TOLD_FACTORS = (0.2, 5.0)
"""Factors between which a difference, linear in the constants, has a value."""

type Places = Mapping[str, NDArray[np.int_]]
"""Places of the readings of every test, by its name."""


@dataclass(frozen=True)
class ApartTest:
    """One of several tests beside the others, by the names of ``result.json``."""

    name: str
    stands_apart: float
    """Probability that it alone needs constants of its own; 0 of two tests, which can't tell."""
    force_over_others: float
    """Its force over what the others' constants make it, ..."""
    ci95: tuple[float, float]
    """... and the 95 % interval of that."""

    @property
    def text(self) -> str:
        """The factor with its interval."""
        least, most = _TOLD_FACTORS
        if not least < self.force_over_others < most:
            return f"under {least:g} times" if self.force_over_others < 1 else f"over {most:g} times"
        low, high = self.ci95
        return f"{self.force_over_others:.2f} ({low:.2f} to {high:.2f}) times"


@dataclass(frozen=True)
class TestsAgreement:
    """What tests of one material say of one set of constants, by the names of ``result.json``."""

    __test__ = False  # pytest's

    one_law_for_all: float
    """Probability that one set serves all."""
    tests: tuple[ApartTest, ...]

    @property
    def each(self) -> float:
        """Probability that every test needs its own."""
        return max(0.0, 1.0 - self.one_law_for_all - sum(one.stands_apart for one in self.tests))

    @property
    def disagree(self) -> bool:
        """Whether that is said."""
        return self.one_law_for_all < _SAID

    @property
    def differ(self) -> bool:
        """Whether that is said, or a test's force is another than the others' constants make it, with 95 %."""
        return self.disagree or any(one.ci95[0] > 1.0 or one.ci95[1] < 1.0 for one in self.tests)

    @property
    def apart(self) -> ApartTest | None:
        """The test that stands apart, if one does."""
        most = max(self.tests, key=lambda one: one.stands_apart)
        return most if most.stands_apart > _SAID else None

    @property
    def left_out(self) -> dict[tuple[str, ...], float]:
        """Tests that the material's constants are not read from, with the probability that it is these."""
        names = [one.name for one in self.tests]
        found: dict[tuple[str, ...], float] = {(): self.one_law_for_all}
        found |= {(one.name,): one.stands_apart for one in self.tests}
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
            leaves = "The tests leave open whether one" if self.one_law_for_all < _SURE or self.differ else "One"
            return (
                f"{leaves} set of constants serves all tests within their errors and what the law misses of each "
                f"(probability {percent(self.one_law_for_all)}). {beside}."
            )
        several = percent(1 - self.one_law_for_all)
        first = f"The tests disagree: one set of constants does not serve all (probability {several})"
        if self.apart is None:
            return f"{first}. {beside}."
        return (
            f"{first}. The test {self.apart.name} stands apart from the others ({percent(self.apart.stands_apart)}): "
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
    sizes = np.square(_APART_SIZES)
    densities = [[log_density(covariance + w * by @ by.T, residual, jacobian) for w in sizes] for by in shapes]
    priors = [_TOGETHER, *(_ONE_APART / len(alone) for _ in alone), 1 - _TOGETHER - (_ONE_APART if alone else 0.0)]
    chances = softmax(logsumexp(densities, axis=1) + np.log(priors))
    by_itself = dict(zip(alone, chances[1:].tolist(), strict=False))
    lower = cholesky(covariance, lower=True)

    def beside_others(name: str, own: FloatArray, places: NDArray[np.int_]) -> ApartTest:
        """Return a test's force over what the others make it, if it alone has constants of its own."""
        by = np.hstack([jacobian, own])
        prior = np.eye(by.shape[1])[jacobian.shape[1] :] / _APART_SIZES[-1]
        inverse = inverse_in_units(np.vstack([solve_triangular(lower, by, lower=True), prior]))
        found = inverse[:, : len(residual)] @ solve_triangular(lower, residual, lower=True)
        mine, others = force[places], np.arange(by.shape[1]) < jacobian.shape[1]
        along = mine @ by[places]
        # Extrapolated far, the others' force could vanish.
        theirs = max(mine @ mine + along[others] @ found[others], 0.05 * (mine @ mine))
        excess = along[~others] @ found[~others] / theirs
        sd = float(np.linalg.norm(np.where(others, -excess, 1.0) * along / theirs @ inverse))
        low, factor, high = (1 + float(excess) + times * sd for times in (-1.96, 0.0, 1.96))
        return ApartTest(name, by_itself.get(name, 0.0), factor, (low, high))

    found = (beside_others(name, columns[name], places) for name, places in tests.items())
    return TestsAgreement(float(chances[0]), tuple(found))
