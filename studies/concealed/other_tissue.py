"""The tissues' laws as the second code asks for them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from legfem.common.units import FloatArray


@dataclass(frozen=True)
class DeepTissue:
    """The deep tissue's law as felupe asks for it: stress and tangent of the gradient; MPa.

    Parameters
    ----------
    c10, c20, alpha, beta
        Of the energy's isochoric part.
    second, fourth
        Coefficients of (J - 1)^2 and (J - 1)^4.
    """

    c10: float
    c20: float
    alpha: float
    beta: float
    second: float
    fourth: float
    x: tuple[FloatArray, FloatArray] = field(default_factory=lambda: (np.zeros((3, 3)), np.zeros(0)), repr=False)

    def gradient(self, x: Sequence[FloatArray], **unused: Any) -> list[FloatArray]:
        """Return the first Piola-Kirchhoff stress (3, 3, ...) and no state."""
        F, state = x[0], x[-1]
        J, H, strain, G = _isochoric(F)
        return [self._slopes(strain)[0] * G + self._pressures(J)[0] * J * H, state]

    def hessian(self, x: Sequence[FloatArray], **unused: Any) -> list[FloatArray]:
        """Return its derivative (3, 3, 3, 3, ...)."""
        F = x[0]
        J, H, strain, G = _isochoric(F)
        first, second = self._slopes(strain)
        by_j, by_jj = self._pressures(J)
        I1 = np.einsum("ij...,ij...->...", F, F)
        one = np.eye(3)
        HH = np.einsum("ij...,kl...->ijkl...", H, H)
        crossed = np.einsum("kj...,il...->ijkl...", H, H)
        unit = np.einsum("ik,jl->ijkl", one, one).reshape((3,) * 4 + (1,) * (F.ndim - 2))
        change = -2 / 3 * np.einsum("ij...,kl...->ijkl...", G, H) + J ** (-2 / 3) * (
            2 * unit - 2 / 3 * (2 * np.einsum("ij...,kl...->ijkl...", H, F) - I1 * crossed)
        )
        return [
            second * np.einsum("ij...,kl...->ijkl...", G, G)
            + first * change
            + (by_jj * J**2 + by_j * J) * HH
            - by_j * J * crossed
        ]

    def _slopes(self, strain: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the isochoric energy's derivatives by its strain."""
        grown = self.alpha * np.exp(self.beta * strain)
        return self.c10 + 2 * self.c20 * strain + grown, 2 * self.c20 + self.beta * grown

    def _pressures(self, J: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the volumetric energy's derivatives by J."""
        e = J - 1
        return 2 * self.second * e + 4 * self.fourth * e**3, (2 * self.second + 12 * self.fourth * e**2)


def other_law(
    c10: float, d1: float, c20: float = 0.0, d2: float | None = None, exponential: tuple[float, float] = (0.0, 1.0)
) -> Any:
    """Return felupe's law of stiffnesses in MPa, of D1 and D2 in 1/MPa; D2 None is infinite."""
    import felupe as fem

    alpha, beta = exponential
    if c20 == 0 and alpha == 0:
        return fem.NeoHooke(mu=2 * c10, bulk=2 / d1)
    return DeepTissue(c10, c20, alpha, beta, 1 / d1, 0.0 if d2 is None else 1 / d2)


def _isochoric(F: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return J, the transposed inverse of F, the first invariant less 3, and its derivative."""
    J = np.linalg.det(np.moveaxis(F, (0, 1), (-2, -1)))
    inverse = np.linalg.inv(np.moveaxis(F, (0, 1), (-2, -1)))
    H = np.moveaxis(inverse, (-1, -2), (0, 1))
    I1 = np.einsum("ij...,ij...->...", F, F)
    G = J ** (-2 / 3) * (2 * F - 2 / 3 * I1 * H)
    return J, H, J ** (-2 / 3) * I1 - 3, G
