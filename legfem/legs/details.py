"""What the fit of a leg has beside that of any test: what corrected its force for 3D, and its own solves in 3D."""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from legfem.common.units import FloatArray
from legfem.inverse.catalogue import DEEP_C10, DEEP_C20, Values, with_units
from legfem.inverse.fit import Fit
from legfem.legs.site_test import curve_of
from legfem.legs.subject import SitedLeg, Subject

if TYPE_CHECKING:
    from legfem.legs.film_3d import PressedLeg


@dataclass(frozen=True, eq=False)
class AppliedCorrection:
    """The 3D correction that the force was multiplied with, at the identified stiffness."""

    name: str
    P: FloatArray
    """On the curve's grid, (n,); the factor is ``1 - P``."""
    sd: FloatArray
    """Of P's error, (n,), which the intervals carry."""
    with_fibres: bool = False
    """Whether it holds what the muscle's fibres do."""


@dataclass(frozen=True)
class Confirmation:
    """One full solve of the leg in 3D, at the optimum of a search on the corrected section."""

    c10: float
    """kPa, as ``c20``."""
    c20: float
    seconds: float
    """Of the solve."""
    factorisations: int
    error: float
    """Greatest difference of the force from what the correction predicted, over the greatest."""
    moved: float = math.nan
    """Relative change of C10 by the search that came after."""


@dataclass(frozen=True, eq=False)
class SpatialEvidence:
    """What the leg's own solves in 3D say of its correction."""

    shape: str
    """Where the leg's shape was taken from."""
    extruded: bool
    """Whether one section stands for the whole leg, which is an assumption."""
    length: float
    """Of the leg modelled (mm)."""
    confirmations: tuple[Confirmation, ...]
    """Of this law, in their order; none where another law's solves used the budget up."""
    full_solves: int
    """So far, of all laws."""
    rough_solves: int
    """By larger elements, which measured errors."""
    errors: Mapping[str, float]
    """Greatest error of P from `legfem.legs.correction.FIRST_RATIO` on, by its cause."""
    table_P: FloatArray | None
    """What the table of idealised legs says here, (n,); None without one."""
    pressed: "PressedLeg | None" = None
    """The last full solve, to be looked at; None where its states were not kept."""

    @property
    def converged(self) -> bool:
        """Whether the last solve met what was predicted, and moved nothing."""
        last = self.confirmations[-1] if self.confirmations else None
        return last is not None and max(last.error, last.moved) < CLOSE


CLOSE = 0.01
"""Of the force that was predicted in 3D, and of C10 from search to search: where they have met."""


@dataclass(frozen=True, eq=False)
class SpatialSites:
    """What the solves of a leg in 3D were of, and what errors are left in them."""

    shapes: tuple[str, ...]
    """Where the leg's shape about every site was taken from."""
    extruded: bool
    """Whether one section stands for a site's whole length, which is an assumption."""
    full_solves: int
    """Of single sites, for a law."""
    rough_solves: int
    """By larger elements, or of a shorter leg."""
    errors: Mapping[str, float]
    """Greatest share of a site's force, by cause."""
    untold: str
    """Why the fibres' ratio cannot be distinguished from C10, as a sentence; empty if it can, or isn't
    sought."""


@dataclass(frozen=True, eq=False)
class LegDetails:
    """What a fit of a leg has beside that of any test."""

    leg: SitedLeg
    """With its sites; one pressed in one way has one."""
    own_errors: Values
    """Standard deviations by which each site's instrument errs, by full name."""
    corrections: tuple[AppliedCorrection | None, ...]
    """Correction of each site's force at the optimum."""
    spatial: SpatialEvidence | SpatialSites | None = None
    """What the leg's own solves in 3D are and say; None of a model in plane strain with a table's correction."""

    @property
    def subject(self) -> Subject:
        """The first site, whose tissues are those of all."""
        return self.leg.sites[0]

    @property
    def plane(self) -> bool:
        """Whether the search went on a section in plane strain."""
        return not isinstance(self.spatial, SpatialSites)


class LegDocument:
    """What ``result.json`` of a leg has beside that of any fit; a `legfem.inverse.document.KindDocument`."""

    def of_fit(self, fit: Fit[LegDetails]) -> dict[str, Any]:
        """Model, solves in 3D, fibres, and what the sites' instruments err by."""
        details = fit.details
        fibres, applied = details.subject.fibres, details.corrections[0]
        return {
            "correlation_c10_c20": fit.correlation(DEEP_C10, DEEP_C20),
            "own_errors_of_sites_sd": with_units(details.own_errors),
            "model": "2d" if details.spatial is None else "3d",
            "spatial": _spatial(details.spatial),
            "fibres": None
            if fibres is None
            else {
                "ratio": fibres.value,
                "sd": fibres.sd,
                "provenance": fibres.provenance,
                "source": fibres.source,
                "in_correction": applied is not None and applied.with_fibres,
            },
        }

    def of_test(self, fit: Fit[LegDetails], number: int) -> dict[str, Any]:
        """Correction and noise at a site."""
        details, curve = fit.details, curve_of(fit.tests[number])
        applied = details.corrections[number]
        return {
            "subject": details.leg.sites[number].id,
            "correction": None if applied is None else applied.name,
            "correction_P": None if applied is None else applied.P,
            "correction_P_sd": None if applied is None else applied.sd,
            "noise": {
                "reading_force_sd_N": curve.noise.force_sd,
                "correlation_length_mm": curve.noise.correlation_length,
                "trials": curve.n_trials,
                "source": curve.noise.source,
            },
        }


def _spatial(found: SpatialEvidence | SpatialSites | None) -> dict[str, Any] | None:
    if found is None:
        return None
    if isinstance(found, SpatialSites):
        return asdict(found)
    return {
        "shape": found.shape,
        "extruded": found.extruded,
        "length_mm": found.length,
        "converged": found.converged,
        "full_solves": found.full_solves,
        "rough_solves": found.rough_solves,
        "confirmations": [
            {
                "c10_kPa": one.c10,
                "c20_kPa": one.c20,
                "seconds": one.seconds,
                "factorisations": one.factorisations,
                "relative_difference_from_predicted_force": one.error,
                "relative_change_of_c10_after": one.moved,
            }
            for one in found.confirmations
        ],
        "greatest_error_of_P": dict(found.errors),
        "correction_P_of_table": found.table_P,
    }
