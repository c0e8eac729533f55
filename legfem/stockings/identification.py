"""Identification of fat and muscle from the contours of a leg with and without its stocking, and its pressures.

A `legfem.inverse.problem.Problem` like others: its test is the pair of scans, with what sensors read under the
stocking, and every full solve an equilibrium of leg and stocking.

What was found is shown as a fit (`assessed`) whose readings are distances. A channel holds by how much a contour moved
outward from the bare scan to the one in the stocking, along the normals of the second, beside the same of the model,
less what rigid motions and errors of the pressure explain. What sensors read under the stocking is another channel.
"""

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from mpi4py import MPI

from legfem.common.documents import versions_of
from legfem.common.progress import Progress
from legfem.common.units import FloatArray, kpa_to_mpa, mpa_to_mmhg, spans_of
from legfem.experiments.compression import CompressionSettings
from legfem.geometry.slices import CONTOURS, SliceSet
from legfem.inverse.answer import doubted
from legfem.inverse.catalogue import IdentifiedLaw, LawName
from legfem.inverse.comparison import Covariances
from legfem.inverse.estimates import Optimum, estimates
from legfem.inverse.fit import ChannelFit, Computed, Cost, Fit, Goodness, Identity, TestFit, r_squared
from legfem.inverse.intervals import SquaresProfile, quantile
from legfem.inverse.least_squares import Residual, least_residual
from legfem.inverse.outcome import FullSolver
from legfem.inverse.problem import fit_with, goodness_of, log_of, search_settings
from legfem.inverse.readings import Channel
from legfem.inverse.search import Search, SearchError
from legfem.inverse.searches import Found
from legfem.inverse.settings import Genetic, IdentificationSettings
from legfem.inverse.trial import SearchLog
from legfem.meshing.leg_sizes import SolidMeshSettings, settings_for_cells
from legfem.stockings.contour_distances import ContourMisfit
from legfem.stockings.details import StockingDetails, StockingFit, stocking_notices
from legfem.stockings.discrepancy import model_discrepancy
from legfem.stockings.equilibrium import PARAMETERS, SURFACES, EquilibriumSolver, LegModel3D
from legfem.stockings.fabric import stocking_load
from legfem.stockings.leg import SensorArray, StockingLeg
from legfem.stockings.levels import LevelPressure
from legfem.stockings.nuisances import NuisanceSlopes
from legfem.stockings.pressures import PressureProbe, tissue_pressures, vein_pressure_sd
from legfem.stockings.scan_fit import BOUNDS, ScanComparison, ScanFit, StockingForward, by_name, stiffness_priors
from legfem.stockings.tape import TapeDetails, TapeFit

KIND, TAPE = "stocking", "tape"
"""Of results: of a leg that was scanned, and of one by tape."""
LAW: LawName = "neo-hookean"
_CHANNELS = {"outer": "skin_displacement", "inner": "muscle_displacement"}
"""By name of the contour; the inner one is the hull of the muscle."""
_PRESSURE = "pressure_on_skin"


_NO_COST = Cost(
    definition="sum over the contours' points of the squared distance between model and scan, less what rigid "
    "motions and errors of the pressure explain",
    reading_unit="mm",
)
_MINIMISED = "the sum weighted with the inverse covariance (dimensionless), and the priors' squared departures"


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
    given = MappingProxyType({f"{n}.D1": law.D1 for n, law in details.leg.tissues.items()} | details.parameters)
    fit = _told(KIND, details, log, given, settings)
    return noticed(replace(fit, computed={**dict(_computed(details)), **fit.computed}))


def _told[Details: TapeDetails](
    kind: str, details: Details, log: SearchLog, given: Mapping[str, float], settings: Mapping[str, Any]
) -> Fit[Details]:
    leg = details.leg
    return Fit(
        kind=kind,
        subject=Identity(leg.id, leg.title, leg.origin, leg.directory),
        law=LAW,
        values=given,
        assumed=given,
        cost=_NO_COST,
        log=log,
        settings=settings,
        versions=versions_of("legfem", "dolfinx", "numpy", "scipy", "python"),
        details=details,
        notices=doubted(leg.doubts),
        computed=dict(map(_at_level, details.at_levels)),
    )


