"""What only the fit of a leg in its stocking has: equilibrium, pressures, where model and scan differ; its notices."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any

import numpy as np

from legfem.common.units import FloatArray, mpa_to_kpa
from legfem.geometry.leg_shape import fat_thickness_around
from legfem.geometry.slices import CONTOURS
from legfem.imaging.registration import Registration
from legfem.inverse.answer import Answer, Finding, Notice, Tone
from legfem.inverse.catalogue import key_of
from legfem.inverse.document import members_of
from legfem.inverse.elastography import disagreement
from legfem.inverse.fit import Fit, answer_of, at_limits, of_failed_solves, of_search
from legfem.stockings.contour_distances import ContourMisfit
from legfem.stockings.discrepancy import ModelDiscrepancy
from legfem.stockings.equilibrium import Equilibrium, EquilibriumSettings, LegModel3D
from legfem.stockings.fabric import StockingLoad, stocking_load
from legfem.stockings.leg import ComparedSensor, StockingLeg
from legfem.stockings.levels import TISSUES, PressureAlong
from legfem.stockings.pressures import FatPressures, SectionPressures, TissuePressures, too_low_by
from legfem.stockings.scan_fit import MISSED_BEYOND, ScanFit
from legfem.stockings.tape import TapeDetails

type StockingFit = Fit[StockingDetails]


class StockingNotice(StrEnum):
    """Codes that only a leg in its stocking has."""

    SENSOR_MISSED = "sensor_missed"
    NOT_COMPUTED = "worn_state_not_computed"
    UNSETTLED = "worn_state_unsettled"
    NOT_COMPARED = "no_state_compared"
    SCAN_MISSED = "scan_missed"
    REGISTRATION_UNSETTLED = "registration_unsettled"
    BONES_APART = "bones_apart"
    SLACK = "stocking_slack"
    UNLOADED = "skin_unloaded"
    ENDS_HELD = "ends_held"


@dataclass(frozen=True, eq=False)
class StockingDetails(TapeDetails):
    """The leg in equilibrium with its stocking, and how its stiffness was searched for.

    Parameters
    ----------
    leg, model
        What was given, and its finite-element model.
    scan_load : StockingLoad, optional
        Load by Laplace's law on the scanned shape; None without a scan in the stocking.
    parameters : dict of str to float
        C10 by full name that the equilibrium has, MPa: identified, or given.
    equilibrium : Equilibrium
        Leg and stocking at these; its load includes the fitted error of the fabric's tension.
    sensors : tuple of ComparedSensor
        Sensors beside that equilibrium.
    states : int
        Finite-element solutions.
    moved : dict of str to array, optional
        Displacement (mm) in it of the points of skin and hull, (n_levels, n_points, 3) each; None if it was not found.
    pressures : TissuePressures, optional
        Pressures in that equilibrium, likewise.
    section : SectionPressures, optional
        Pressures in the level at mid calf.
    fat : FatPressures, optional
        Pressures in columns of fat all round the leg.
    best : ScanFit, optional
        Best fit of both scans; None where nothing was compared.
    discrepancy : ModelDiscrepancy, optional
        Tests of what that leaves, likewise.
    problem : str
        Why nothing could be compared with a scan in the stocking; empty where it could, or there is none.
    """

    model: LegModel3D
    scan_load: StockingLoad | None
    parameters: dict[str, float]
    equilibrium: Equilibrium
    sensors: tuple[ComparedSensor, ...]
    states: int
    moved: Mapping[str, FloatArray] | None = None
    pressures: TissuePressures | None = None
    section: SectionPressures | None = None
    fat: FatPressures | None = None
    best: ScanFit | None = None
    discrepancy: ModelDiscrepancy | None = None
    problem: str = ""

    def answer(self, fit: "StockingFit") -> Answer:
        """Return what the fit says: the pressures, and whether model and scan agree."""
        found = self.pressures
        unsure = [TISSUES[n] for n, k in fit.estimates.items() if k.identifiability != "identifiable"]
        verdict = None if self.discrepancy is None else self.discrepancy.verdict
        misses = self.best is not None and self.best.misses
        finding = Finding.MISFIT if verdict == "unexplained" or misses else Finding.FITS
        finding = Finding.NOT_COMPUTED if found is None else finding
        sound = verdict == "consistent" and not unsure and self.equilibrium.converged
        tone: Tone = "wrong" if finding is not Finding.FITS else "sound" if sound else "caution"
        told: dict[str, Any] = {"unsure": tuple(unsure), "tested": self.discrepancy is not None, "ankle": None}
        if found is not None:
            veins = tuple(float(one) for one in found.at_veins if np.isfinite(one))
            told |= {"mean": found.mean_interface, "greatest": found.greatest_interface, "veins": veins}
            told["ankle"] = self.at_ankle
        return replace(answer_of(fit, **told), finding=finding, tone=tone)

    def members(self, fit: Any) -> dict[str, Any]:
        """Stiffness that the pressures are of, the best fit, fabric, pressures, and the state as worn."""
        worn, scanned, model = self.equilibrium, self.leg.registration, self.model.compression
        return {
            "stiffness_of_the_pressures": {
                "given": self.leg.known,
                **{key_of(name): {"value": mpa_to_kpa(c10), "unit": "kPa"} for name, c10 in self.parameters.items()},
            },
            "best_fit": None if self.best is None else _best_fit(self.best),
            "contours": None if self.best is None else _contours(self.leg, self.best.misfit),
            "mismatch": self.discrepancy,
            "registration": None if scanned is None else _registration(scanned),
            "pressures": None if self.pressures is None else _pressures(self, self.pressures),
            **super().members(fit),
            "sensors": [
                {
                    "name": one.sensor.name,
                    "position_mm": one.sensor.position,
                    "diameter_mm": one.sensor.diameter,
                    "thickness_mm": one.sensor.thickness,
                    "measured_kPa": mpa_to_kpa(one.sensor.pressure),
                    "measured_sd_kPa": mpa_to_kpa(one.sensor.sd),
                    "model_kPa": mpa_to_kpa(one.pressure),
                    "departure_in_standard_deviations": one.standardised_residual,
                }
                for one in self.sensors
            ],
            "fat": _fat(self),
            "worn_state": {
                "found": worn.state.report.complete,
                "reason": worn.state.report.reason,
                "converged": worn.converged,
                "relative_pressure_changes": list(worn.changes),
            },
            "model": {
                "tetrahedra": self.tetrahedra,
                "unknowns": model.spaces.unknowns,
                **members_of(model.settings, "formulation", "degree", "ends"),
                "D1_per_MPa": {name: float(law.D1) for name, law in self.leg.tissues.items()},
            },
            "solves": {"equilibria_to_identify": fit.log.forward_solves, "states": self.states},
        }

    def members_of_test(self, fit: Any, number: int) -> dict[str, Any]:
        """Points of the contours that are compared, in the channels' order."""
        best = self.best
        assert best is not None
        contours = [best.misfit.target.contours(name).reshape(-1, 2) for name in CONTOURS]
        named = zip(fit.tests[number].channels, contours, strict=False)
        return {"points_mm": {one.channel.name: dict(zip("xy", points.T, strict=True)) for one, points in named}}

    @property
    def tetrahedra(self) -> int:
        """Number of tetrahedra of the mesh, on all ranks."""
        mesh = self.model.compression.spaces.mesh
        return int(mesh.topology.index_map(mesh.topology.dim).size_global)

    @property
    def load(self) -> StockingLoad:
        """Load in equilibrium, at the fabric's tension as it was found."""
        return self.equilibrium.load

    @property
    def pressure_along(self) -> PressureAlong:
        """Pressure of the stocking by height."""
        leg, tension = self.leg, None if self.best is None else self.best.tension
        on_bare = stocking_load(leg.bare, leg.stocking).times(1.0 if tension is None else 1 + tension.value)
        accuracy = replace(leg.accuracy, tension_sd=self.tension_sd)
        return PressureAlong.of(leg.bare, self.load, on_bare, accuracy)

    @property
    def tension_sd(self) -> float:
        """Relative standard deviation of the fabric's tension: as found, where it was; else as given."""
        tension = None if self.best is None else self.best.tension
        return self.leg.accuracy.tension_sd if tension is None else tension.sd / (1 + tension.value)


