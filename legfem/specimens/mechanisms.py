"""What a specimen's test may leave out: the diagnosis' mechanisms, brought to its sizes, and the models with them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from legfem.common.units import FloatArray
from legfem.inverse.mechanism import factor, prior_of
from legfem.inverse.observations import Observations
from legfem.inverse.parameter import Parameter
from legfem.inverse.responses import PLAIN, Displaced, Stopped
from legfem.legs.mechanisms import Mechanism, Solution, TissueMechanism, Values, mechanisms
from legfem.legs.mechanisms.support import SupportCompliance
from legfem.legs.mechanisms.viscoelasticity import TIMES_S
from legfem.legs.nuisances import SIZE
from legfem.mechanics.materials import Hyperelastic
from legfem.mechanics.terms import Fibres
from legfem.solve.path import Path
from legfem.solve.protocol import Protocol
from legfem.specimens.forward import experiment_of
from legfem.specimens.kind import SpecimenTest
from legfem.specimens.laws import ONE, REFERENCE_MPA, SpecimenTissue, specimen_law
from legfem.specimens.relaxation import borne
from legfem.specimens.sizes import FibrousTest, LayeredTest, Sizes, kind_in, layered, lengths_of, resized, slipping

if TYPE_CHECKING:
    from legfem.experiments.plane_strain import LateralPlacement
    from legfem.meshing.section import MeshMotion


@dataclass(frozen=True)
class RigCompliance(Mechanism):
    r"""Springs in series: :math:`d_{tissue} = d - c F`; a specimen has no bones."""

    name: ClassVar[str] = SupportCompliance.name
    statement: ClassVar[str] = "the rig or the base gave way with the force"
    parameters: ClassVar[tuple[Parameter, ...]] = SupportCompliance.parameters[:1]
    next_experiment: ClassVar[str] = "press a rigid block on the same rig, and subtract what that yields"

    def displacement_loss(self, values: Values, observed: Observations, force: FloatArray) -> FloatArray:
        """Return what the rig takes up."""
        return values["compliance"] * force


def mechanisms_on_a_rig() -> tuple[Mechanism, ...]:
    """Return all mechanisms for a body that gives way with its rig, not with two bones."""
    return tuple(RigCompliance() if m.name == RigCompliance.name else m for m in mechanisms())


_LEG_MM, _LEG_N, _LEG_S = 20.0, 20.0, 100.0
_FACES = (
    "contact-slip",
    "what touches the specimen let it slip along: its faces did not hold",
    "mark the specimen at the contact's edge and film it, or repeat with sandpaper and with oil",
)
_TOLD: Mapping[str, tuple[str, str]] = {
    "viscoelasticity": (
        "the tissue relaxes: its force depends on the rate and fades while held",
        "hold the deepest position for a minute, and press at two rates",
    ),
    "strain-stiffening": (
        "the tissue stiffens with strain more than the law used can describe",
        "press deeper, or with a smaller indenter: larger strains",
    ),
    "compressibility": (
        "the tissue loses or keeps more volume than Poisson's ratio as given says",
        "measure the specimen's girth under load, and how its volume changes",
    ),
    "contact-slip": _FACES[1:],
    "contact-onset": (
        "the displacement was not counted from first contact",
        "start the recording in air, 2 mm before contact, so that first contact can be seen",
    ),
    "force-drift": (
        "the load cell's zero drifted in time",
        "record a minute in air before and after each trial, and compare the zeros",
    ),
    "superficial-stiffness": (
        "the layers of stated stiffness are stiffer or softer than stated",
        "test one of those layers by itself, or press with a smaller tip",
    ),
    "leg-movement": (
        "the specimen moved during the test, or slipped in its rig",
        "film the specimen against the rig during the test, hold it faster, and repeat",
    ),
    "preconditioning": (
        "the tissue softened from one trial to the next: it was not preconditioned",
        "cycle five to ten times before recording, and rest between trials",
    ),
}
_NONE: Mapping[str, str] = {
    "dermis": "a specimen of one tissue has no skin over it",
    "end-effects": "the specimen's model has no length beyond the indenter's",
    "fascia-stiffness": "a specimen of one tissue has no fascia",
    "indenter-tilt": "the specimen's model is symmetric about the travel, so that it can't tilt",
    "muscle-contraction": "a specimen doesn't tense",
    "muscle-fibres": "fibres of a specimen are stated or identified: [fibres] in specimen.toml",
    "poroelastic-drainage": "specimen.toml doesn't say through which faces fluid leaves",
    "prestress": "a specimen of one tissue has no fascia",
    "superficial-stiffening": "a specimen of one tissue has no fat over it",
    "superficial-stiffness": "a specimen of one tissue has no fat over it",
    "superficial-viscoelasticity": "a specimen of one tissue has no fat over it",
    "uneven-muscle": "a specimen of one tissue is taken to be alike everywhere",
}
_OF_LAYERS: Mapping[str, str | None] = {
    "superficial-stiffness": None,
    "superficial-stiffening": "layers of stated stiffness are taken as stated but for a factor",
    "superficial-viscoelasticity": "layers of stated stiffness are taken not to relax",
}
_WITHOUT_TIME = ("viscoelasticity", "force-drift", "leg-movement", "preconditioning")
_LEAST_BULK = 5.0
"""Bulk over shear modulus down to which compressibility is tabulated: Poisson's ratio 0.41."""
_LEAST_FACTOR = 3.0
_RIG = 0.2
"""Usual drift of a bench's load cell over that of a leg's, as a share of the greatest force."""


