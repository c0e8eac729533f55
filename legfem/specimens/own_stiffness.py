r"""Factors by which specimens of one tissue differ in stiffness, found with the law.

Pieces of one tissue differ in stiffness far more than in how they stiffen and relax. The force is
in proportion to the stiffness, so that each specimen's factor needs no search: with the weights W
of its stations,

.. math:: s_g = \frac{\sum (W m) (W f)}{\sum (W f)^2}

is the least squares' for its recordings m and the model's forces f. Factors count relative to their
geometric mean, which the law's own stiffness carries: that of a typical specimen; where specimens
are cut along fibres and across, to that of each kind, which the fibres' ratio carries (variable
projection: G. H. Golub, V. Pereyra, SIAM J. Numer. Anal. 10 (1973) 413-432).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from legfem.common.units import FloatArray

_LEAST = 1e-6


@dataclass(frozen=True, eq=False)
class OwnStiffness:
    """The specimens' factors on a model's forces.

    Parameters
    ----------
    names : tuple of str
        Of g specimens.
    specimen : ndarray
        (n,): number of every station's.
    measured : ndarray
        (n,), N.
    weighted : callable
        Weights values (n, ...), each recording's for itself.
    known : Mapping[str, float], optional
        Factors found elsewhere, by name; a specimen that isn't among them is typical. Without them
        factors are those that fit.
    kinds : tuple of str, optional
        Of specimens (g), each with a typical one of its own; all are of one kind without them.
    """

    names: tuple[str, ...]
    specimen: NDArray[np.intp]
    measured: FloatArray
    weighted: Callable[[FloatArray], FloatArray]
    known: Mapping[str, float] | None = None
    kinds: tuple[str, ...] = ()

    @property
    def degrees(self) -> int:
        """By how many numbers the specimens' factors differ."""
        return len(self.names) - len(set(self.kinds or ("",)))

    @cached_property
    def _of_a_kind(self) -> FloatArray:
        """What takes the mean over specimens of a kind, (g, g)."""
        kinds = np.array(self.kinds or ("",) * len(self.names))
        same = np.asarray(kinds[:, None] == kinds, float)
        return np.asarray(same / same.sum(axis=1))

    @cached_property
    def _members(self) -> FloatArray:
        """Which stations are of which specimen, (g, n)."""
        return np.asarray(self.specimen == np.arange(len(self.names))[:, None], float)

    @property
    def same(self) -> FloatArray:
        """Which pairs of stations are of one specimen, (n, n)."""
        return np.asarray(self.specimen[:, None] == self.specimen, float)

    @cached_property
    def _seen(self) -> FloatArray:
        return self._weighed(self.measured)

    def _weighed(self, values: FloatArray) -> FloatArray:
        flat = values.reshape(-1, values.shape[-1])
        return self.weighted(flat.T).T.reshape(values.shape)

    def _relative(self, felt: FloatArray) -> FloatArray:
        """Return the factors (..., g) at forces (..., n) of typical specimens."""
        if self.known is not None:
            return np.array([self.known.get(name, 1.0) for name in self.names])
        seen = self._weighed(felt)
        best = (self._seen * seen) @ self._members.T
        best = best / np.maximum(seen**2 @ self._members.T, 1e-300)
        logs = np.log(np.maximum(best, _LEAST))
        return np.asarray(np.exp(logs - logs @ self._of_a_kind))

    def __call__(self, felt: FloatArray) -> FloatArray:
        """Return the factors (..., n) on forces (..., n) of typical specimens."""
        return np.asarray(self._relative(felt)[..., self.specimen])

    def named(self, felt: FloatArray) -> dict[str, float]:
        """Return the factors by name, at forces (n,)."""
        return dict(zip(self.names, map(float, self._relative(felt)), strict=True))

    def slope(self, felt: FloatArray, by: FloatArray) -> FloatArray:
        """Return the derivative (n,) of the factors times forces (n,) whose own is ``by`` (n,)."""
        factor = self(felt)
        if self.known is not None:
            return factor * by
        seen, change = self._weighed(felt), self._weighed(by)
        logs = ((self._seen * change) @ self._members.T) / ((self._seen * seen) @ self._members.T)
        logs = logs - 2 * ((seen * change) @ self._members.T) / (seen**2 @ self._members.T)
        return np.asarray(factor * (by + felt * (logs - logs @ self._of_a_kind)[self.specimen]))
