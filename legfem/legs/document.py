"""What ``result.json`` of a leg has beside that of any fit."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from legfem.inverse.catalogue import DEEP_C10, DEEP_C20, with_units
from legfem.inverse.fit import Fit
from legfem.legs.details import LegDetails, SpatialEvidence, SpatialSites
from legfem.legs.notices import curve_of


class LegDocument:
    """A `legfem.inverse.document.KindDocument`."""

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
