"""What the fit of a leg has beside that of any test: corrections, own solves in 3D, and their states for pictures."""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from legfem.common.units import FloatArray, mpa_to_kpa
from legfem.experiments.indenter_pose import LegIndenter, Pose
from legfem.experiments.leg_3d import LegIndentation3D
from legfem.fem.fields import FieldReader
from legfem.fem.spaces import BodySurface, surface_of
from legfem.geometry.leg_shape import HULL, SKIN, LegShape, TriangleSurface
from legfem.geometry.section import MUSCLE
from legfem.inverse.answer import Answer
from legfem.inverse.catalogue import DEEP_C10, DEEP_C20, Values, with_units
from legfem.inverse.document import members_of
from legfem.inverse.fit import Fit, KindDetails, answer_of
from legfem.inverse.station_test import FittedStations
from legfem.jobs.store import read_arrays, write_arrays
from legfem.legs.site import curve_of
from legfem.legs.subject import SitedLeg, Subject
from legfem.solve.path import ForceCurve


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
    beyond: Mapping[str, float] = field(default_factory=dict)
    """See `legfem.inverse.correction.TabulatedCorrection`."""


@dataclass(frozen=True)
class Confirmation:
    """One full solve of the leg in 3D, at the optimum of a search on the corrected section."""

    c10: float
    """MPa, as ``c20``."""
    c20: float
    seconds: float
    """Duration of the solve, s."""
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
    """Length of the leg modelled, mm."""
    confirmations: tuple[Confirmation, ...]
    """Of this law, in their order; none where another law's solves used the budget up."""
    full_solves: int
    """So far, of all laws."""
    rough_solves: int
    """By larger elements, which measured errors."""
    errors: Mapping[str, float]
    """Greatest error of P from `legfem.inverse.correction.FIRST_RATIO` on, by its cause."""
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
class StiffnessMap:
    """The muscle's C10 at n points of the section, see `legfem.legs.stiffness_field`; its members are a document's."""

    points_mm: FloatArray
    """(n, 2)."""
    C10_kPa: FloatArray
    log_sd: FloatArray
    """(n,): standard deviations of ln C10."""
    told: NDArray[np.bool_]
    """(n,): where the recordings tell enough of it; the others are grey."""
    stands_out: NDArray[np.int_]
    """Numbers of the points that stand out from the whole muscle, each the farthest about itself."""
    whole_kPa: float
    """C10 about which the field is."""
    muscles: Mapping[str, tuple[float, float]]
    """Mean C10 (kPa) of each muscle that is known by name, and standard deviation of its logarithm."""
    prior_log_sd: float
    """As `log_sd`, before the test."""
    finest_mm: float
    """Size below which nothing is resolved."""
    p_value: float
    """Of the recordings beside a muscle with this field."""
    converged: bool


@dataclass(frozen=True, eq=False)
class LegDetails(KindDetails):
    """What a fit of a leg has beside that of any test."""

    leg: SitedLeg
    """With its sites; one pressed in one way has one."""
    own_errors: Values
    """Standard deviations by which each site's instrument errs, by full name."""
    corrections: tuple[AppliedCorrection | None, ...]
    """Correction of each site's force at the optimum."""
    stations: tuple[FittedStations, ...] = ()
    """Each site's recordings, as they were weighed."""
    spatial: SpatialEvidence | SpatialSites | None = None
    """What the leg's own solves in 3D are and say; None of a model in plane strain with a table's correction."""
    field: StiffnessMap | None = None
    """Where the muscle is stiffer and where softer, where that was asked for."""

    @property
    def subject(self) -> Subject:
        """The first site, whose tissues are those of all."""
        return self.leg.sites[0]

    def answer(self, fit: Fit["LegDetails"]) -> Answer:
        """Return what the leg's fit says, with the muscle's C10 where that was given."""
        held = None if DEEP_C10 in fit.estimates else {**fit.assumed, **fit.values}[DEEP_C10]
        tissue = "pad" if MUSCLE in self.subject.section.lacks else MUSCLE
        return answer_of(fit, C10_given=held, tissue=tissue)

    def members(self, fit: Any) -> dict[str, Any]:
        """Model, solves in 3D, fibres, and what the sites' instruments err by."""
        fibres, applied = self.subject.fibres, self.corrections[0]
        return {
            "correlation_c10_c20": fit.correlation(DEEP_C10, DEEP_C20),
            "own_errors_of_sites_sd": with_units(self.own_errors),
            "model": "2d" if self.spatial is None else "3d",
            "spatial": _spatial(self.spatial),
            **({} if self.field is None else {"field": asdict(self.field)}),
            "fibres": None
            if fibres is None
            else {
                "ratio": fibres.value,
                **members_of(fibres, "sd", "provenance", "source"),
                "in_correction": applied is not None and applied.with_fibres,
            },
        }

    def members_of_test(self, fit: Any, number: int) -> dict[str, Any]:
        """Correction and noise at a site."""
        curve = curve_of(fit.tests[number])
        applied = self.corrections[number]
        return {
            "subject": self.leg.sites[number].id,
            "correction": None if applied is None else applied.name,
            "correction_P": None if applied is None else applied.P,
            "correction_P_sd": None if applied is None else applied.sd,
            "noise": {
                "reading_force_sd_N": curve.white_sd,
                "trials": curve.n_trials,
                "source": "repeats and instrument" if curve.n_trials > 1 else "instrument",
            },
        }

    @property
    def plane(self) -> bool:
        """Whether the search went on a section in plane strain."""
        return not isinstance(self.spatial, SpatialSites)


