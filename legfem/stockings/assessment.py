"""The search for a leg's stiffness in its stocking as a fit: both scans are its test, their distances its readings.

A channel holds by how much a contour moved outward from the bare scan to the one in the stocking, along the normals
of the second, beside the same of the model, less what rigid motions and errors of the pressure explain. Sensors
between stocking and skin are a channel of pressures.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np

from legfem.common.documents import versions_of
from legfem.common.units import mpa_to_mmhg, spans_of
from legfem.geometry.slices import CONTOURS
from legfem.inverse.answer import doubted
from legfem.inverse.catalogue import LawName
from legfem.inverse.comparison import Covariances
from legfem.inverse.estimates import Optimum, estimates
from legfem.inverse.fit import ChannelFit, Computed, Cost, Fit, Goodness, Identity, TestFit, r_squared
from legfem.inverse.intervals import quantile
from legfem.inverse.problem import goodness_of
from legfem.inverse.readings import Channel
from legfem.inverse.searches import Found
from legfem.inverse.trial import SearchLog
from legfem.stockings.details import StockingDetails, StockingFit, stocking_notices
from legfem.stockings.equilibrium import PARAMETERS
from legfem.stockings.leg import StockingLeg
from legfem.stockings.scan_fit import ScanComparison, ScanFit

KIND = "stocking"
LAW: LawName = "neo-hookean"
_CHANNELS = {"outer": "skin_displacement", "inner": "muscle_displacement"}
"""By name of the contour; the inner one is the hull of the muscle."""
_PRESSURE = "pressure_on_skin"


_NO_COST = Cost(
    definition="sum over the contours' points of the squared distance between model and scan, less what rigid "
    "motions and errors of the pressure explain",
    reading_unit="mm",
)


def assessed(details: StockingDetails, log: SearchLog, settings: Mapping[str, Any]) -> StockingFit:
    """Result of a run that compared nothing.

    Parameters
    ----------
    details
        What it found.
    log
        Course of its search.
    settings
        Of the run, units in the names.
    """
    leg = details.leg
    given = MappingProxyType({f"{name}.D1": law.D1 for name, law in leg.tissues.items()} | details.parameters)
    return noticed(
        Fit(
            kind=KIND,
            subject=Identity(leg.id, leg.title, leg.origin, leg.directory),
            law=LAW,
            values=given,
            assumed=given,
            cost=_NO_COST,
            log=log,
            settings=settings,
            versions=versions_of("legfem", "dolfinx", "numpy", "scipy", "python"),
            details=details,
            computed=MappingProxyType(dict(_computed(details))),
        )
    )


def noticed(fit: StockingFit) -> StockingFit:
    """Return a fit with its notices."""
    return replace(fit, notices=(*doubted(fit.details.leg.doubts), *stocking_notices(fit)))


def compared(
    fit: StockingFit, best: ScanFit, found: Found[ScanComparison], intervals: Sequence[tuple[float, float]]
) -> StockingFit:
    """Return the result of a run that compared nothing, with what a search found.

    Parameters
    ----------
    fit
        That result.
    best
        The best fit of both scans.
    found
        The finished search.
    intervals : sequence of tuple of float
        95 % intervals of the stiffnesses, MPa; none where the search didn't settle.
    """
    sound = found.search.converged and not best.misses
    covariance = found.search.misfit.covariance
    errors: Covariances = {"recordings": covariance}
    optimum = Optimum(found, errors, quantile(0), sound, intervals=intervals)
    channels = tuple(_channels(best, fit.details.leg))
    left = np.concatenate([one.residual for one in channels[: len(CONTOURS)]])
    measured = np.concatenate([one.channel.values for one in channels[: len(CONTOURS)]])
    squares, nuisances = float(left @ left), len(best.nuisance)
    differences = found.linear.residual[: len(covariance)]
    goodness = Goodness.of(float(differences @ differences), len(covariance) - nuisances)
    return noticed(
        replace(
            fit,
            estimates=MappingProxyType(estimates(optimum)),
            correlations=optimum.correlations,
            values=MappingProxyType({**fit.assumed, **found.best.values}),
            assumed=MappingProxyType({name: fit.assumed[name] for name in fit.assumed if name not in PARAMETERS}),
            goodness=goodness_of(found, covariance, nuisances),
            cost=replace(
                fit.cost,
                value=squares,
                points=len(left),
                r_squared=r_squared(squares, measured),
                minimised="the sum weighted with the inverse covariance (dimensionless), and the priors' squared "
                "departures",
                minimised_value=found.best.objective,
            ),
            tests=(TestFit("both scans", channels, goodness),),
        )
    )


def _channels(best: ScanFit, leg: StockingLeg) -> Iterator[ChannelFit]:
    """Yield the contours' movement, measured and of the model, skin first; then the sensors' pressures."""
    misfit = best.misfit
    measured = -misfit.distances(leg.bare)
    sizes = [misfit.target.contours(name)[..., 0].size for name in CONTOURS]
    error = np.sqrt(2.0) * leg.accuracy.smoothed_sd
    for name, span in zip(CONTOURS, spans_of(sizes), strict=True):
        values = measured[span]
        height = np.repeat(misfit.target.levels, misfit.target.contours(name).shape[1])
        channel = Channel(_CHANNELS[name], "mm", height, "height_mm", values, np.full(len(values), error))
        yield ChannelFit(channel, values + best.distances[span])
    if len(best.sensed):
        sensors = leg.sensors
        sd, read = np.array([(one.sd, one.pressure) for one in sensors]).T
        height = np.array([one.position[2] for one in sensors])
        yield ChannelFit(Channel(_PRESSURE, "MPa", height, "height_mm", read, sd), read + sd * best.sensed)


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
    return Computed(mpa_to_mmhg(value), mpa_to_mmhg(sd), (low, high), "mmHg", name)
