r"""What a curve down to some depth tells of the parameters: Fisher's information.

With independent readings of standard deviation :math:`\sigma_i` at displacements :math:`d_i`,

.. math:: I_{ab}(d) = \sum_{d_i \le d} \frac{1}{\sigma_i^2}
          \frac{\partial F_i}{\partial \ln a} \frac{\partial F_i}{\partial \ln b};

its inverse bounds the covariance of the parameters' relative errors from below (Cramér and Rao).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from legfem.common.units import FloatArray
from legfem.legs.subject import Subject
from legfem.study.doe.design import OF_THE_GEOMETRY, Definition
from legfem.study.doe.runs import Request, Workshop

IDENTIFIED = ("deep.C10", "deep.C20")
"""What is to be found."""
SPACING = 1.0
"""mm between readings taken as independent: about the length over which a recording's error is
correlated."""
RATIO = 1.2
"""By which a dimension is changed up and down for its derivative."""
IDENTIFIED_WITHIN = 0.5
"""Half-width of the 95 % interval, relative to the value, within which a parameter is told."""


@dataclass(frozen=True, eq=False)
class Information:
    """Sensitivities at one point, and what follows from them.

    Attributes
    ----------
    nominal : tuple of float
        The point, in the model's units.
    displacement, force, noise_sd : ndarray
        (n,), mm and N.
    sensitivity : ndarray
        Derivatives of the force by the parameters' logarithms (n, k), N.
    assumed_sd : ndarray
        Relative standard deviations (k,) of what is known of a parameter without the test: its range in
        the design, taken for a 95 % interval of its logarithm; infinite for the deep tissue's.
    """

    names: tuple[str, ...]
    nominal: tuple[float, ...]
    displacement: FloatArray
    force: FloatArray
    sensitivity: FloatArray
    noise_sd: FloatArray
    assumed_sd: FloatArray

    def matrix(self, depth: float) -> FloatArray:
        """Information (k, k) of the readings down to a depth."""
        used = self.displacement <= depth + 1e-9
        scaled = self.sensitivity[used] / self.noise_sd[used, None]
        return np.asarray(scaled.T @ scaled)

    def relative_sd(
        self, depth: float, unknown: Sequence[str] | None = None, within_ranges: bool = False
    ) -> FloatArray:
        """Least relative standard deviations of unknown parameters (all by default).

        Infinite where the readings don't determine them; the other parameters are known exactly.
        With ``within_ranges`` the unknown ones are known as well as `assumed_sd` says.
        """
        chosen = [self.names.index(name) for name in (self.names if unknown is None else unknown)]
        matrix = self.matrix(depth)[np.ix_(chosen, chosen)]
        if within_ranges:
            matrix = matrix + np.diag(1 / self.assumed_sd[chosen] ** 2)
        # Scaled to a unit diagonal, lest small sensitivities look like a singular matrix.
        scale = np.sqrt(np.diag(matrix))
        if not np.all(scale > 0):
            return np.full(len(chosen), np.inf)
        correlation = matrix / np.outer(scale, scale)
        if np.linalg.cond(correlation) > 1e14:
            return np.full(len(chosen), np.inf)
        return np.asarray(np.sqrt(np.diag(np.linalg.inv(correlation))) / scale)

    def directions(self, depth: float) -> tuple[FloatArray, FloatArray]:
        """Relative standard deviations along the eigenvectors, best first, and these as columns."""
        values, vectors = np.linalg.eigh(self.matrix(depth))
        with np.errstate(divide="ignore"):
            spread = 1 / np.sqrt(np.maximum(values[::-1], 0))
        vectors = vectors[:, ::-1]
        return spread, vectors * np.sign(vectors[np.argmax(np.abs(vectors), axis=0), range(len(values))])

    def biases(self, depth: float) -> dict[str, list[float]]:
        """Relative errors of the `IDENTIFIED` parameters for one of 1 in each of the others; empty where unknown."""
        if not set(IDENTIFIED) <= set(self.names):
            return {}
        matrix, chosen = self.matrix(depth), [self.names.index(name) for name in IDENTIFIED]
        others = [k for k in range(len(self.names)) if k not in chosen]
        try:
            errors = -np.linalg.solve(matrix[np.ix_(chosen, chosen)], matrix[np.ix_(chosen, others)])
        except np.linalg.LinAlgError:
            return {}
        return {self.names[k]: column.tolist() for k, column in zip(others, errors.T, strict=True)}

    def told_from(self, name: str, unknown: Sequence[str] | None = None, within_ranges: bool = False) -> float | None:
        """Least depth (mm) from which a parameter is known within `IDENTIFIED_WITHIN`; None if there is none."""
        names = self.names if unknown is None else tuple(unknown)
        for depth in self.displacement:
            sd = self.relative_sd(float(depth), names, within_ranges)[names.index(name)]
            if 1.96 * sd <= IDENTIFIED_WITHIN:
                return float(depth)
        return None


def nominal_point(definition: Definition) -> dict[str, float]:
    """Factors' values at which the information is taken, in the model's units."""
    return {f.name: definition.nominal.get(f.name, f.model_value(0.0)) for f in definition.factors}


def information_requests(definition: Definition) -> list[Request]:
    """Simulations to do: one with sensitivities, two for each dimension."""
    point = nominal_point(definition)
    exact = tuple(name for name in point if name not in OF_THE_GEOMETRY and point[name] > 0)
    base = {**definition.fixed, **definition.nominal, **point}
    variants = [base]
    for name in point:
        if name in OF_THE_GEOMETRY:
            variants += [{**base, name: base[name] * RATIO}, {**base, name: base[name] / RATIO}]
    return [
        Request("nominal", k, tuple(sorted(values.items())), definition.depth, "default", exact)
        for k, values in enumerate(variants)
    ]


def study_information(definition: Definition, subject: Subject, workshop: Workshop) -> Information | None:
    """Simulate and differentiate; None where a simulation stops short."""
    outcomes = workshop.do("sensitivities at the nominal point", information_requests(definition))
    if not all(one.complete for one in outcomes):
        return None
    point, length = nominal_point(definition), subject.indenter.length
    grid = np.arange(SPACING, definition.depth + 1e-9, SPACING)
    base, *others = (one.curve for one in outcomes)
    rest, columns, names = iter(others), [], []
    for name, value in point.items():
        if name in OF_THE_GEOMETRY:
            up, down = next(rest), next(rest)
            columns.append(length * (up(grid) - down(grid)) / (2 * np.log(RATIO)))
        elif name in base.sensitivities:
            columns.append(length * value * base.sensitivity(name, grid))
        else:
            continue
        names.append(name)
    instrument = subject.instrument
    noise = np.hypot(instrument.force_sd, instrument.displacement_sd * length * base.stiffness(grid))
    return Information(
        tuple(names),
        tuple(point[name] for name in names),
        grid,
        length * base(grid),
        np.column_stack(columns),
        noise,
        np.array([_assumed_sd(definition, name) for name in names]),
    )


def _assumed_sd(definition: Definition, name: str) -> float:
    (factor,) = (f for f in definition.factors if f.name == name)
    if name in IDENTIFIED or factor.low <= 0:
        return np.inf
    return float(np.log(factor.high / factor.low)) / 4