def _best_fit(best: ScanFit) -> dict[str, Any]:
    found = best.tension
    tension = None if found is None else {"value": found.value, "standard_error": found.sd, "unit": "1"}
    return {
        "rms_distance_mm": best.rms,
        "weighted_misfit": best.weighted_misfit,
        "rigid_motion": {"shift_mm": best.rigid[:3].tolist(), "turn_rad": best.rigid[3:].tolist()},
        "tension_error": tension,
        "log_covariance": best.log_covariance.tolist(),
    }


def _contours(leg: StockingLeg, misfit: ContourMisfit) -> dict[str, Any]:
    accuracy, bare = leg.accuracy, misfit.distances(leg.bare)
    return {
        "levels_mm": misfit.target.levels.tolist(),
        "expected_rms_distance_mm": accuracy.expected_rms,
        "bare_rms_distance_mm": float(np.sqrt(np.mean(bare**2))),
        "segmentation_sd_mm": accuracy.sd,
        "segmentation_correlation_mm": accuracy.correlation,
        "contour_sd_mm": accuracy.smoothed_sd,
        "pressure_relative_sd": accuracy.pressure_sd,
        "tension_relative_sd": accuracy.tension_sd,
        "model_sd_mm": accuracy.model_sd,
        "shift_sd_mm": list(accuracy.shift_sd),
        "turn_sd_rad": list(accuracy.turn_sd),
    }


