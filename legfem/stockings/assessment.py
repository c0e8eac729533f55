"""The search for a leg's stiffness in its stocking as a fit: both scans are its test, their distances its readings.

A channel holds by how much a contour moved outward from the bare scan to the one in the stocking, along the normals
of the second, beside the same of the model, less what rigid motions and errors of the pressure explain. Sensors
between stocking and skin are a channel of pressures.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from enum import StrEnum
from types import MappingProxyType
from typing import Any

import numpy as np

from legfem.common.documents import versions_of
from legfem.common.units import mpa_to_mmhg, spans_of
from legfem.geometry.slices import CONTOURS
from legfem.inverse.catalogue import LawName
from legfem.inverse.elastography import disagreement
from legfem.inverse.estimates import Estimate, correlations_of, reasons, trade_of
from legfem.inverse.fit import (
    EXACT,
    UNTESTED,
    ChannelFit,
    Computed,
    Cost,
    Fit,
    Goodness,
    Identity,
    TestFit,
    of_failed_solves,
    of_search,
    r_squared,
)
from legfem.inverse.intervals import Estimated
from legfem.inverse.notice import Notice, doubted
from legfem.inverse.parameter import Priors
from legfem.inverse.readings import Channel, Data, MeasuredTest
from legfem.inverse.trial import SearchLog
from legfem.stockings.contour_distances import ContourAccuracy
from legfem.stockings.details import StockingDetails, StockingFit
from legfem.stockings.equilibrium import PARAMETERS, EquilibriumSettings
from legfem.stockings.leg import ComparedSensor
from legfem.stockings.levels import TISSUES
from legfem.stockings.scan_fit import MISSED_BEYOND, ScanFit, by_name, stiffness_priors


class StockingNotice(StrEnum):
    """Codes that only a leg in its stocking has."""

    SENSOR_MISSED = "sensor_missed"
    NOT_COMPUTED = "worn_state_not_computed"
    UNSETTLED = "worn_state_unsettled"
    NOT_COMPARED = "no_state_compared"
    SCAN_MISSED = "scan_missed"
    STIFFNESS_AT_BOUND = "stocking_stiffness_at_bound"
    REGISTRATION_UNSETTLED = "registration_unsettled"
    BONES_APART = "bones_apart"
    SLACK = "stocking_slack"
    UNLOADED = "skin_unloaded"
    ENDS_HELD = "ends_held"


KIND = "stocking"
LAW: LawName = "neo-hookean"
_CHANNELS = {"outer": "skin_displacement", "inner": "muscle_displacement"}
"""By name of the contour; the inner one is the hull of the muscle."""
_PRESSURE = "pressure_on_skin"


def assessed(details: StockingDetails, log: SearchLog, settings: Mapping[str, Any]) -> StockingFit:
    """Result of a finished run.

    Parameters
    ----------
    details
        What it found.
    log
        Course of its search.
    settings
        Of the run, units in the names.
    """
    leg, best = details.leg, details.best
    priors = stiffness_priors(leg.elastography)
    channels = () if best is None else tuple(_channels(best, details))
    known = {} if best is None else stiffness_estimates(best, leg.accuracy, priors, log.converged)
    held = {f"{name}.D1": float(law.D1) for name, law in leg.tissues.items()}
    given = {} if best is not None else details.parameters
    fit = Fit(
        kind=KIND,
        subject=Identity(leg.id, leg.title, leg.origin),
        law=LAW,
        estimates=MappingProxyType(known),
        correlations=np.zeros((0, 0)) if best is None else correlations_of(best.log_covariance),
        values=MappingProxyType({**held, **(details.parameters if best is None else by_name(best.parameters))}),
        assumed=MappingProxyType({**held, **given}),
        goodness=UNTESTED if best is None else Goodness.of(best.objective, best.residuals - len(PARAMETERS)),
        cost=_cost(best, channels),
        agreement=EXACT,
        tests=() if best is None else (_scans(best, channels, priors),),
        log=log,
        neo_hookean_limit=False,
        weighting="covariance",
        settings=settings,
        versions=versions_of("legfem", "dolfinx", "numpy", "scipy", "python"),
        details=details,
        computed=MappingProxyType(dict(_computed(details))),
    )
    return replace(fit, notices=(*doubted(leg.doubts), *stocking_notices(fit)))


def stiffness_estimates(
    found: ScanFit, accuracy: ContourAccuracy, priors: Priors, converged: bool = True
) -> dict[str, Estimate]:
    """Return the estimates by full name; each weakly identifiable at best where the fit isn't sound.

    Parameters
    ----------
    found
        The best fit.
    accuracy
        Errors of the contours.
    priors
        The stiffnesses with what was known of them (MPa).
    converged
        Whether the search had settled.
    """
    correlations = correlations_of(found.log_covariance)
    errors = found.parameters * np.sqrt(np.diag(found.log_covariance))
    missed = ""
    if found.misses(accuracy):
        missed = "the model misses the scan, so the interval doesn't hold"
    elif not converged:
        missed = "the search ended before it had settled"
    estimates = {}
    for k, parameter in enumerate(priors.parameters):
        low, high = map(float, found.interval95[k])
        known = Estimated(parameter, float(found.parameters[k]), float(errors[k]), (low, high))
        why = reasons(known, missed, trade_of(PARAMETERS, k, correlations), data="both scans")
        estimates[parameter.name] = Estimate(
            parameter, known.value, known.standard_error, known.ci95, known.verdict(not missed), why
        )
    return estimates


def _channels(best: ScanFit, details: StockingDetails) -> Iterator[ChannelFit]:
    """Yield the contours' movement, measured and of the model, skin first; then the sensors' pressures."""
    misfit, leg = details.misfit, details.leg
    assert misfit is not None
    measured = -misfit.distances(leg.bare)
    sizes = [misfit.target.contours(name)[..., 0].size for name in CONTOURS]
    error = np.sqrt(2.0) * leg.accuracy.smoothed_sd
    for name, span in zip(CONTOURS, spans_of(sizes), strict=True):
        contour, own = misfit.target.contours(name), span
        height = np.repeat(misfit.target.levels, contour.shape[1])
        values = measured[own]
        channel = Channel(_CHANNELS[name], "mm", height, "height_mm", values, np.full(len(values), error))
        yield ChannelFit(channel, values + best.distances[own])
    if len(best.sensed):
        sensors = leg.sensors
        sd, read = np.array([(one.sd, one.pressure) for one in sensors]).T
        height = np.array([one.position[2] for one in sensors])
        yield ChannelFit(Channel(_PRESSURE, "MPa", height, "height_mm", read, sd), read + sd * best.sensed)


def _scans(best: ScanFit, channels: tuple[ChannelFit, ...], priors: Priors) -> TestFit:
    """Both scans beside the fit."""
    departures = priors.residual(best.parameters)
    goodness = Goodness.of(best.objective - float(departures @ departures), best.residuals - len(departures))
    return TestFit(MeasuredTest("both scans", Data(tuple(one.channel for one in channels))), channels, goodness)


def _cost(best: ScanFit | None, channels: tuple[ChannelFit, ...]) -> Cost:
    """Plain sum of squared distances that are left."""
    of_contours = channels[: len(CONTOURS)]
    left = np.concatenate([np.zeros(0), *(one.residual for one in of_contours)])
    squares = float(left @ left)
    measured = np.concatenate([np.zeros(0), *(one.channel.values for one in of_contours)])
    return Cost(
        value=squares,
        points=len(left),
        per_length=np.nan,
        r_squared=r_squared(squares, measured) if len(left) else np.nan,
        minimised="the sum weighted with the inverse covariance (dimensionless), and the priors' squared departures",
        minimised_value=np.nan if best is None else best.objective,
        minimised_unit="1",
        definition="sum over the contours' points of the squared distance between model and scan, less what rigid "
        "motions and errors of the pressure explain",
        reading_unit="mm",
    )


NO_SEARCH = SearchLog(names=PARAMETERS, converged=True, seed=0, wall_s=0.0)
"""Log of a run in which nothing was searched for."""


def _computed(details: StockingDetails) -> Iterator[tuple[str, Computed]]:
    """Yield the pressures on the skin and inside by key, mmHg."""
    found = details.pressures
    if found is None:
        return
    yield _PRESSURE, _pressure("mean pressure on the skin", found.mean_interface)
    for k, vein in enumerate(details.leg.veins):
        name = f"pressure at the {vein.name} vein"
        yield (
            name.replace(" the ", " ").replace(" ", "_"),
            _pressure(name, found.at_veins[k], found.at_veins_sd[k], found.vein_interval(k)),
        )
    yield "greatest_pressure_in_fat", _pressure("greatest pressure in the fat", found.greatest_in_fat)
    yield "pressure_in_muscle", _pressure("mean pressure in the muscle", found.mean_in_muscle)


def _pressure(
    name: str, value: float, sd: float = np.nan, interval: tuple[float, float] = (np.nan, np.nan)
) -> Computed:
    low, high = map(mpa_to_mmhg, interval)
    return Computed(name, mpa_to_mmhg(value), "mmHg", mpa_to_mmhg(sd), (low, high))


UNLOADED_BEYOND = 0.01
"""Share of the skin under the stretched stocking that may bear no pressure without a word."""
_FAR = 3.0
"""Standardised residual of a sensor that chance doesn't explain."""
REGISTERED_WITHIN = 0.5
"""Residual of the registration (mm) that is no cause of concern: half a voxel."""


