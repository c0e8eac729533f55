"""The models of a specimen that a diagnosis weighs: the base, and with what mechanisms add."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from legfem.channels.kinds import CHANNELS
from legfem.common.units import FloatArray
from legfem.experiments.experiment import Solved
from legfem.inverse.accuracy import SIZE
from legfem.inverse.catalogue import RATIO
from legfem.mechanisms import Solution, shown_in
from legfem.mechanisms.time_dependence import TIMES_S
from legfem.solve.path import FORCE, Course, Path, courses_of, with_courses
from legfem.solve.protocol import Protocol
from legfem.specimens.course import borne
from legfem.specimens.forward import SpecimenForward
from legfem.specimens.laws import ONE, REFERENCE_MPA, SpecimenTissue
from legfem.specimens.sizes import RESIZED, Sizes

_C10, _C20 = "deep.C10", "deep.C20"
_BESIDE = "superficial.C10"
"""What mechanisms call the stiffness of tissues beside the one that is asked for."""
_STATED = "stated_"

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
    _models: dict[str, SpecimenForward] = field(default_factory=dict, init=False, repr=False)
    _solved: dict[_Asked, Solved] = field(default_factory=dict, init=False, repr=False)

    @property
    def measured(self) -> dict[str, float]:
        """Sizes by full name (mm) that change the shape of the force's course."""
        alike, lengths = self.sizes.kind.as_force, self.sizes.lengths
        return {SIZE + name: value for name, value in lengths.items() if name not in alike}

    @property
    def _named(self) -> tuple[SpecimenTissue, ...]:
        """Tissues as the model's terms know them; that whose stiffness is asked for is the deep one."""
        asked = next(one for one in self.tissues if "C10" not in one.stated)
        ratio = {name: value for name, value in asked.stated.items() if name == RATIO}
        deep = replace(asked, name=ONE, law="reduced-polynomial", stated=ratio)
        return tuple(deep if one is asked else replace(one, name=_STATED + one.name) for one in self.tissues)

    @property
    def _stated(self) -> dict[str, float]:
        """Numbers of all other layers, by full name."""
        return {
            f"{one.name}.{key}": value
            for one in self._named
            if one.name != ONE
            for key, value in one.at(REFERENCE_MPA).parameters.items()
            if math.isfinite(value)
        }

    @property
    def assumed(self) -> tuple[str, ...]:
        """Compressibility and sizes."""
        return ("deep.D1", *self.measured)

    @property
    def geometric(self) -> tuple[str, ...]:
        """None: the sizes are numbers."""
        return ()

    def parameters(self, variant: str) -> dict[str, float]:
        """Return a model's parameters by full name, at the stiffness `REFERENCE_MPA`."""
        return {**self.model(variant).experiment.parameters, **self.measured}

    def described(self, variant: str) -> str:
        """Return what tells a model from others: its test and terms."""
        model = self.model(variant)
        return repr((model.sizes, model.terms, self.depth, self.tissues))

    def model(self, variant: str) -> SpecimenForward:
        """Return a model by its name."""
        if variant not in self._models:
            free = any(m.tangential == "frictionless" for m in shown_in(variant))
            sizes = (self.sizes.slipping or self.sizes) if free else self.sizes
            base = SpecimenForward(sizes, self.depth, self._named, REFERENCE_MPA)
            terms = tuple(term for m in shown_in(variant) for term in m.terms_of(base.laws[ONE]))
            self._models[variant] = replace(base, terms=terms)
        return self._models[variant]

    def follow(
        self, protocol: Protocol, deep: Mapping[str, float], solution: Solution, sensitivities: Sequence[str] = ()
    ) -> Solved:
        """Solve a protocol, as `legfem.legs.finite_element_models.LegVariants.follow` does for a leg.

        Compressibility goes with 1 / C10, so that Poisson's ratio stays. Layers of stated stiffness
        are as much softer in the solution as the force is scaled up.
        """
        scale = deep[_C10] / REFERENCE_MPA
        factors = dict(solution.scaled)
        beside, nominal = factors.pop(_BESIDE, 1.0) / scale, self.parameters(solution.variant)
        others = {
            name: value / beside if name.endswith(".D1") else value * beside for name, value in self._stated.items()
        }
        own = {_C10: REFERENCE_MPA, _C20: deep.get(_C20, 0.0) / scale, **others}
        own |= {name: factor * nominal[name] for name, factor in factors.items()}
        own |= {
            name: value / scale if name.startswith("deep.C") else value for name, value in solution.parameters.items()
        }
        asked = {name for name in sensitivities if name not in (_C10, *self.measured)}
        stiffnesses = {**others, _C20: own[_C20]} if _C10 in sensitivities else {}
        solved = self._scaled(solution.variant, protocol, own, tuple(sorted({*asked, *stiffnesses})))
        if not solved.report.complete:
            return solved
        found: dict[str, Course] = {}
        for name, (course, rates) in courses_of(solved.path).items():
            times, degree = (scale, 1.0) if _is_load(name) else (1.0, 0.0)
            by = {one: np.asarray(times * rate) for one, rate in rates.items()}
            found[name] = times * course, _along_c10(by, stiffnesses, scale, deep[_C10], degree * times * course)
        for size in self.measured.keys() & set(sensitivities):
            larger = replace(self, sizes=self.sizes.larger(size.removeprefix(SIZE)))
            changed, time = larger.follow(protocol, deep, solution), solved.path.time
            if not changed.report.complete:
                return changed
            resized = {FORCE: changed.path.force_at(time), **changed.path.channels_at(time)}
            for name, (course, rates) in found.items():
                rates[size] = np.asarray((resized[name] - course) / (RESIZED * self.measured[size]))
        # What branches bear changes no strain.
        nothing = np.zeros(len(solved.path.time))
        kept = {name: (course, {n: by.get(n, nothing) for n in sensitivities}) for name, (course, by) in found.items()}
        path = with_courses(solved.path, kept)
        return replace(solved, path=path, curve=path.loading)

    def _scaled(
        self, variant: str, protocol: Protocol, values: Mapping[str, float], sensitivities: tuple[str, ...]
    ) -> Solved:
        """Solve at the stiffness `REFERENCE_MPA`, unless that was done."""
        rounded = {name: float(f"{value:.12g}") for name, value in values.items()}
        asked = variant, protocol, tuple(sorted(rounded.items())), sensitivities
        if asked not in self._solved:
            model = self.model(variant)
            known = model.experiment.parameters
            given = {name: value for name, value in rounded.items() if name in known}
            solved = model.follow(given, protocol, [name for name in sensitivities if name in known])
            if solved.report.complete and self.sizes.kind.relaxes_as_a_whole:
                solved = replace(solved, path=_relaxing(solved.path, rounded, sensitivities))
            self._solved[asked] = solved
        return self._solved[asked]


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


def _relaxing(path: Path, values: Mapping[str, float], sensitivities: Sequence[str]) -> Path:
    """Return a course with what branches bear; see `legfem.specimens.course`."""
    names = [f"deep.viscoelasticity{k + 1}.ratio" for k in range(len(TIMES_S))]
    if not any(name in values or name in sensitivities for name in names):
        return path
    ratios = np.array([values.get(name, 0.0) for name in names])

    def held(load: FloatArray) -> FloatArray:
        return np.hstack([np.zeros((len(names), 1)), borne(path.time[1:], load[1:])])

    def relaxing(load: FloatArray, rates: Mapping[str, FloatArray]) -> Course:
        by_branch, by = held(load), {name: rate + ratios @ held(rate) for name, rate in rates.items()}
        own = zip(names, by_branch, strict=True)
        return load + ratios @ by_branch, by | {name: each for name, each in own if name in sensitivities}

    courses = courses_of(path).items()
    return with_courses(path, {name: relaxing(*one) if _is_load(name) else one for name, one in courses})


def _is_load(course: str) -> bool:
    """Whether a course is one of a force or moment, in proportion to stiffnesses and relaxing with them."""
    return course == FORCE or CHANNELS[course.partition(":")[0]].follows_force
