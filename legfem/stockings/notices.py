"""Warnings that a result of a leg in its stocking carries."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from legfem.common.units import FloatArray, mpa_to_kpa, mpa_to_mmhg
from legfem.geometry.leg_shape import SKIN, LegShape
from legfem.legs.elastography import elastography_priors
from legfem.legs.notices import disagreement
from legfem.stockings.equilibrium import FixedPointSettings
from legfem.stockings.fabric import StockingLoad
from legfem.stockings.leg import StockingLeg
from legfem.stockings.leg_model import PARAMETERS
from legfem.stockings.result import StockingResult
from legfem.stockings.search import MISSED_BEYOND, Identified, expected_rms, judge, model_misses, starts_agree
from legfem.stockings.sensors import ComparedSensor

TISSUES = dict(zip(PARAMETERS, ("muscle", "fat"), strict=True))
UNLOADED_BEYOND = 0.01
"""Share of the skin under the stretched stocking that may bear no pressure without a word."""
_FAR = 3.0
"""Standard deviations of a sensor's reading that chance doesn't explain."""
REGISTERED_WITHIN = 0.5
"""Residual of the registration (mm) that is no cause of concern: half a voxel."""


def stocking_warnings(result: StockingResult) -> tuple[str, ...]:
    """Return sentences, the gravest first."""
    return tuple(
        [
            *_of_the_state(result),
            *_of_the_searches(result),
            *_of_the_scans(result),
            *_of_the_load(result),
            *of_sensors(result.sensors),
        ]
    )


def of_sensors(sensors: Sequence[ComparedSensor]) -> Iterator[str]:
    """Yield which sensors the model misses."""
    for one in sensors:
        if abs(one.departure) > _FAR:
            read, sd, model = (mpa_to_mmhg(p) for p in (one.sensor.pressure, one.sensor.sd, one.pressure))
            yield (
                f"The sensor {one.sensor.name} read {read:.1f} ± {sd:.1f} mmHg, where the model "
                f"has {model:.1f} mmHg ({abs(one.departure):.0f} standard deviations off): its "
                "place, its error or the fabric is otherwise than was given (a fabric that isn't "
                "known well: [accuracy] tension_relative_sd)."
            )


def unloaded_skin(shape: LegShape, load: StockingLoad) -> FloatArray:
    """Return the share of the contour that bears no pressure at every level, (n_levels,).

    There the stretched fabric spans a hollow or a flat; where it is slack the share is 0.
    """
    assert load.pressure.shape == shape.contours[SKIN].shape[:2]
    share = (load.pressure < 1e-3 * load.pressure.max()).mean(axis=1)
    return np.where(load.tension > 0, share, 0.0)


def _of_the_state(result: StockingResult) -> Iterator[str]:
    worn = result.worn
    if not worn.state.report.complete:
        yield (
            "The leg in its stocking could not be computed "
            f"({worn.state.report.reason}): there are no pressures inside the leg."
        )
    elif not worn.converged:
        yield (
            "The stocking's pressure and the shape that it makes did not settle: in the last of "
            f"{len(worn.changes)} states the pressure still changed by "
            f"{100 * worn.changes[-1]:.2g} % of its greatest, not by less than "
            f"{100 * FixedPointSettings().tolerance:g} %."
        )


def _of_the_searches(result: StockingResult) -> Iterator[str]:
    weighted = [search for search in result.searches if search.method == "weighted"]
    if not weighted:
        return
    best, accuracy = weighted[0], result.leg.accuracy
    for search in result.searches:
        name = "Nelder-Mead's search" if search.method == "nelder-mead" else "A search"
        start = " and ".join(
            f"{mpa_to_kpa(float(value)):.3g} kPa in the {TISSUES[parameter]}"
            for parameter, value in zip(PARAMETERS, search.start, strict=True)
        )
        if not search.worn.state.report.complete:
            yield (f"{name} from {start} met a state that could not be computed ({search.worn.state.report.reason}).")
        elif not search.converged:
            yield f"{name} from {start} ended before it had settled."
    if not starts_agree(weighted):
        yield ("The starts did not all lead to the same stiffness: the one that fits the scan best counts.")
    if not best.worn.state.report.complete:
        return
    if model_misses(best, accuracy):
        yield (
            f"The model misses the scan: its contours are {best.rms:.2f} mm off (root mean "
            f"square), more than {MISSED_BEYOND:g} times the {expected_rms(accuracy):.2f} mm that "
            "errors of the contours make. Intervals of the stiffness don't hold then; look at the "
            "contours."
        )
    yield from _of_waves(best, result.leg)
    for known in judge(best, accuracy):
        if known.at_bound:
            yield (
                f"The stiffness of the {TISSUES[known.name]} stands at the search's "
                f"{known.at_bound} bound: it is not known."
            )


def _of_waves(best: Identified, leg: StockingLeg) -> Iterator[str]:
    if best.log_covariance is None:
        return
    priors, log_sds = elastography_priors(leg.elastography), np.sqrt(np.diag(best.log_covariance))
    for name, value, log_sd in zip(PARAMETERS, best.parameters, log_sds, strict=True):
        if (prior := priors.get(name)) is not None:
            yield from disagreement(name, prior, float(value), float(value * log_sd), "the fit of both scans")


def _of_the_scans(result: StockingResult) -> Iterator[str]:
    registration = result.leg.registration
    if registration is None:
        return
    if not registration.converged:
        yield (f"The registration on the bones did not settle in {registration.iterations} iterations.")
    if registration.residual > REGISTERED_WITHIN:
        yield (
            f"The bones of the two scans are {registration.residual:.2f} mm apart after "
            "registration: their outlines differ, or the scans are not of one leg."
        )


def _of_the_load(result: StockingResult) -> Iterator[str]:
    leg, load = result.leg, result.worn.load
    levels, slack = leg.bare.levels, load.tension == 0
    if slack.any():
        where = levels[slack]
        yield (
            f"The stocking is slack, and presses on nothing, at {int(slack.sum())} of "
            f"{len(levels)} heights, between {where.min():g} and {where.max():g} mm."
        )
    spanned = unloaded_skin(leg.bare, load)
    if spanned.mean() > UNLOADED_BEYOND:
        most = int(np.argmax(spanned))
        yield (
            f"The fabric spans hollows or flats of the leg: {100 * spanned.mean():.0f} % of the "
            f"skin under it bears no pressure, most at z = {levels[most]:g} mm "
            f"({100 * spanned[most]:.0f} % of that contour)."
        )
    if leg.ends == "held":
        yield (
            "The segment's end faces are held in their planes, as if the leg went on alike beyond "
            "them: within some 10 mm of the ends pressures are not to be relied on."
        )


def best_complete(result: StockingResult) -> Identified | None:
    """Return the best weighted search, if its state was found."""
    best = result.best
    return best if best is not None and best.worn.state.report.complete else None
