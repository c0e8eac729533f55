"""Warnings that a result of a leg in its stocking carries."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from legfem.common.units import FloatArray, mpa_to_kpa, mpa_to_mmhg
from legfem.geometry.leg_shape import SKIN, LegShape
from legfem.legs.notices import disagreement
from legfem.stockings.details import StockingDetails, StockingFit
from legfem.stockings.equilibrium import EquilibriumSettings
from legfem.stockings.estimates import MISSED_BEYOND, expected_rms, model_misses, starts_agree
from legfem.stockings.fabric import StockingLoad
from legfem.stockings.leg import ComparedSensor
from legfem.stockings.leg_model import PARAMETERS
from legfem.stockings.scan_fit import by_name

TISSUES = dict(zip(PARAMETERS, ("muscle", "fat"), strict=True))
UNLOADED_BEYOND = 0.01
"""Share of the skin under the stretched stocking that may bear no pressure without a word."""
_FAR = 3.0
"""Standardised residual of a sensor that chance doesn't explain."""
REGISTERED_WITHIN = 0.5
"""Residual of the registration (mm) that is no cause of concern: half a voxel."""


def stocking_notices(fit: StockingFit) -> tuple[str, ...]:
    """Return the warnings as sentences, the gravest first."""
    details = fit.details
    return tuple(
        [
            *_of_the_state(details),
            *_of_the_searches(details),
            *_of_the_stiffness(fit),
            *_of_the_scans(details),
            *_of_the_load(details),
            *sensor_notices(details.sensors),
        ]
    )


def sensor_notices(sensors: Sequence[ComparedSensor]) -> Iterator[str]:
    """Yield a sentence for every sensor that the model misses."""
    for one in sensors:
        if abs(one.standardised_residual) > _FAR:
            read, sd, model = (mpa_to_mmhg(p) for p in (one.sensor.pressure, one.sensor.sd, one.pressure))
            yield (
                f"The sensor {one.sensor.name} read {read:.1f} ± {sd:.1f} mmHg, where the model "
                f"has {model:.1f} mmHg ({abs(one.standardised_residual):.0f} standard deviations off): its "
                "place, its error or the fabric is otherwise than was given (a fabric that isn't "
                "known well: [accuracy] tension_relative_sd)."
            )


def unloaded_skin(shape: LegShape, load: StockingLoad) -> FloatArray:
    """Return the share of each level's skin that bears no pressure, (n_levels,).

    The stretched fabric spans a hollow or a flat there; at levels where it is slack the share is 0.
    """
    assert load.pressure.shape == shape.contours[SKIN].shape[:2]
    share = (load.pressure < 1e-3 * load.pressure.max()).mean(axis=1)
    return np.where(load.tension > 0, share, 0.0)


def _of_the_state(details: StockingDetails) -> Iterator[str]:
    found = details.equilibrium
    if not found.state.report.complete:
        yield (
            "The leg in its stocking could not be computed "
            f"({found.state.report.reason}): there are no pressures inside the leg."
        )
    elif not found.converged:
        yield (
            "The stocking's pressure and the shape that it makes did not settle: in the last of "
            f"{len(found.changes)} states the pressure still changed by "
            f"{100 * found.changes[-1]:.2g} % of its greatest, not by less than "
            f"{100 * EquilibriumSettings().tolerance:g} %."
        )


def _of_the_searches(details: StockingDetails) -> Iterator[str]:
    if not details.searches:
        return
    for search in details.searches:
        name = "Nelder-Mead's search" if search.method == "nelder-mead" else "A search"
        start = " and ".join(
            f"{mpa_to_kpa(value):.3g} kPa in the {TISSUES[parameter]}"
            for parameter, value in by_name(search.start).items()
        )
        report = search.equilibrium.state.report
        if not report.complete:
            yield f"{name} from {start} met a state that could not be computed ({report.reason})."
        elif not search.converged:
            yield f"{name} from {start} ended before it had settled."
    if not starts_agree(details.weighted):
        yield "The starts did not all lead to the same stiffness: the one that fits the scan best counts."


def _of_the_stiffness(fit: StockingFit) -> Iterator[str]:
    best, accuracy = fit.details.best, fit.details.leg.accuracy
    if best is None:
        return
    if model_misses(best, accuracy):
        yield (
            f"The model misses the scan: its contours are {best.rms:.2f} mm off (root mean "
            f"square), more than {MISSED_BEYOND:g} times the {expected_rms(accuracy):.2f} mm that "
            "errors of the contours cause. The intervals of the stiffness are then too narrow: check the "
            "contours."
        )
    for name, known in fit.estimates.items():
        if (prior := known.parameter.prior) is not None:
            yield from disagreement(name, prior, known.value, known.standard_error, "the fit of both scans")
    for name, known in fit.estimates.items():
        if known.at_bound:
            yield (
                f"The stiffness of the {TISSUES[name]} stands at the search's {known.at_bound} bound: it is not known."
            )


def _of_the_scans(details: StockingDetails) -> Iterator[str]:
    registration = details.leg.registration
    if registration is None:
        return
    if not registration.converged:
        yield f"The registration on the bones did not settle in {registration.iterations} iterations."
    if registration.residual > REGISTERED_WITHIN:
        yield (
            f"The bones of the two scans are {registration.residual:.2f} mm apart after "
            "registration: their outlines differ, or the scans are not of one leg."
        )


def _of_the_load(details: StockingDetails) -> Iterator[str]:
    leg, load = details.leg, details.equilibrium.load
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
            "The modelled part's end faces are held in their planes, as if the leg continued unchanged beyond "
            "them. Do not rely on pressures within about 10 mm of the ends."
        )