def stocking_notices(fit: StockingFit) -> tuple[Notice, ...]:
    """Return the notices, the gravest first."""
    details = fit.details
    return (
        *_of_the_state(details),
        *([Notice.of(StockingNotice.NOT_COMPARED, reason=details.problem)] if details.problem else []),
        *of_search(fit.log),
        *of_failed_solves(fit.log, "an equilibrium with the stocking"),
        *_of_the_stiffness(fit),
        *_of_the_scans(details),
        *_of_the_load(details),
        *sensor_notices(details.sensors),
    )


def sensor_notices(sensors: Sequence[ComparedSensor]) -> Iterator[Notice]:
    """Yield a notice for every sensor that the model misses."""
    for one in sensors:
        if abs(one.standardised_residual) > _FAR:
            yield Notice.of(
                StockingNotice.SENSOR_MISSED,
                sensor=one.sensor.name,
                read=one.sensor.pressure,
                sd=one.sensor.sd,
                model=one.pressure,
                departure=abs(one.standardised_residual),
            )


def _of_the_state(details: StockingDetails) -> Iterator[Notice]:
    found = details.equilibrium
    if not found.state.report.complete:
        yield Notice.of(StockingNotice.NOT_COMPUTED, reason=found.state.report.reason)
    elif not found.converged:
        yield Notice.of(
            StockingNotice.UNSETTLED,
            states=len(found.changes),
            change=100 * found.changes[-1],
            tolerance=100 * EquilibriumSettings().tolerance,
        )