@dataclass(frozen=True)
class Scale:
    """What a specimen's test is like.

    Parameters
    ----------
    depth
        mm.
    force
        Greatest, N.
    duration
        s.
    c10
        Roughly, kPa.
    bulk
        Modulus over the shear modulus, as given.
    """

    depth: float
    force: float
    duration: float
    c10: float
    bulk: float

    @property
    def over_a_leg(self) -> dict[str, float]:
        """Usual strengths over those of a leg, by mechanism."""
        depth, force = self.depth / _LEG_MM, self.force / _LEG_N
        return {
            "strain-stiffening": self.c10,
            RigCompliance.name: depth / force,
            "contact-onset": depth,
            "leg-movement": depth,
            "force-drift": _RIG * force * _LEG_S / self.duration,
        }


def mechanisms_of(sizes: Sizes, scale: Scale, timed: bool = True) -> tuple[list[Mechanism], dict[str, str]]:
    """Return the mechanisms that a specimen may have, and why it can't have the others.

    Parameters
    ----------
    sizes
        Of the test.
    scale
        Of the recordings.
    timed
        Whether they have a time, which tables of stretch and stress haven't.
    """
    able: list[Mechanism] = []
    unable: dict[str, str] = {}
    for mechanism in mechanisms_on_a_rig():
        why = _NONE.get(mechanism.name)
        if layered(sizes) is not None:
            why = _OF_LAYERS.get(mechanism.name, why)
        if mechanism.name == _FACES[0] and slipping(sizes) is None:
            why = kind_in(sizes).no_slip
        if isinstance(mechanism, TissueMechanism) and mechanism.name not in (*_TOLD, *_NONE):
            why = "it doesn't say what it does to a specimen"
        if not timed and mechanism.name in _WITHOUT_TIME:
            why = "a table of stretch and stress has no time"
        if why is not None:
            unable[mechanism.name] = why
        else:
            able.append(_of_specimen(mechanism, scale))
    return able, unable


def _of_specimen(mechanism: Mechanism, scale: Scale) -> Mechanism:
    statement, next_experiment = _TOLD.get(mechanism.name, (mechanism.statement, mechanism.next_experiment))
    first, *rest = mechanism.parameters
    strengths = mechanism.strengths if isinstance(mechanism, TissueMechanism) else None
    if mechanism.name == "compressibility":
        most = max(_LEAST_FACTOR, scale.bulk / _LEAST_BULK)
        first = factor(
            "factor",
            "on D1",
            (0.1, 1.5 * most),
            max(1.3, 0.5 * math.log(most)),
            "gels hardly lose volume, foams and drained tissues lose much",
        )
        strengths = (most ** (1 / 3), most ** (2 / 3), most)
    over = scale.over_a_leg.get(mechanism.name, 1.0)
    return mechanism.restated(
        statement,
        next_experiment,
        (_times(first, over), *rest),
        None if strengths is None else tuple(over * value for value in strengths),
    )


def _times(parameter: Parameter, over: float) -> Parameter:
    if over == 1.0:
        return parameter
    prior, (low, high) = prior_of(parameter), parameter.bounds
    return replace(parameter, bounds=(over * low, over * high), prior=replace(prior, sd=over * prior.sd))


_C10, _C20 = "deep.C10", "deep.C20"
_BESIDE = "superficial.C10"
"""What mechanisms call the stiffness of tissues beside the one that is asked for."""
_STATED = "stated_"
_RESIZED = 0.03
"""Relative step by which the force's change with a size is found."""

type _Numbers = tuple[tuple[str, float], ...]
type _Asked = tuple[str, Protocol, _Numbers, tuple[str, ...]]