def _at_level(one: LevelPressure) -> tuple[str, Computed]:
    mean, (low, high) = one.mean_pressure_mmHg, one.ci95_mmHg
    name = f"mean pressure at {one.level}"
    return f"pressure_at_{one.level}", Computed(mean, (high - low) / (2 * quantile(0)), (low, high), "mmHg", name)


def by_tape(leg: StockingLeg) -> TapeFit:
    """Return what follows from the girths of a leg, in the form of a fit that was compared with nothing."""
    return _told(TAPE, TapeDetails(leg), NO_SEARCH, {}, {})


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
    cost = replace(fit.cost, value=squares, points=len(left), r_squared=r_squared(squares, measured))
    return noticed(
        replace(
            fit,
            estimates=MappingProxyType(estimates(optimum)),
            correlations=optimum.correlations,
            values=MappingProxyType({**fit.assumed, **found.best.values}),
            assumed=MappingProxyType({name: fit.assumed[name] for name in fit.assumed if name not in PARAMETERS}),
            goodness=goodness_of(found, covariance, nuisances),
            cost=replace(cost, minimised=_MINIMISED, minimised_value=found.best.objective),
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
        inside = _pressure(name, found.at_veins[k], found.at_veins_sd[k], found.vein_interval(k))
        yield name.replace(" the ", " ").replace(" ", "_"), inside
    yield "greatest_pressure_in_fat", _pressure("greatest pressure in the fat", found.greatest_in_fat)
    yield "pressure_in_muscle", _pressure("mean pressure in the muscle", found.mean_in_muscle)


def _pressure(
    name: str, value: float, sd: float = np.nan, interval: tuple[float, float] = (np.nan, np.nan)
) -> Computed:
    low, high = map(mpa_to_mmhg, interval)
    return Computed(mpa_to_mmhg(value), mpa_to_mmhg(sd), (low, high), "mmHg", name)


SAMPLED_AT = kpa_to_mpa(np.array([[3.0, 3.0], [1.5, 12.0], [6.0, 1.5]]))
"""C10 of muscle and fat (MPa) at which the leg's response to the nuisances is computed, and the search begins."""

SEARCH = IdentificationSettings(minimiser=Genetic(population=24, generations=30))
CELLS = 15_000
"""About how many tetrahedra a leg has."""


@dataclass(frozen=True, eq=False)
class ScanProblem:
    """Both scans of a leg, a `legfem.inverse.problem.Problem`.

    Parameters
    ----------
    leg
        That was scanned in its stocking.
    forward
        Its model.
    scans
        Both scans and the sensors beside the model.
    progress
        Where the work is told.
    """

    leg: StockingLeg
    forward: StockingForward
    scans: ScanComparison
    progress: Progress
    sensitivities: tuple[str, ...] = PARAMETERS
    weighs_shared_errors: bool = False

    @cached_property
    def unknowns(self) -> Mapping[LawName, IdentifiedLaw]:
        """Stiffness of muscle and fat, looked for from where the nuisances' effects are computed."""
        parameters, starts = stiffness_priors(self.leg.elastography).parameters, tuple(map(by_name, SAMPLED_AT))
        return {LAW: IdentifiedLaw(LAW, parameters, {}, self.forward.nominal, starts=starts)}

    def fitted(self, settings: IdentificationSettings) -> StockingFit:
        """Search, from where the nuisances' effects are computed.

        Raises
        ------
        SearchError
            If the leg can't be computed there.
        """
        with FullSolver(self.forward, None, 1, self.progress, PARAMETERS) as solver:
            self.progress.stage("effects of what isn't known exactly of scans and pressure")
            for parameters in SAMPLED_AT:
                (outcome,) = solver.solve([by_name(parameters)])
                if outcome.complete:
                    self.scans.nuisances.sample(parameters, self.forward.at(outcome.values))
            if not self.scans.nuisances.samples:
                raise SearchError(f"the leg in its stocking could not be computed ({outcome.reason})")
            (fit,) = fit_with(self, [LAW], solver, settings)
        return fit

    def comparison(self, law: IdentifiedLaw, near: Found[ScanComparison] | None = None) -> ScanComparison:
        """Both scans beside the model."""
        return self.scans

    def refined(self, search: Search[ScanComparison]) -> None:
        """Leave the comparison as it is: its weights follow the stiffness."""

    def assessed(self, found: Found[ScanComparison]) -> StockingFit:
        """Result of the finished search, with the leg in equilibrium with its stocking."""
        best = ScanFit.of(found)
        intervals = profile_intervals(found, best.log_covariance) if found.search.converged else []
        self.progress.stage("where model and scan differ")
        discrepancy = model_discrepancy(self.forward, self.scans, best)
        self.progress.advance(discrepancy.verdict)
        log = log_of(found)
        costs = [np.nan if one.prediction is None else np.sum(self.scans.left(one) ** 2) for one in found.trials]
        solves = tuple(replace(one, cost=float(cost)) for one, cost in zip(log.solves, costs, strict=True))
        # What is emulated are differences in standard deviations, and no forces.
        log = replace(log, solves=solves, emulator_error=np.nan)
        details = _dressed(self.leg, self.forward, self.progress, best)
        details = replace(details, best=best, discrepancy=discrepancy)
        return compared(assessed(details, log, search_settings(found.search)), best, found, intervals)


MOST = 6
"""Equilibria that are solved for intervals' ends at most."""
LEAST_WAY = 0.2
"""Distance in log stiffness beyond the nearest equilibrium that one more is worth."""


def profile_intervals(found: Found[ScanComparison], log_covariance: FloatArray) -> list[tuple[float, float]]:
    """Return 95 % intervals of the stiffnesses by profile likelihood, MPa; 0 and infinity where open.

    The profile of one stiffness is the least sum of squares with it held, over the other stiffness and the nuisances,
    between the equilibria that were solved (`legfem.inverse.emulator`). Where an end of an interval lies too far from
    all of them, one more is solved on the way there. An interval that reaches a bound of the search, or stiffnesses at
    which the leg can't be computed, is open.

    Parameters
    ----------
    found
        The finished search.
    log_covariance : (2, 2) array
        Covariance of the stiffnesses' logarithms, for a first guess.
    """
    search, times = found.search, quantile(0)
    box = np.tile(np.log(BOUNDS), (len(PARAMETERS), 1))
    half = np.clip(times * np.sqrt(np.diag(log_covariance)), 0.02, 1.0)
    for solved in range(MOST + 1):
        left = found.residual

        def residual(logs: FloatArray, left: Residual = left) -> FloatArray:
            return left(np.exp(logs))

        least = least_residual(residual, np.clip(np.log(found.best.point), *box.T), box)
        profiles = [SquaresProfile(residual, least, k, box, width) for k, width in enumerate(half)]
        ends = np.array([one.interval(times**2) for one in profiles])
        points = np.array([one.refitted(end) for one, own in zip(profiles, ends, strict=True) for end in own])
        nearest, share = search.trust.share_of_way(search.coordinates.of(np.exp(points)))
        way = share * np.linalg.norm(points - nearest, axis=1)
        if solved == MOST or (share >= 1.0).all() or way.max() < LEAST_WAY:
            break
        farthest = int(np.argmax(np.where(share < 1.0, way, 0.0)))
        search.solve(np.exp(nearest + share[:, None] * (points - nearest))[[farthest]], "design")
    known = (share >= 1.0).reshape(ends.shape) & (np.abs(ends - box) > 1e-9)
    return [(float(low), float(high)) for low, high in np.where(known, np.exp(ends), (0.0, np.inf))]


def identify_in_stocking(
    leg: StockingLeg,
    progress: Progress,
    cells: int = CELLS,
    comm: MPI.Intracomm = MPI.COMM_SELF,
    mesh: SolidMeshSettings | None = None,
    folder: Path | None = None,
) -> StockingFit:
    """Mesh a leg, identify its tissues if it was scanned in its stocking, and compute its pressures.

    Parameters
    ----------
    leg, progress
        What is run, and where it is told.
    cells
        About how many tetrahedra.
    comm
        Ranks that share one solution; all call.
    mesh
        Element sizes; from ``cells`` by default.
    folder
        Where equilibria are stored, so that the same run goes on where it was stopped.
    """
    started = time.perf_counter()
    progress.stage("mesh")
    mesh = mesh or settings_for_cells(leg.bare, cells)
    model = LegModel3D(leg.bare, leg.tissues, mesh, CompressionSettings(ends=leg.ends), comm)
    progress.advance(f"{model.compression.spaces.unknowns} unknowns")
    forward = StockingForward(EquilibriumSolver(model, leg.stocking, folder=folder))
    fit = None
    problem = ""
    if leg.compressed is not None:
        target = SliceSet.of(leg.compressed, leg.slices)
        misfit = ContourMisfit.between(target, leg.accuracy, leg.scanned_bare, leg.bare)
        sensors = SensorArray.on(leg.bare, leg.sensors)
        scans = ScanComparison(leg.bare, misfit, NuisanceSlopes(forward.solver, misfit, sensors), sensors)
        try:
            fit = ScanProblem(leg, forward, scans, progress).fitted(SEARCH)
        except SearchError as error:
            problem = str(error)
    if fit is None:
        details = replace(_dressed(leg, forward, progress), problem=problem)
        fit = assessed(details, NO_SEARCH, {})
    log = replace(fit.log, wall_s=time.perf_counter() - started)
    return replace(fit, log=log, settings={"cells": cells, **fit.settings})


def _dressed(
    leg: StockingLeg, forward: StockingForward, progress: Progress, best: ScanFit | None = None
) -> StockingDetails:
    """Put a leg into equilibrium with its stocking at the stiffness that was found, or given, and probe it."""
    solver, tension = forward.solver, None
    model = solver.model
    if best is None or leg.known:
        parameters = {f"{name}.C10": float(law.C10) for name, law in leg.tissues.items()}
        # The stiffness counts as exact, the fabric's tension as well as it is stated.
        covariance: FloatArray = np.diag([0.0, 0.0, leg.accuracy.tension_sd**2])
    else:
        parameters, tension = dict(best.stiffness), best.tension
        covariance = best.log_covariance if tension is None else tension.log_covariance
    progress.stage("the leg in equilibrium with its stocking")
    error = 0.0 if tension is None else tension.value
    found = solver.solve(parameters, PARAMETERS, None if best is None else forward.at(best.stiffness), error)
    progress.advance(f"{len(found.changes)} states")
    borne = replace(found, load=found.load.times(1 + error))
    on_scan = None if leg.compressed is None else stocking_load(leg.compressed, leg.stocking)
    sensors = SensorArray.on(leg.bare, leg.sensors).compared(borne.load.pressure)
    details = StockingDetails(leg, model, on_scan, parameters, borne, sensors, solver.states)
    if not found.state.report.complete:
        return details
    probe = PressureProbe(model.compression)
    pressures = tissue_pressures(probe, found.state, borne.load, leg.veins)
    sd = vein_pressure_sd(solver, found, probe, leg.veins, parameters, covariance, leg.accuracy.pressure_sd, error)
    progress.advance("errors of the pressures at the veins")
    return replace(
        details,
        states=solver.states,
        moved={part: model.displacement(part, found.state.unknown) for part in SURFACES},
        pressures=replace(pressures, at_veins_sd=tuple(map(float, sd))),
        section=probe.section(leg.bare, float(np.median(leg.slices)), borne),
        fat=probe.fat(leg.bare, borne),
    )
