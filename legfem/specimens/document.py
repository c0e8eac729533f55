"""What ``result.json`` of specimens has beside that of any fit."""

from __future__ import annotations

from typing import Any

from legfem.inverse.catalogue import key_of
from legfem.inverse.fit import Fit
from legfem.specimens.details import SampleFit, SpecimenDetails, recording_of


class SpecimenDocument:
    """A `legfem.inverse.document.KindDocument`."""

    def of_fit(self, fit: Fit[SpecimenDetails]) -> dict[str, Any]:
        """How recordings and specimens differ."""
        details = fit.details
        return {
            "not_used": {one.name: one.reason for one in details.left_out},
            "gain_sd_between_recordings": details.gain_sd,
            "stiffness_over_typical": dict(details.stiffness),
            "stiffness_log_sd": details.stiffness_spread,
            "misfit_rms_over_peak": details.misfit.rms,
            "alternatives": [
                {
                    "name": one.name,
                    "probability": one.probability,
                    "parameters": {
                        key_of(name): {"value": shown.value, "unit": shown.unit, "ci95": list(shown.ci95)}
                        for name, shown in ((name, found.shown) for name, found in one.estimates.items())
                    },
                }
                for one in details.alternatives
            ],
        }

    def of_test(self, fit: Fit[SpecimenDetails], number: int) -> dict[str, Any]:
        """How a recording was driven, and its own samples beside the prediction."""
        one = fit.tests[number]
        recording, samples = recording_of(one), SampleFit.of(one)
        course = recording.course
        return {
            "specimen": recording.specimen,
            "rate_mm_per_s": course.rate if course.samples.timed else None,
            "depth_mm": course.depth,
            "displacement_mm": course.displacement,
            "rmse_N": samples.rmse,
            "r_squared": samples.r_squared,
            "scale": samples.scale,
            "r_squared_at_that_scale": samples.shape_r_squared,
        }
