"""The forward model of a subject's leg in 3D, as identification sees it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from mpi4py import MPI

from legfem.common.errors import Argument, InputError
from legfem.common.progress import Progress, Silent
from legfem.experiments.experiment import Picklable, cached_in_process
from legfem.experiments.indentation import OnStep
from legfem.experiments.leg_3d import LegIndentation3D, SolidLegSettings, membrane_of
from legfem.inverse.catalogue import DEEP_RATIO, Values, stiffness_in_words
from legfem.inverse.elastography import FibreRatio
from legfem.inverse.fibre_ratio import USUAL_RATIO, moduli, ratio_of, slopes_at_ratio
from legfem.inverse.outcome import Chain, Forward, Outcome, needed_for, through
from legfem.inverse.settings import SearchRequest
from legfem.jobs.pool import Together
from legfem.jobs.store import key_of
from legfem.legs.details import LegCamera, LegFilm, PressedLeg
from legfem.legs.finite_element_models import spatial_test, tissues_of
from legfem.legs.forward import values_of
from legfem.legs.placement import SpatialLeg, spatial_leg
from legfem.legs.subject import SitedLeg, Subject
from legfem.mechanics.materials import NeoHookean
from legfem.mechanics.terms import Fascia

SOLVES = "solves-3d"
"""In a folder of results."""
ROUGHER = 1.3
"""Size of the elements of the solves that measure errors, over that of the others."""
TRIMMED = 1 / 3
"""Share of the leg beyond the cylinder that is cut away, to see what its length does."""
_TOLD_EVERY = 4.0
"""mm."""
_FASCIA = "fascia."


@dataclass(eq=False)
class SpatialForward(Picklable):
    """A `legfem.inverse.outcome.Forward` of the leg itself.

    Over several ranks of the experiment's communicator this is the first, and the others serve it,
    as `legfem.jobs.pool.leading` has it.

    Parameters
    ----------
    experiment
        The finite-element model; compiled and meshed when first solved.
    nominal
        The tissues' values (MPa, 1/MPa), by the names of the model in plane strain.
    fascia_thickness
        mm.
    depth
        mm.
    fibre_ratio
        Of the shear moduli of all muscle along the leg and across, with whose C10 its fibres stiffen,
        where values have no ``deep.fibre_ratio``; alike in all directions without it.
    states
        Folder for the states of the solve in hand, from which one that was killed goes on.
    progress
        Told how far a solve is.
    film
        Takes states of the solves, to be looked at.
    """

    experiment: LegIndentation3D
    nominal: Values
    fascia_thickness: float
    depth: float
    fibre_ratio: float | None = None
    states: Path | None = None
    progress: Progress = field(default_factory=Silent)
    film: LegFilm | None = None

    def __getstate__(self) -> dict[str, Any]:
        """Leave what the first rank alone does, and what looks at its mesh."""
        return {**super().__getstate__(), "progress": Silent()}

    @cached_in_process
    def _ranks(self) -> Together["SpatialForward", tuple[Values, Sequence[str]], Outcome]:
        """Ranks that solve together: in another process it is its own first."""
        return Together(self.experiment.comm, _solved, self)

    def solve(self, values: Values, sensitivities: Sequence[str] = ()) -> Outcome:
        """Solve in full for values by the names of the model in plane strain."""
        return self._ranks.do((values, sensitivities))

    def solve_here(self, values: Values, sensitivities: Sequence[str]) -> Outcome:
        """As `solve`; collective over the ranks."""
        every, muscle = {**self.nominal, **values}, ("deep", *self.experiment.muscles)
        if self.fibre_ratio is not None:
            every = {DEEP_RATIO: self.fibre_ratio, **every}
        fibrous = muscle if DEEP_RATIO in every else ()
        ratios = {ratio_of(one): every[DEEP_RATIO] for one in fibrous}
        fascia = NeoHookean(every["fascia.C10"], every["fascia.D1"])
        own = {name: value for name, value in every.items() if not name.startswith(_FASCIA) and name != DEEP_RATIO}
        every |= ratios
        own |= membrane_of(fascia, self.fascia_thickness).parameters | moduli(every, fibrous)
        stiffness, compressibility = Fascia().parameters
        of_fascia: Chain = {
            "fascia.C10": {stiffness: 2 * self.fascia_thickness, compressibility: fascia.D1},
            "fascia.D1": {compressibility: fascia.C10},
        }

        def slopes(name: str) -> dict[str, float]:
            alike = ratios if name == DEEP_RATIO else (name,)
            return {key: by for one in alike for key, by in slopes_at_ratio(one, every, fibrous).items()}

        chain = {name: of_fascia.get(name, {}) if name.startswith(_FASCIA) else slopes(name) for name in sensitivities}
        solved = self.experiment.solve(
            own, self.depth, needed_for(chain), on_step=self._on_step(values), keep_in=self.states
        )
        return Outcome.of(values, through(chain, solved.curve), solved.report)

    def prepare(self) -> None:
        """Mesh and compile now, on one rank alone; several do when they first solve together."""
        if self.experiment.comm.size == 1:
            _ = self.experiment.pressing

    def pressed(self, outcome: Outcome) -> PressedLeg | None:
        """Return a solve to be looked at; None where its states were not kept."""
        states = self.film.states(self._key(outcome.values)) if self.film is not None else []
        if not states:
            return None
        test = self.experiment
        return PressedLeg(self._camera.shape, test.indenter, test.pose, test.touch, outcome.curve, tuple(states))

    def _key(self, values: Values) -> str:
        return key_of((self.fingerprint(), dict(values)))

    @cached_in_process
    def _camera(self) -> LegCamera:
        return LegCamera(self.experiment, self.depth, self.film or LegFilm())

    def _on_step(self, values: Values) -> OnStep:
        told, key = 0.0, self._key(values)

        def tell(displacement: float) -> None:
            nonlocal told
            if self.film is not None:
                self._camera.take(key, displacement)
            if displacement >= told + _TOLD_EVERY:
                told = displacement
                at = f"3D at {displacement:.1f} of {self.depth:g} mm"
                self.progress.advance(f"{at}, {stiffness_in_words(values)}")

        return tell

    def fingerprint(self) -> Mapping[str, Any]:
        """Return leg, cylinder, tissues, settings, depth and code."""
        return {"model": "3D", "depth_mm": self.depth, "fibre_ratio": self.fibre_ratio, **self.experiment.fingerprint()}


@dataclass(frozen=True, eq=False)
class LegModels:
    """The models in 3D of one leg that an identification solves in full.

    Parameters
    ----------
    full
        Whose solves make the correction.
    rough, shorter
        By larger elements, and the same of a shorter leg: what they differ by measures errors.
    leg
        The leg's shape.
    depth
        mm.
    kept
        Folder of the solves.
    fibres
        Of the muscle, where they are known.
    muscle
        Regions that have them.
    """

    full: Forward
    rough: Forward
    shorter: Forward
    leg: SpatialLeg
    depth: float
    kept: Path | None = None
    fibres: FibreRatio | None = None
    muscle: tuple[str, ...] = ("deep",)

    @classmethod
    def of_subject(
        cls,
        subject: Subject,
        depth: float,
        kept: Path | None = None,
        settings: SolidLegSettings | None = None,
        progress: Progress | None = None,
        comm: MPI.Intracomm = MPI.COMM_SELF,
        open_ratio: bool = False,
    ) -> "LegModels":
        """Return the models of a subject's leg, pressed to a depth (mm).

        Every solve is spread over the ranks of ``comm``, see `SpatialForward`. With an open ratio
        that of the muscle's fibres is among the models' values, ``deep.fibre_ratio``.

        Raises
        ------
        InputError
            If the leg's shape can't be had.
        """
        settings, leg = settings or SolidLegSettings(), spatial_leg(subject)
        leg = replace(leg, source=leg.source + ", muscles as in the section all along" * bool(subject.muscles))
        larger = replace(
            settings, mesh=settings.mesh.refined(1 / ROUGHER), contact_size=ROUGHER * settings.contact_size
        )
        trimmed = leg.trimmed(subject.indenter.extent, TRIMMED)
        states = None if kept is None else kept / "states"
        # Of a leg that is spread over ranks no process sees the whole.
        film = LegFilm(None if kept is None else kept / "film") if comm.size == 1 else None
        nominal, thickness = values_of(tissues_of(subject)), subject.section.fascia_thickness
        told, fibres = progress or Silent(), subject.fibres
        if open_ratio:
            fibres = FibreRatio(start_of_ratio(subject), 0.0, "assumed", "where the search begins")
            subject = replace(subject, fibres=fibres)
            nominal[DEEP_RATIO] = fibres.value
        ratio = None if fibres is None else fibres.value

        def pressed(shape: SpatialLeg, numbers: SolidLegSettings, film: LegFilm | None = None) -> SpatialForward:
            test = spatial_test(subject, shape, numbers, comm)
            return SpatialForward(test, nominal, thickness, depth, ratio, states, told, film)

        full, rough = pressed(leg, settings, film), pressed(leg, larger)
        shorter = pressed(trimmed, larger)
        return cls(full, rough, shorter, leg, depth, kept, fibres, ("deep", *subject.muscles))

    def pressed(self, outcome: Outcome) -> PressedLeg | None:
        """Return a full solve to be looked at; None where its states were not kept."""
        return self.full.pressed(outcome) if isinstance(self.full, SpatialForward) else None


def _solved(model: SpatialForward, task: tuple[Values, Sequence[str]]) -> Outcome:
    return model.solve_here(*task)


def start_of_ratio(subject: Subject) -> float:
    """Return the ratio of the muscle's fibres at which a search begins: the stated one if it is."""
    return USUAL_RATIO if subject.fibres is None else subject.fibres.value


