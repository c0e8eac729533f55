"""Models of specimens' tests: all of a folder that are fitted together, and one with what a diagnosis weighs."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from legfem.common.units import FloatArray
from legfem.experiments.axisymmetric import Layer
from legfem.experiments.experiment import Picklable, Solved, cached_in_process
from legfem.inverse.body_models import Displaced, Stopped
from legfem.inverse.catalogue import Values, is_ratio
from legfem.inverse.fibre_ratio import at_ratios, moduli, moduli_needed, ratio_of
from legfem.inverse.outcome import Outcome
from legfem.inverse.responses import PLAIN
from legfem.jobs.store import code_fingerprint
from legfem.legs.mechanisms import Solution, TissueMechanism, mechanisms
from legfem.legs.mechanisms.time_dependence import TIMES_S
from legfem.legs.nuisances import SIZE
from legfem.mechanics.materials import Hyperelastic
from legfem.mechanics.terms import Fibres
from legfem.solve.path import ForceCurve, Path
from legfem.solve.protocol import Protocol
from legfem.specimens.course import borne
from legfem.specimens.kind import AXES, Law, SpecimenTest
from legfem.specimens.laws import ONE, REFERENCE_MPA, SpecimenTissue, specimen_law
from legfem.specimens.sizes import FibrousTest, LayeredTest, Sizes, bare, kind_in, lengths_of, resized, slipping

if TYPE_CHECKING:
    from legfem.experiments.plane_strain import LateralPlacement
    from legfem.meshing.section import MeshMotion


def experiment_of(
    sizes: Sizes,
    laws: Mapping[str, Hyperelastic],
    depth: float,
    fibrous: str = ONE,
    called: Mapping[str, str] = MappingProxyType({}),
) -> SpecimenTest:
    """Return the experiment with a test's sizes, its mesh and steps fit for a depth (mm).

    Laws are by the tissue's name; that of a specimen of one is `legfem.specimens.laws.ONE`. Tissues may be called
    otherwise by what sees them.
    Fibres, if there are, are the named tissue's, and do nothing until their numbers are given.
    """
    if isinstance(sizes, FibrousTest):
        fibres = Fibres(fibrous, axis=AXES[sizes.direction])
        return experiment_of(sizes.whole, laws, depth, called=called).with_terms((fibres,))
    law: Law
    if isinstance(sizes, LayeredTest):
        law = tuple(Layer(name, thickness, laws[name], called.get(name, "")) for name, thickness in sizes.layers)
    else:
        law = laws[ONE]
    return kind_in(sizes).model(bare(sizes), law, depth)


@dataclass(frozen=True, eq=False)
class SpecimenForward(Picklable):
    """Tests of one tissue, a `legfem.inverse.outcome.ForwardModel`.

    Parameters
    ----------
    tests : tuple
        Sizes, all different.
    depths : tuple of float
        How deep each is pressed, mm.
    laws : Mapping[str, Hyperelastic]
        Of the tissues, by name.
    bulk_ratios : Mapping[str, float]
        Bulk over shear modulus at small strain, by name.
    least_bulk : Mapping[str, float]
        Stiffness C10 (MPa) below which the bulk modulus doesn't fall with it, by name: what is
        called incompressible is to stay so where a law stiffens far beyond its C10.
    fibre_ratios : Mapping[str, float]
        Shear modulus along over that across the fibres, of the tissue that has them.
    """

    tests: tuple[Sizes, ...]
    depths: tuple[float, ...]
    laws: Mapping[str, Hyperelastic]
    bulk_ratios: Mapping[str, float]
    least_bulk: Mapping[str, float]
    fibre_ratios: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def of_tissues(
        cls, tests: tuple[Sizes, ...], depths: tuple[float, ...], tissues: Sequence[SpecimenTissue], c10: float
    ) -> "SpecimenForward":
        """Return the model of tissues whose stiffness is ``c10`` (MPa) if it isn't stated."""
        laws = {one.name: one.at(c10) for one in tissues}
        least = {one.name: 0.0 if one.poisson_ratio is not None else c10 for one in tissues}
        ratios = {one.name: one.fibre_ratio for one in tissues if one.fibrous}
        bulk = {one.name: one.bulk_ratio for one in tissues}
        return cls(tests, depths, laws, bulk, least, ratios)

    @cached_in_process
    def experiments(self) -> list[SpecimenTest]:
        """Meshed when first solved, in whichever process."""
        return [
            experiment_of(sizes, self.laws, depth, next(iter(self.fibre_ratios), ONE))
            for sizes, depth in zip(self.tests, self.depths, strict=True)
        ]

    def prepare(self) -> None:
        """Mesh and compile now."""
        _ = self.experiments

    @property
    def nominal(self) -> Values:
        """The law's numbers (MPa, 1/MPa) and the fibres' ratio by full name."""
        return {
            f"{tissue}.{name}": value for tissue, law in self.laws.items() for name, value in law.parameters.items()
        } | {ratio_of(tissue): ratio for tissue, ratio in self.fibre_ratios.items()}

    def with_compressibility(self, values: Values) -> dict[str, float]:
        """Return values with each D1 that isn't among them, as Poisson's ratio has it."""
        own = {**self.nominal, **values}
        missing = {
            f"{tissue}.D1": 1 / (ratio * max(own[f"{tissue}.C10"], self.least_bulk[tissue]))
            for tissue, ratio in self.bulk_ratios.items()
            if f"{tissue}.D1" not in values
        }
        return {**values, **missing}

    def solve(self, values: Values, sensitivities: Sequence[str]) -> Outcome:
        """Solve every test in full; one that breaks down is an outcome that stops at once."""
        every = [self.solve_one(k, values, sensitivities) for k in range(len(self.tests))]
        return Outcome.joined(values, every)

    def solve_one(self, number: int, values: Values, sensitivities: Sequence[str] = ()) -> Outcome:
        """Solve one of the tests.

        A derivative by a stiffness is that at the same Poisson's ratio where the values have no D1,
        and at the same ratio of the fibres.
        """
        own, fibrous = {**self.nominal, **values}, self.fibre_ratios
        tied = [
            tissue
            for tissue in self.bulk_ratios
            if f"{tissue}.D1" not in values
            and f"{tissue}.C10" in sensitivities
            and own[f"{tissue}.C10"] >= self.least_bulk[tissue]
        ]
        every = self.with_compressibility(values)
        given = {n: value for n, value in every.items() if not is_ratio(n)} | moduli(own, fibrous)
        asked = (
            *(name for name in sensitivities if not is_ratio(name)),
            *(f"{tissue}.D1" for tissue in tied),
            *moduli_needed(fibrous, sensitivities),
        )
        try:
            solved: Solved = self.experiments[number].solve(given, self.depths[number], asked)
        except (ArithmeticError, ValueError, RuntimeError, np.linalg.LinAlgError) as error:
            nothing = ForceCurve(np.zeros(1), np.zeros(1), dict.fromkeys(sensitivities, np.zeros(1)))
            reason = " ".join(str(error).split()) or type(error).__name__
            return Outcome(values, (nothing,), False, reason, 0, 0.0)
        report = solved.report
        seconds = report.seconds + sum(before.seconds for before in report.earlier_attempts)
        curve = _at_poissons_ratio(solved.curve, every, tied)
        return Outcome(
            values,
            (at_ratios(curve, own, fibrous, sensitivities),),
            bool(report.complete),
            report.reason,
            report.factorisations,
            float(seconds),
            report.compromise,
        )

    @property
    def code(self) -> str:
        """Hash of the code that it runs, with that of its kinds of tests."""
        kinds = {type(kind_in(sizes)).__module__ for sizes in self.tests}
        return code_fingerprint(type(self).__module__, *sorted(kinds))

    def fingerprint(self) -> Mapping[str, Any]:
        """Return tests, depths, law and code."""
        return {"model": "specimens", **super().fingerprint(), "code": self.code}