def _of_the_stiffness(fit: StockingFit) -> Iterator[Notice]:
    best, accuracy = fit.details.best, fit.details.leg.accuracy
    if best is None:
        return
    if best.misses(accuracy):
        expected = accuracy.expected_rms
        yield Notice.of(StockingNotice.SCAN_MISSED, rms=best.rms, times=MISSED_BEYOND, expected=expected)
    for name, known in fit.estimates.items():
        if (prior := known.parameter.prior) is not None:
            yield from disagreement(name, prior, known.value, known.standard_error, "the fit of both scans")
    for name, known in fit.estimates.items():
        if known.at_bound:
            yield Notice.of(StockingNotice.STIFFNESS_AT_BOUND, tissue=TISSUES[name], bound=known.at_bound)


def _of_the_scans(details: StockingDetails) -> Iterator[Notice]:
    registration = details.leg.registration
    if registration is None:
        return
    if not registration.converged:
        yield Notice.of(StockingNotice.REGISTRATION_UNSETTLED, iterations=registration.iterations)
    if registration.residual > REGISTERED_WITHIN:
        yield Notice.of(StockingNotice.BONES_APART, residual=registration.residual)


def _of_the_load(details: StockingDetails) -> Iterator[Notice]:
    leg, load = details.leg, details.equilibrium.load
    levels, slack = leg.bare.levels, load.tension == 0
    if slack.any():
        where = levels[slack]
        yield Notice.of(
            StockingNotice.SLACK,
            slack=int(slack.sum()),
            levels=len(levels),
            low=float(where.min()),
            high=float(where.max()),
        )
    spanned = load.unloaded_skin
    if spanned.mean() > UNLOADED_BEYOND:
        most = int(np.argmax(spanned))
        yield Notice.of(
            StockingNotice.UNLOADED,
            share=100 * float(spanned.mean()),
            level=float(levels[most]),
            most=100 * float(spanned[most]),
        )
    if leg.ends == "held":
        yield Notice.of(StockingNotice.ENDS_HELD)