def _registration(found: Registration) -> dict[str, Any]:
    return {
        "rotation": found.transform.rotation.tolist(),
        "translation_mm": found.transform.translation.tolist(),
        "residual_rms_mm": found.residual,
        **members_of(found, "pairs", "left_out", "iterations", "converged"),
        "shift_standard_error_mm": found.standard_error.tolist(),
        "turn_standard_error_deg": found.rotation_error.tolist(),
    }


def _pressures(details: StockingDetails, found: TissuePressures) -> dict[str, Any]:
    posture = details.leg.posture
    scanned = None if details.scan_load is None else mpa_to_kpa(details.scan_load.mean_pressure)
    return {
        "mean_interface_kPa": mpa_to_kpa(found.mean_interface),
        "least_interface_kPa": mpa_to_kpa(float(details.equilibrium.load.pressure.min())),
        "greatest_interface_kPa": mpa_to_kpa(found.greatest_interface),
        "mean_interface_of_scanned_shape_kPa": scanned,
        "mean_in_muscle_kPa": mpa_to_kpa(found.mean_in_muscle),
        "greatest_in_fat_kPa": mpa_to_kpa(found.greatest_in_fat),
        "greatest_in_fat_too_low_by": list(too_low_by(details.tetrahedra)),
        "greatest_in_fat_at_mm": found.greatest_in_fat_at.tolist(),
        "veins": [
            {
                "name": vein.name,
                "position_mm": vein.position.tolist(),
                "pressure_kPa": mpa_to_kpa(pressure),
                "standard_error_kPa": mpa_to_kpa(sd),
                "share_of_mean_interface": pressure / found.mean_interface,
                "inside_minus_tissue_kPa": {
                    name: mpa_to_kpa(inside - pressure)
                    for name, inside in (posture.inside(float(vein.position[2])).items() if posture else ())
                },
            }
            for vein, pressure, sd in zip(details.leg.veins, found.at_veins, found.at_veins_sd, strict=True)
        ],
    }