def _at_poissons_ratio(curve: ForceCurve, values: Values, tied: Sequence[str]) -> ForceCurve:
    """Return a curve with derivatives by C10 along which D1 falls as C10 rises."""

    def along(by: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
        found = dict(by)
        for tissue in tied:
            c10, d1 = f"{tissue}.C10", f"{tissue}.D1"
            found[c10] = found[c10] - values[d1] / values[c10] * found.pop(d1)
        return found

    beside = {name: along(by) for name, by in curve.channel_sensitivities.items()}
    return replace(curve, sensitivities=along(curve.sensitivities), channel_sensitivities=beside)


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
    """A specimen's models, `legfem.inverse.body_models.BodyModels`, made when first asked for.

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

    def moved_to(self, moved: "MeshMotion") -> "SpecimenVariants":
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
            called = {one.name: tissue.name for one, tissue in zip(self._named, self.tissues, strict=True)}
            model = experiment_of(sizes, laws, self.depth, fibrous, called)
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
        placement: "LateralPlacement | None" = None,
    ) -> Path | Stopped:
        """Solve a protocol, as `legfem.legs.finite_element_models.LegVariants.follow` does for a leg.

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
        # Euler's theorem: the force is homogeneous of the first degree in the stiffnesses, and channels of none.
        every = {**others, _C20: own[_C20]} if _C10 in sensitivities else {}
        force, nothing = scale * found.force, np.zeros(len(found.time))
        along = partial(_along_c10, stiffnesses=every, scale=scale, c10=deep[_C10])
        by = along({name: scale * values for name, values in found.sensitivities.items()}, value=force)
        known = found.channel_sensitivities
        seen = {channel: along(known.get(channel, {}), value=nothing) for channel in found.channels}
        for name in (name for name in sensitivities if name in self.measured):
            changed, step = self._resized(name).follow(protocol, deep, solution), _RESIZED * self.measured[name]
            if isinstance(changed, Stopped):
                return changed
            by[name] = (changed.force_at(found.time) - force) / step
            for channel, course in changed.channels_at(found.time).items():
                seen[channel][name] = (course - found.channels[channel]) / step
        return replace(
            found,
            force=force,
            sensitivities={n: by[n] for n in sensitivities},
            # What branches bear changes no channel.
            channel_sensitivities={c: {n: own.get(n, nothing) for n in sensitivities} for c, own in seen.items()},
        )

    def _resized(self, name: str) -> "SpecimenVariants":
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


def _along_c10(
    by: Mapping[str, FloatArray], stiffnesses: Mapping[str, float], scale: float, c10: float, value: FloatArray
) -> dict[str, FloatArray]:
    """Return derivatives by the deep stiffness (MPa) too, of what is homogeneous in all stiffnesses.

    Parameters
    ----------
    by
        Derivatives (n,) by all others, as solved.
    stiffnesses
        These (MPa, 1/MPa) as solved.
    scale
        Actual stiffness over that.
    c10
        Actual deep C10, MPa.
    value
        (n,): the degree of homogeneity times the value.
    """
    if _C20 not in by:
        return dict(by)
    rest = sum((-own if name.endswith(".D1") else own) * by[name] for name, own in stiffnesses.items())
    return {**by, _C20: by[_C20] / scale, _C10: (value - rest) / c10}


def _of_variant(variant: str) -> list[TissueMechanism]:
    if variant == PLAIN.variant:
        return []
    return [m for m in mechanisms() if isinstance(m, TissueMechanism) and m.variant == variant]


def _relaxing(path: Path, values: Mapping[str, float], sensitivities: Sequence[str]) -> Path:
    """Return a course with what branches bear; see `legfem.specimens.course`."""
    names = [f"deep.viscoelasticity{k + 1}.ratio" for k in range(len(TIMES_S))]
    if not any(name in values or name in sensitivities for name in names):
        return path
    held = [np.concatenate([[0.0], each]) for each in borne(path.time[1:], path.force[1:])]
    total: FloatArray = path.force + sum(values.get(name, 0.0) * each for name, each in zip(names, held, strict=True))
    by = {n: each for n, each in zip(names, held, strict=True) if n in sensitivities}
    return replace(path, force=total, sensitivities={**path.sensitivities, **by})