def _spatial(found: SpatialEvidence | SpatialSites | None) -> dict[str, Any] | None:
    if found is None:
        return None
    if isinstance(found, SpatialSites):
        return asdict(found)
    return {
        **members_of(found, "shape", "extruded", "converged", "full_solves", "rough_solves"),
        "length_mm": found.length,
        "confirmations": [
            {
                "c10_kPa": mpa_to_kpa(one.c10),
                "c20_kPa": mpa_to_kpa(one.c20),
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


_STATES = 10
"""About how many are kept, between which pictures interpolate."""
_LEVELS, _POINTS = 41, 120
"""Heights, and points of a contour at most, at which a leg is looked at."""
_FIELDS = ("skin", "hull", "pressure")
_QUARTERS = np.array([(0, 5, 4), (5, 1, 3), (4, 3, 2), (3, 4, 5)])
"""A second-order triangle as four, in the order of DOLFINx' nodes."""


@dataclass(frozen=True, eq=False)
class LegState:
    """A leg's surfaces at one displacement of the cylinder."""

    displacement: float
    """mm."""
    skin: FloatArray
    """Movement of the skin's points (mm), (n_levels, n_points, 3)."""
    hull: FloatArray
    """Movement of the muscles' outer face, likewise."""
    pressure: FloatArray
    """Pressure of the cylinder on the skin, kPa, (n_levels, n_points)."""


@dataclass(frozen=True, eq=False)
class PressedLeg:
    """A leg's solve in 3D, to be looked at."""

    shape: LegShape
    """At the levels and points of the states."""
    indenter: LegIndenter
    """What presses it."""
    pose: Pose
    touch: FloatArray
    """Its middle (3,), mm, at first contact."""
    curve: ForceCurve
    states: tuple[LegState, ...]


def seen(shape: LegShape) -> LegShape:
    """Return a leg's shape at the levels and points at which it is looked at."""
    levels = np.linspace(shape.levels[0], shape.levels[-1], _LEVELS)
    fine = shape.at_levels(levels)
    return LegShape(levels, {part: xy[:, :: -(-xy.shape[1] // _POINTS)] for part, xy in fine.contours.items()})


@dataclass(eq=False)
class LegFilm:
    """States of solves under their keys: in memory, and in a folder if one is given.

    A solve that was killed and goes on adds to the states that it had. What is missing or cut short
    counts as absent: pictures are no result.
    """

    folder: Path | None = None
    _taken: dict[str, list[LegState]] = field(default_factory=dict)

    def states(self, key: str) -> list[LegState]:
        """Return a solve's states, in their order."""
        if key not in self._taken:
            self._taken[key] = [] if self.folder is None else _read(self.folder / f"{key}.npz")
        return self._taken[key]

    def add(self, key: str, state: LegState) -> None:
        """Add a state; those at greater displacements are of an attempt that was given up."""
        before = [one for one in self.states(key) if one.displacement < state.displacement]
        self._taken[key] = [*before, state]
        if self.folder is not None:
            self.folder.mkdir(parents=True, exist_ok=True)
            taken = self._taken[key]
            columns = {name: np.array([getattr(one, name) for one in taken], dtype=np.float32) for name in _FIELDS}
            columns["displacement"] = np.array([one.displacement for one in taken])
            write_arrays(self.folder / f"{key}.npz", columns, compressed=True)


@dataclass(eq=False)
class LegCamera:
    """Takes states of a leg while it is solved, about evenly along its way."""

    experiment: LegIndentation3D
    depth: float
    """mm, to which it is pressed."""
    film: LegFilm

    def take(self, key: str, at: float) -> None:
        """Keep the state at a displacement (mm) for a solve, unless one near before it is there."""
        known = [s.displacement for s in self.film.states(key) if s.displacement < at]
        last = known[-1] if known else 0.0
        if at - last < self.depth / _STATES and not np.isclose(at, self.depth):
            return
        system = self.experiment.system
        nodal = system.unknown.x.array[system.spaces.displacement_dofs].reshape(-1, 3)
        hull = self._to_hull @ self._hull.values(nodal)
        pressure, movement = self._reader.on_skin()
        skin = self._to_skin[1] @ movement.x.array.reshape(-1, 3)
        on_points = self._to_skin[0] @ pressure.x.array
        levels, points, _ = self.shape.points(SKIN).shape
        skin, hull = skin.reshape(levels, points, 3), hull.reshape(levels, -1, 3)
        self.film.add(key, LegState(at, skin, hull, on_points.reshape(levels, points)))

    @cached_property
    def shape(self) -> LegShape:
        """The leg as it is looked at."""
        return seen(self.experiment.shape)

    @cached_property
    def _reader(self) -> FieldReader:
        return FieldReader(self.experiment.system)

    @cached_property
    def _hull(self) -> BodySurface:
        return surface_of(self.experiment.system.spaces, "hull")

    @cached_property
    def _to_hull(self) -> csr_matrix:
        return self._hull.surface.weights(self.shape.points(HULL).reshape(-1, 3))

    @cached_property
    def _to_skin(self) -> tuple[csr_matrix, csr_matrix]:
        """From the pressure, linear in every facet, and from the movement, at its midsides too."""
        pressure, movement = (field.function_space for field in self._reader.on_skin())
        points = self.shape.points(SKIN).reshape(-1, 3)
        facets = TriangleSurface(pressure.tabulate_dof_coordinates(), pressure.dofmap.list)
        quarters = movement.dofmap.list[:, _QUARTERS].reshape(-1, 3)
        fine = TriangleSurface(movement.tabulate_dof_coordinates(), quarters)
        return facets.weights(points), fine.weights(points)


def _read(path: Path) -> list[LegState]:
    kept = read_arrays(path)
    displacements = enumerate(kept.get("displacement", ()))
    return [LegState(float(at), *(kept[name][k] for name in _FIELDS)) for k, at in displacements]
