"""What the axisymmetric model answers, for the machinery of `legfem.diagnose`.

The specimen is of one incompressible tissue, so that the force is C10 times a function of the
displacement and of C20 / C10: few solutions a specimen serve all fits.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar, Protocol

import numpy as np
from scipy.interpolate import CubicSpline

from legfem.diagnose.mechanisms import Parameter, TissueMechanism, Values
from legfem.diagnose.mechanisms.tissue import Viscoelasticity as OneBranch
from legfem.diagnose.observations import Observations
from legfem.diagnose.stations import Stations
from legfem.experiments.axisymmetric import (
    BallIndentation,
    BallOnLayer,
    CylinderBetweenPlates,
    CylinderCompression,
)
from legfem.experiments.pressing import Indentation
from legfem.materials import ReducedPolynomial
from legfem.path import Path
from legfem.protocol import Protocol as Motion
from legfem.terms import Viscoelasticity
from legfem.units import FloatArray, kpa_to_mpa

REFERENCE_KPA = 10.0
BULK_RATIO = 1000.0
"""Bulk over shear modulus: incompressible for any force's accuracy asked here."""
STIFFENINGS = (0.0, 0.05, 0.15, 0.4, 1.0, 2.5)
"""C20 / C10 of the elastic curves that are solved."""
TIMES_S = tuple(float(t) for t in np.geomspace(0.1, 100.0, 10))
"""Relaxation times for which responses are solved."""


def _branch(number: int) -> tuple[Parameter, Parameter]:
    """Return the parameters of a Prony branch."""
    mark = "" if number == 1 else f"_{number}"
    low, high = TIMES_S[0], TIMES_S[-1]
    return (
        Parameter(
            f"ratio{mark}", "-", "relaxing stress over the lasting one", 0.0, 10.0, start=0.5
        ),
        Parameter(f"relaxation_time{mark}", "s", "of the branch", low, high),
    )


@dataclass(frozen=True)
class Relaxation(OneBranch):
    """One Prony branch of the specimen."""

    parameters: ClassVar[tuple[Parameter, ...]] = _branch(1)
    starts: ClassVar[tuple[tuple[float, ...], ...]] = ((0.3,), (1.0,), (3.0,), (10.0,), (30.0,))
    """Relaxation times (s) that a search begins from."""

    @property
    def branches(self) -> int:
        """Number of Prony branches."""
        return len(self.parameters) // 2

    def shape_choices(self, observed: Observations) -> tuple[Values, ...]:
        """Return relaxation times, and the ratios beyond the first."""
        return tuple(
            {
                **{p.name: 0.6 for p in self.parameters[2::2]},
                **{p.name: time for p, time in zip(self.parameters[1::2], times, strict=True)},
            }
            for times in self.starts
        )


@dataclass(frozen=True)
class TwoRelaxations(Relaxation):
    """A fast and a slow Prony branch."""

    parameters: ClassVar[tuple[Parameter, ...]] = (*_branch(1), *_branch(2))
    starts: ClassVar[tuple[tuple[float, ...], ...]] = ((0.3, 3.0), (0.6, 8.0), (1.0, 20.0))


BRANCHES = 2
"""Of the model: as many as the candidates have at most."""


class Followed(Protocol):
    """A finite-element test."""

    def follow(self, protocol: Motion, parameters: dict[str, float]) -> Indentation:
        """Follow a protocol."""
        ...


