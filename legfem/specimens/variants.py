"""The models of a specimen that a diagnosis weighs: the base, and with what mechanisms add."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from legfem.channels.kinds import CHANNELS
from legfem.common.units import FloatArray
from legfem.inverse.accuracy import SIZE
from legfem.inverse.body_models import Displaced, Stopped
from legfem.mechanics.materials import Hyperelastic
from legfem.mechanics.terms import Fibres
from legfem.mechanisms import Solution, shown_in
from legfem.mechanisms.time_dependence import TIMES_S
from legfem.solve.path import Path
from legfem.solve.protocol import Protocol
from legfem.specimens.course import borne
from legfem.specimens.forward import experiment_of
from legfem.specimens.kind import SpecimenTest
from legfem.specimens.laws import ONE, REFERENCE_MPA, SpecimenTissue, specimen_law
from legfem.specimens.sizes import RESIZED, Sizes

if TYPE_CHECKING:
    from legfem.experiments.plane_strain import LateralPlacement
    from legfem.meshing.section import MeshMotion


_C10, _C20 = "deep.C10", "deep.C20"
_BESIDE = "superficial.C10"
"""What mechanisms call the stiffness of tissues beside the one that is asked for."""
_STATED = "stated_"

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
        alike, lengths = self.sizes.kind.as_force, self.sizes.lengths
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
            # Layers are called as the model's terms know them.
            names = (one.name for one in self._named)
            sizes = self._sizes(variant)
            layers = tuple((name, thickness) for name, (_, thickness) in zip(names, sizes.layers, strict=False))
            sizes = replace(sizes, layers=layers)
            called = {one.name: tissue.name for one, tissue in zip(self._named, self.tissues, strict=True)}
            model = experiment_of(sizes, laws, self.depth, fibrous, called)
            self._models[variant] = model.with_terms(self._terms(variant))
        return self._models[variant]

    def _sizes(self, variant: str) -> Sizes:
        free = any(m.tangential == "frictionless" for m in shown_in(variant))
        return (self.sizes.slipping or self.sizes) if free else self.sizes

    def _terms(self, variant: str) -> list[Any]:
        return [term for m in shown_in(variant) for term in m.terms_of(self._law)]

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
        # Euler's theorem: forces are homogeneous of the first degree in the stiffnesses, other channels of none.
        every = {**others, _C20: own[_C20]} if _C10 in sensitivities else {}
        force, nothing = scale * found.force, np.zeros(len(found.time))
        along = partial(_along_c10, stiffnesses=every, scale=scale, c10=deep[_C10])
        by = along({name: scale * values for name, values in found.sensitivities.items()}, value=force)
        seen, channels = {}, {}
        for channel, course in found.channels.items():
            times, degree = (scale, 1.0) if _is_load(channel) else (1.0, 0.0)
            rates = {name: times * rate for name, rate in found.channel_sensitivities.get(channel, {}).items()}
            channels[channel] = times * course
            seen[channel] = along(rates, value=degree * channels[channel])
        for name in (name for name in sensitivities if name in self.measured):
            larger = replace(self, sizes=self.sizes.larger(name.removeprefix(SIZE)))
            changed, step = larger.follow(protocol, deep, solution), RESIZED * self.measured[name]
            if isinstance(changed, Stopped):
                return changed
            by[name] = (changed.force_at(found.time) - force) / step
            for channel, course in changed.channels_at(found.time).items():
                seen[channel][name] = (course - channels[channel]) / step
        return replace(
            found,
            force=force,
            sensitivities={n: by[n] for n in sensitivities},
            channels=channels,
            # What branches bear changes no strain.
            channel_sensitivities={c: {n: own.get(n, nothing) for n in sensitivities} for c, own in seen.items()},
        )

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
        if self.sizes.kind.relaxes_as_a_whole:
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


def _relaxing(path: Path, values: Mapping[str, float], sensitivities: Sequence[str]) -> Path:
    """Return a course with what branches bear; see `legfem.specimens.course`."""
    names = [f"deep.viscoelasticity{k + 1}.ratio" for k in range(len(TIMES_S))]
    if not any(name in values or name in sensitivities for name in names):
        return path
    ratios = np.array([values.get(name, 0.0) for name in names])

    def held(load: FloatArray) -> FloatArray:
        return np.hstack([np.zeros((len(names), 1)), borne(path.time[1:], load[1:])])

    def relaxing(load: FloatArray, rates: Mapping[str, FloatArray]) -> tuple[FloatArray, dict[str, FloatArray]]:
        by_branch, by = held(load), {name: rate + ratios @ held(rate) for name, rate in rates.items()}
        own = zip(names, by_branch, strict=True)
        return load + ratios @ by_branch, by | {name: each for name, each in own if name in sensitivities}

    force, by = relaxing(path.force, path.sensitivities)
    channels, seen = dict(path.channels), dict(path.channel_sensitivities)
    for name in filter(_is_load, path.channels):
        channels[name], seen[name] = relaxing(channels[name], seen.get(name, {}))
    return replace(path, force=force, sensitivities=by, channels=channels, channel_sensitivities=seen)


def _is_load(course: str) -> bool:
    """Whether a channel's course is a force or moment, in proportion to stiffnesses and relaxing with them."""
    return CHANNELS[course.partition(":")[0]].follows_force