def _fat(details: StockingDetails) -> dict[str, Any]:
    shape, fat = details.leg.bare, details.fat
    middle = int(np.argmin(np.abs(shape.levels - np.median(details.leg.slices))))
    thickness = fat_thickness_around(shape)
    pressed = {}
    if fat is not None:
        for name, other in (("thickness", fat.thickness), ("interface", fat.interface)):
            pressed[f"rank_correlation_of_greatest_pressure_with_{name}"] = fat.rank_correlation(fat.greatest, other)
    return {
        "level_mm": float(shape.levels[middle]),
        "mean_thickness_mm": float(thickness[middle].mean()),
        "least_thickness_mm": float(thickness[middle].min()),
        "greatest_thickness_mm": float(thickness[middle].max()),
        "thickness_round_the_leg_mm": thickness[middle].tolist(),
        **pressed,
    }


UNLOADED_BEYOND = 0.01
"""Share of the skin under the stretched stocking that may bear no pressure without a word."""
_FAR = 3.0
"""Standardised residual of a sensor that chance doesn't explain."""
REGISTERED_WITHIN = 0.5
"""Residual of the registration (mm) that is no cause of concern: half a voxel."""


def stocking_notices(fit: StockingFit) -> Iterator[Notice]:
    """Yield the notices, the gravest first."""
    details = fit.details
    found, best, registration = details.equilibrium, details.best, details.leg.registration
    if not found.state.report.complete:
        yield Notice.of(StockingNotice.NOT_COMPUTED, reason=found.state.report.reason)
    elif not found.converged:
        change, tolerance = 100 * found.changes[-1], 100 * EquilibriumSettings().tolerance
        yield Notice.of(StockingNotice.UNSETTLED, states=len(found.changes), change=change, tolerance=tolerance)
    if details.problem:
        yield Notice.of(StockingNotice.NOT_COMPARED, reason=details.problem)
    yield from of_search(fit.log)
    yield from of_failed_solves(fit.log, "an equilibrium with the stocking")
    if best is not None:
        if best.misses:
            expected = best.misfit.accuracy.expected_rms
            yield Notice.of(StockingNotice.SCAN_MISSED, rms=best.rms, times=MISSED_BEYOND, expected=expected)
        # How far a fit may depart from its priors is a matter of curvature: its interval may be wider than a prior's.
        for k, (name, known) in enumerate(fit.estimates.items()):
            if (prior := known.parameter.prior) is not None:
                error = known.value * float(np.sqrt(best.log_covariance[k, k]))
                yield from disagreement(name, prior, known.value, error, "the fit of both scans")
    yield from at_limits(fit)
    if registration is not None:
        if not registration.converged:
            yield Notice.of(StockingNotice.REGISTRATION_UNSETTLED, iterations=registration.iterations)
        if registration.residual > REGISTERED_WITHIN:
            yield Notice.of(StockingNotice.BONES_APART, residual=registration.residual)
    yield from _of_the_load(details)
    yield from sensor_notices(details.sensors)


def sensor_notices(sensors: Sequence[ComparedSensor]) -> Iterator[Notice]:
    """Yield a notice for every sensor that the model misses."""
    for one in sensors:
        sensor, departure = one.sensor, abs(one.standardised_residual)
        if departure > _FAR:
            told = {"sensor": sensor.name, "read": sensor.pressure, "sd": sensor.sd, "model": one.pressure}
            yield Notice.of(StockingNotice.SENSOR_MISSED, **told, departure=departure)


def _of_the_load(details: StockingDetails) -> Iterator[Notice]:
    leg, load = details.leg, details.equilibrium.load
    levels, slack = leg.bare.levels, load.tension == 0
    if slack.any():
        low, high = float(levels[slack].min()), float(levels[slack].max())
        yield Notice.of(StockingNotice.SLACK, slack=int(slack.sum()), levels=len(levels), low=low, high=high)
    spanned = load.unloaded_skin
    if spanned.mean() > UNLOADED_BEYOND:
        share, most, level = 100 * spanned.mean(), 100 * spanned.max(), levels[np.argmax(spanned)]
        yield Notice.of(StockingNotice.UNLOADED, share=float(share), level=float(level), most=float(most))
    if leg.ends == "held":
        yield Notice.of(StockingNotice.ENDS_HELD)
