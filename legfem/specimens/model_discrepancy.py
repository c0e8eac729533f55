r"""What the law misses: a smooth error of unknown form, and how probable a model is beside such an error.

Residuals r of readings whose errors have the covariance C are taken to have :math:`S = C + \sigma^2 K` with a smooth K
of the loading's depth, alike in all recordings of a kind, of several sizes and lengths (M. C. Kennedy, A. O'Hagan, J.
R. Stat. Soc. B 63 (2001) 425). With the sensitivities J of the parameters, which were fitted,

.. math:: \log p = -\tfrac12 \bigl(r_\perp^T S^{-1} r_\perp + \log|S| + \log|J^T S^{-1} J|\bigr)

(restricted likelihood: D. A. Harville, J. Am. Stat. Assoc. 72 (1977) 320-338). A law that fits has hardly any such
error; one that misses has as much as its residuals ask for, and its parameters' intervals carry what that may do to
them.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cholesky, solve_triangular
from scipy.special import logsumexp, softmax

from legfem.common.units import FloatArray
from legfem.inverse.evidence import LENGTHS
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
        Recordings of n stations.
    covariance
        (n, n), N2, of their errors.
    force
        (n,), N, as the law predicts it from where contacts seem to be.
    jacobian
        (n, p), N: of the free parameters, each in units of its own size.
    """
    # Moved contacts are no misfit: the prior's pull on them is in what the densities compare, not in the size.
    residual, left = comparison.of_forces(comparison.expected) - force, comparison.forces - force
    parts = comparison.parts
    stations = [len(part.course.time) for part in parts]
    peak = np.repeat([part.course.peak for part in parts], stations)
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
    parts = comparison.parts
    share = np.concatenate([part.course.displacement / part.course.depth for part in parts])
    kinds = np.repeat([part.kind for part in parts], [len(part.course.time) for part in parts])
    scale = peak * (_LEAST + (1 - _LEAST) * np.abs(comparison.forces) / peak)
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