@dataclass(eq=False)
class SpecimenVariants:
    """A specimen's models, `legfem.inverse.responses.BodyModels`, made when first asked for.

    Parameters
    ----------
    sizes
        Of the test.
    depth
        That meshes and steps are made for, mm.
    tissues
        From the base up. Of layers all but one are of stated stiffness; that one is the model's
        deep tissue.
    """

    sizes: Sizes
    depth: float
    tissues: tuple[SpecimenTissue, ...] = (SpecimenTissue(),)
    _models: dict[str, SpecimenTest] = field(default_factory=dict, init=False, repr=False)
    _paths: dict[_Asked, Path | Stopped] = field(default_factory=dict, init=False, repr=False)

    def __getstate__(self) -> dict[str, Any]:
        """Leave the finite-element models out: they can't leave their process."""
        return {**self.__dict__, "_models": {}}

    @property
    def measured(self) -> dict[str, float]:
        """Sizes by full name (mm) that change the shape of the force's course."""
        alike, lengths = kind_in(self.sizes).as_force, lengths_of(self.sizes)
        return {SIZE + name: value for name, value in lengths.items() if name not in alike}

    @property
    def _asked(self) -> SpecimenTissue:
        """The tissue whose stiffness is asked for."""
        return next(one for one in self.tissues if "C10" not in one.stated)

    @property
    def _stated(self) -> dict[str, float]:
        """Numbers of all other layers, by full name."""
        return {
            f"{one.name}.{key}": value
            for one in self._named
            if one.name != ONE
            for key, value in one.at(REFERENCE_MPA).parameters.items()
            if math.isfinite(value)
        } | {name: value for name, value in self._fibres.items() if not name.startswith(ONE)}

    @property
    def _fibres(self) -> dict[str, float]:
        """Numbers of the fibres, by full name, at the stiffness `REFERENCE_MPA` or as stated."""
        found = dict[str, float]()
        for one in self._named:
            if one.fibrous:
                c10 = one.stated.get("C10", REFERENCE_MPA)
                found |= Fibres.of_ratio(one.name, c10, one.fibre_ratio).parameters
        return found

    @property
    def _named(self) -> list[SpecimenTissue]:
        """Tissues as the model's terms know them."""
        asked = self._asked
        return [replace(one, name=ONE if one is asked else _STATED + one.name) for one in self.tissues]

    @property
    def _law(self) -> Hyperelastic:
        return specimen_law("reduced-polynomial", REFERENCE_MPA, self._asked.poisson_ratio)

    @property
    def assumed(self) -> tuple[str, ...]:
        """Compressibility and sizes."""
        return ("deep.D1", *self.measured)

    @property
    def displaced(self) -> tuple[Displaced, ...]:
        """None: the sizes are numbers."""
        return ()

    def moved_to(self, moved: MeshMotion) -> SpecimenVariants:
        """Refuse: a specimen has no outline.

        Raises
        ------
        ValueError
            Always.
        """
        raise ValueError(f"a specimen can't be moved: {moved}")

    def parameters(self, variant: str) -> dict[str, float]:
        """Return a model's parameters by full name, at the stiffness `REFERENCE_MPA`."""
        return {**self.model(variant).parameters, **self.measured}

    def described(self, variant: str) -> str:
        """Return what tells a model from others: its test and terms."""
        return repr((self._sizes(variant), self._terms(variant), self.depth, self.tissues))

    def model(self, variant: str) -> SpecimenTest:
        """Return a model by its name."""
        if variant not in self._models:
            laws = {one.name: one.at(REFERENCE_MPA) for one in self._named} | {ONE: self._law}
            fibrous = next((one.name for one in self._named if one.fibrous), ONE)
            sizes = self._of_model(self._sizes(variant))
            model = experiment_of(sizes, laws, self.depth, fibrous)
            self._models[variant] = model.with_terms(self._terms(variant))
        return self._models[variant]

    def _sizes(self, variant: str) -> Sizes:
        free = any(m.tangential == "frictionless" for m in _of_variant(variant))
        return (slipping(self.sizes) or self.sizes) if free else self.sizes

    def _of_model(self, sizes: Sizes) -> Sizes:
        """Return a test whose layers are called as the model's terms know them."""
        if isinstance(sizes, FibrousTest):
            return replace(sizes, whole=self._of_model(sizes.whole))
        if not isinstance(sizes, LayeredTest):
            return sizes
        names = (one.name for one in self._named)
        thicknesses = (thickness for _, thickness in sizes.layers)
        return replace(sizes, layers=tuple(zip(names, thicknesses, strict=True)))

    def _terms(self, variant: str) -> list[Any]:
        return [term for m in _of_variant(variant) for term in m.terms_of(self._law)]

    def follow(
        self,
        protocol: Protocol,
        deep: Mapping[str, float],
        solution: Solution,
        sensitivities: Sequence[str] = (),
        placement: LateralPlacement | None = None,
    ) -> Path | Stopped:
        """Solve a protocol, as `legfem.legs.variants.LegVariants.follow` does for a leg.

        Compressibility goes with 1 / C10, so that Poisson's ratio stays. Layers of stated stiffness
        are as much softer in the solution as the force is scaled up.
        """
        scale = deep[_C10] / REFERENCE_MPA
        own = {_C10: REFERENCE_MPA, _C20: deep.get(_C20, 0.0) / scale, **self._fibres}
        nominal = self.parameters(solution.variant)
        factors = dict(solution.scaled)
        beside = factors.pop(_BESIDE, 1.0) / scale
        others = {
            name: value / beside if name.endswith(".D1") else value * beside for name, value in self._stated.items()
        }
        own |= others | {name: factor * nominal[name] for name, factor in factors.items()}
        own |= {
            name: value / scale if name.startswith("deep.C") else value for name, value in solution.parameters.items()
        }
        asked = {name for name in sensitivities if name not in (_C10, *self.measured)}
        if _C10 in sensitivities:
            asked |= {_C20, *others}
        found = self._scaled(solution.variant, protocol, own, tuple(sorted(asked)))
        if isinstance(found, Stopped):
            return found
        by: dict[str, Any] = {name: scale * values for name, values in found.sensitivities.items()}
        if _C20 in by:
            by[_C20] = found.sensitivities[_C20]
            # Euler's theorem: the force is homogeneous in the stiffnesses.
            rest = own[_C20] * by[_C20] + sum(
                (-value if name.endswith(".D1") else value) * found.sensitivities[name]
                for name, value in others.items()
            )
            by[_C10] = (found.force - rest) / REFERENCE_MPA
        for name in (name for name in sensitivities if name in self.measured):
            changed = self._resized(name).follow(protocol, deep, solution)
            if isinstance(changed, Stopped):
                return changed
            rise = changed.force_at(found.time) - scale * found.force
            by[name] = rise / (_RESIZED * self.measured[name])
        return replace(found, force=scale * found.force, sensitivities={n: by[n] for n in sensitivities})

    def _resized(self, name: str) -> SpecimenVariants:
        value = (1 + _RESIZED) * self.measured[name]
        return replace(self, sizes=resized(self.sizes, name.removeprefix(SIZE), value))

    def _scaled(
        self, variant: str, protocol: Protocol, values: Mapping[str, float], sensitivities: tuple[str, ...]
    ) -> Path | Stopped:
        rounded = {name: float(f"{value:.12g}") for name, value in values.items()}
        asked = variant, protocol, tuple(sorted(rounded.items())), sensitivities
        if asked not in self._paths:
            self._paths[asked] = self._made(*asked)
        return self._paths[asked]

    def _made(
        self, variant: str, protocol: Protocol, given: _Numbers, sensitivities: tuple[str, ...]
    ) -> Path | Stopped:
        values = dict(given)
        model = self.model(variant)
        known = model.parameters
        try:
            solved = model.solve(
                {name: value for name, value in values.items() if name in known},
                protocol,
                [name for name in sensitivities if name in known],
            )
        except (ArithmeticError, RuntimeError, np.linalg.LinAlgError) as error:
            return Stopped(" ".join(str(error).split()) or type(error).__name__)
        if not solved.report.complete:
            return Stopped(str(solved.report))
        if kind_in(self.sizes).relaxes_as_a_whole:
            return _relaxing(solved.path, values, sensitivities)
        return solved.path


def _of_variant(variant: str) -> list[TissueMechanism]:
    if variant == PLAIN.variant:
        return []
    return [m for m in mechanisms() if isinstance(m, TissueMechanism) and m.variant == variant]


def _relaxing(path: Path, values: Mapping[str, float], sensitivities: Sequence[str]) -> Path:
    """Return a course with what branches bear; see `legfem.specimens.relaxation`."""
    names = [f"deep.viscoelasticity{k + 1}.ratio" for k in range(len(TIMES_S))]
    if not any(name in values or name in sensitivities for name in names):
        return path
    held = [np.concatenate([[0.0], each]) for each in borne(path.time[1:], path.force[1:])]
    total: FloatArray = path.force + sum(values.get(name, 0.0) * each for name, each in zip(names, held, strict=True))
    by = {n: each for n, each in zip(names, held, strict=True) if n in sensitivities}
    return replace(path, force=total, sensitivities={**path.sensitivities, **by})