def check_has_ends(subject: Subject) -> None:
    """Check that recordings aren't made in plane strain.

    Raises
    ------
    InputError
        If they are.
    """
    if subject.plane_strain:
        remedy = "leave it out, or give plane_strain = false in [recordings] if they have ends"
        raise InputError(Argument("model"), "3d", "the recordings are simulated in plane strain, without ends", remedy)


def leg_models(
    leg: SitedLeg,
    depths: Sequence[float],
    request: SearchRequest,
    settings: SolidLegSettings | None = None,
    comm: MPI.Intracomm = MPI.COMM_SELF,
) -> list[LegModels]:
    """Return the models in 3D of a leg's sites, each pressed as deep (mm) as stated.

    Raises
    ------
    InputError
        If a site's shape can't be had.
    """
    kept = None if request.out is None else request.out / SOLVES
    ratio = seeks_ratio(leg.sites[0], request)
    return [
        LegModels.of_subject(site, depth, kept, settings, request.progress, comm, ratio)
        for site, depth in zip(leg.sites, depths, strict=True)
    ]


def seeks_ratio(subject: Subject, request: SearchRequest) -> bool:
    """Return whether the ratio of the muscle's fibres is among what is free, or held by request."""
    named = {one.name for one in request.parameters or ()} | set(request.fixed)
    return DEEP_RATIO in named or (subject.fibres is not None and subject.fibres.sd > 0)
