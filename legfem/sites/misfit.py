"""Recordings of several sites beside one leg's model, each weighed by its own errors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.linalg import block_diag

from legfem.common.units import FloatArray, mpa_to_kpa
from legfem.identify.catalogue import DEEP_C10, DEEP_C20
from legfem.identify.error_sources import (
    Covariances,
    ErrorSource,
    source_of_mode,
    total_of,
)
from legfem.identify.forward import ForwardOutcome
from legfem.identify.misfit import Compared, Misfit, Prediction
from legfem.identify.reading import GAIN, OFFSET, ZERO
from legfem.recording import LoadingCurve


def with_own_errors(curve: LoadingCurve, sds: Mapping[str, float]) -> LoadingCurve:
    """Return a site's curve that errs by a gain, a zero and a first contact of its own, too.

    Parameters
    ----------
    curve : LoadingCurve
        n forces.
    sds : Mapping[str, float]
        Standard deviations by full name: ``instrument.gain`` (-), ``instrument.zero`` (N),
        ``instrument.contact_offset`` (mm). As errors of the curve they are what letting them err
        by a prior comes to, to first order.
    """
    slope = np.gradient(curve.force, curve.displacement)
    effects = {GAIN: curve.force, ZERO: np.ones(len(curve.force)), OFFSET: slope}
    covariance = np.array(curve.covariance)
    for name, sd in sds.items():
        covariance += sd**2 * np.outer(effects[name], effects[name])
    return replace(curve, covariance=covariance, force_sd=np.sqrt(np.diag(covariance)))


@dataclass(frozen=True, eq=False)
class SitesMisfit(Compared):
    """How far forces are from the measured curves of several sites.

    A site's errors are its own, but for the correction for the cylinder's ends: what is wrong with
    that is taken to be wrong alike at all sites of a leg, mode by mode, so that it doesn't average
    out.

    Parameters
    ----------
    parts : tuple of Misfit
        One a site, of n forces together.
    """

    parts: tuple[Misfit, ...]

    @cached_property
    def spans(self) -> list[slice]:
        """Where every site's forces stand."""
        ends = np.cumsum([0, *map(len, self.parts)])
        return [slice(*pair) for pair in pairwise(ends)]

    @cached_property
    def measured_force(self) -> FloatArray:
        """Of all sites (n,), N."""
        return np.concatenate([part.measured_force for part in self.parts])

    @property
    def if_deeper(self) -> FloatArray:
        """Change of the measured forces (n,) per relative change of the displacements, N."""
        return np.concatenate([part.if_deeper for part in self.parts])

    @property
    def reach(self) -> str:
        """The sites' depths."""
        return ", ".join(part.reach for part in self.parts)

    @property
    def in_errors(self) -> bool:
        """Every site is weighed by its errors."""
        return True

    def reached_by(self, outcome: ForwardOutcome) -> bool:
        """Return whether every site came to its depth."""
        return all(part.reached_by(_of_site(outcome, k)) for k, part in enumerate(self.parts))

    def predict(self, outcome: ForwardOutcome, readings: FloatArray) -> Prediction:
        """Return complete full solves as they are read."""
        every = [part.predict(_of_site(outcome, k), readings) for k, part in enumerate(self.parts)]
        force = np.concatenate([one.force for one in every])
        by = {
            name: np.concatenate([one.sensitivities[name] for one in every])
            for name in every[0].sensitivities
        }
        return Prediction(force, by, force, by)

    def read(self, force: FloatArray, readings: FloatArray) -> FloatArray:
        """Return the model's forces (..., n) as they are: instruments' errors are the curves'."""
        return force

    def weighted(self, values: FloatArray) -> FloatArray:
        """Return values (n, ...) over the sites' errors."""
        return np.concatenate([
            part.weighted(values[span]) for part, span in zip(self.parts, self.spans, strict=True)
        ])  # fmt: skip

    @cached_property
    def covariance(self) -> FloatArray:
        """Of measured less predicted forces at the truth, without the correction's; (n, n), N2."""
        return np.asarray(block_diag(*(part.covariance for part in self.parts)))

    def covariance_at(self, values: Mapping[str, float]) -> FloatArray:
        """Return `covariance` with the correction's; (n, n), N2."""
        return total_of(self.covariances_at(values))

    def covariances_at(self, values: Mapping[str, float]) -> Covariances:
        """Return covariances (n, n), N2, at values, by source; the correction's is alike at all."""
        stiffness = mpa_to_kpa(values[DEEP_C10]), mpa_to_kpa(values.get(DEEP_C20, 0.0))
        modes: dict[str, FloatArray] = {}
        for part, span in zip(self.parts, self.spans, strict=True):
            if part.correction is None:
                continue
            errors = part.correction.relative_errors(part.displacement, *stiffness)
            for name, relative in errors.items():
                mode = modes.setdefault(name, np.zeros(len(self)))
                mode[span] = relative * part.measured_force
        own = block_diag(*(part.measured.covariance for part in self.parts))
        parts: dict[ErrorSource, FloatArray] = {"recordings": own, "model": self.covariance - own}
        for name, mode in modes.items():
            source = source_of_mode(name)
            parts[source] = parts.get(source, 0.0) + np.outer(mode, mode)
        return parts


def _of_site(outcome: ForwardOutcome, number: int) -> ForwardOutcome:
    return replace(outcome, curves=(outcome.curves[number],))