@dataclass(eq=False)
class SpecimenResponses:
    """Responses of one specimen; solutions are made when asked for, and remembered.

    Parameters
    ----------
    experiment
        The finite-element test, with Prony branches ``1`` and ``2``.
    depth
        Of the elastic curves (mm).
    whole
        Whether relaxation is solved with both branches at their values, instead of summed from
        single branches' responses at unit ratio.
    """

    experiment: Followed
    depth: float
    whole: bool = False
    c10_bounds: tuple[float, float] = (0.01, 500.0)
    c20_bounds: tuple[float, float] = (0.0, 500.0)
    solutions: int = 0
    _curves: dict[float, FloatArray] = field(default_factory=dict, repr=False)
    _relaxing: dict[tuple[object, ...], FloatArray] = field(default_factory=dict, repr=False)
    _per_ratio: dict[str, CubicSpline] = field(default_factory=dict, repr=False)

    def __getstate__(self) -> dict[str, Any]:
        """Leave the finite-element test out: it can't leave its process, its solutions can."""
        return {**self.__dict__, "experiment": None}

    @property
    def grid(self) -> FloatArray:
        """Displacements of the elastic curves (mm)."""
        return self.depth * np.arange(1, 61) / 60

    def curve(self, c10: float, c20: float) -> FloatArray:
        """Return the elastic force at the grid (N); stiffness in kPa."""
        scale = c10 / REFERENCE_KPA
        if c20 == 0:
            return scale * self._elastic(0.0)
        at = np.log1p(min(c20 / c10, STIFFENINGS[-1]))
        return np.asarray(scale * self._stiffened(at))

    def relative_change(
        self,
        mechanism: TissueMechanism,
        values: Values,
        c10: float,
        c20: float,
        observed: Observations,
    ) -> FloatArray:
        """Return what relaxation adds to the elastic force, over that force; (n,)."""
        if not isinstance(mechanism, Relaxation):
            raise TypeError(f"no response to {mechanism.name}")
        numbers = [values[p.name] for p in mechanism.parameters]
        branches = list(zip(numbers[::2], numbers[1::2], strict=True))
        change = self._together if self.whole else self._summed
        return observed.spread([change(branches, s) for s in observed.protocols])

    def _summed(self, branches: list[tuple[float, float]], stations: Stations) -> FloatArray:
        if stations.key not in self._per_ratio:
            table = np.array([self._together([(1.0, t)], stations) for t in TIMES_S])
            self._per_ratio[stations.key] = CubicSpline(np.log(TIMES_S), table)
        per_ratio = self._per_ratio[stations.key]
        return np.asarray(sum(ratio * per_ratio(np.log(time)) for ratio, time in branches))

    @cached_property
    def _stiffened(self) -> CubicSpline:
        curves = np.array([self._elastic(q) for q in STIFFENINGS])
        return CubicSpline(np.log1p(STIFFENINGS), curves)

    def _together(self, branches: list[tuple[float, float]], stations: Stations) -> FloatArray:
        elastic = self._at(stations, [])
        return self._at(stations, branches) / np.maximum(elastic, 1e-9) - 1.0

    def _at(self, stations: Stations, branches: list[tuple[float, float]]) -> FloatArray:
        key = (stations.key, *branches)
        if key not in self._relaxing:
            values: dict[str, float] = {}
            for k, (ratio, time) in enumerate(branches, 1):
                values[f"deep.viscoelasticity{k}.ratio"] = ratio
                values[f"deep.viscoelasticity{k}.relaxation_time"] = time
            path = self._followed(stations.protocol, values)
            self._relaxing[key] = path.force_at(stations.time)
        return self._relaxing[key]

    def _elastic(self, stiffening: float) -> FloatArray:
        if stiffening not in self._curves:
            values = {"deep.C20": stiffening * kpa_to_mpa(REFERENCE_KPA)}
            path = self._followed(Motion.ramp(self.depth, 1.0), values)
            self._curves[stiffening] = path.loading(self.grid)
        return self._curves[stiffening]

    def _followed(self, protocol: Motion, values: dict[str, float]) -> Path:
        self.solutions += 1
        solved = self.experiment.follow(protocol, values)
        if not solved.report.complete:
            raise RuntimeError(f"the specimen's solution stopped: {solved.report}")
        return solved.path


def ball_responses(
    thickness: float, depth: float, ball_radius: float, layer_radius: float
) -> SpecimenResponses:
    """Return the responses of a layer under a rough ball (mm)."""
    law, branches = _tissue()
    test = BallOnLayer(thickness, ball_radius, layer_radius)
    return SpecimenResponses(BallIndentation(test, law, mechanisms=branches), depth)


def cylinder_responses(test: CylinderBetweenPlates, depth: float) -> SpecimenResponses:
    """Return the responses of a cylinder between plates (mm)."""
    law, branches = _tissue()
    return SpecimenResponses(CylinderCompression(test, law, mechanisms=branches), depth)


def _tissue() -> tuple[ReducedPolynomial, list[Viscoelasticity]]:
    c10 = kpa_to_mpa(REFERENCE_KPA)
    law = ReducedPolynomial(c10, 1 / (BULK_RATIO * c10), C20=0.0)
    return law, [Viscoelasticity("deep", law, branch=str(k)) for k in range(1, BRANCHES + 1)]
