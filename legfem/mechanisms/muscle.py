"""Muscle: compressible, fibrous, stiffening, tensing, or stiffer in one place than elsewhere."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.stats import norm
from shapely import union_all

from legfem.common.units import FloatArray, kpa_to_mpa
from legfem.geometry.indenter import Site
from legfem.geometry.section import MUSCLE, LegSection, across, first_crossing
from legfem.inverse.advice import DEEPER, LabStep, either, recorded
from legfem.inverse.correction import read_fibres
from legfem.inverse.elastography import HIGHEST_RATIO
from legfem.inverse.mechanism import (
    IndentedLeg,
    Mechanism,
    Solution,
    TissueMechanism,
    Values,
    error_mode,
    factor,
    null_of,
    shape,
    strength,
)
from legfem.inverse.observations import Observations
from legfem.inverse.parameter import Prior
from legfem.mechanisms import AWAY, ONSET, moments, passing

if TYPE_CHECKING:
    from legfem.mechanics.materials import Hyperelastic


class Compressibility(TissueMechanism):
    """The deep tissue's D1, over the one given."""

    name = "compressibility"
    statement = "the muscle is more (or less) compressible than assumed"
    of_pad = "the tissue is more (or less) compressible than assumed"
    parameters = (
        factor(
            "factor", "D1 over the assumed one", (0.1, 60.0), 1.3, "reported bulk moduli of muscle differ a hundredfold"
        ),
    )
    scaled = ("deep.D1",)
    would_be = "a muscle of {} times the assumed compressibility"
    next_experiment = "image the section under load and measure how its area changes"
    steps = (LabStep(next_experiment, recorded("section_displacement")),)
    measured_sd = 0.7
    """An estimate: areas to 0.5 % beside changes of 1 %."""
    strengths = (0.3, 3.0, 9.0, 26.0)


class StrainStiffening(TissueMechanism):
    """One more term of the energy's series in (I1 - 3)."""

    name = "strain-stiffening"
    statement = "the deep tissue stiffens with strain more than the law used can describe"
    of_pad = "the tissue stiffens with strain more than the law used can describe"
    parameters = (strength("coefficient", "kPa", "coefficient of the energy's next power of strain", 1.5, (0.0, 20.0)),)
    steps = (DEEPER, LabStep("press with a smaller indenter: larger strains"))
    next_experiment = either(*steps)
    strengths = (0.3, 1.2, 4.0)
    stands_for_C20 = True

    def terms(self, leg: IndentedLeg) -> Sequence[Any]:
        """Return the tissue with a third coefficient of its energy."""
        return self.terms_of(leg.tissues.deep)

    def terms_of(self, law: "Hyperelastic") -> Sequence[Any]:
        """Return the same of a body of one tissue."""
        from legfem.mechanics.materials import Yeoh
        from legfem.mechanics.terms import Tissue

        return [Tissue("deep", Yeoh.of(law))]

    def solution(self, values: Values) -> Solution:
        """Return the law with its third coefficient."""
        return Solution(parameters={"deep.C30": kpa_to_mpa(values["coefficient"])})


class MuscleContraction(Mechanism):
    """The muscle tenses from a moment on, in every trial, and may let go after a while: its stiffness rises smoothly.

    An elastic leg's force at a displacement follows from the stiffness then, so no history is
    needed; `legfem.mechanics.terms.muscle` is the same thing in the finite-element model, of a muscle that stays tense.
    """

    name = "muscle-contraction"
    needs = MUSCLE
    statement = "the muscle tensed during the test and became stiffer"
    parameters = (
        strength("stiffening", "-", "rise of the deep stiffness over itself", 0.2, (0.0, 3.0)),
        ONSET,
        shape(
            "rise",
            "-",
            "how long it takes to rise, likewise",
            Prior(0.06, 0.8, "log", "a second or some"),
            (0.005, 0.5),
        ),
        AWAY,
    )
    would_be = "a muscle that tenses and becomes stiffer by a share of {}"
    next_experiment = "repeat with electromyography of the muscle, or ask for a relaxed leg and compare"
    measured_sd = 0.03
    """An estimate."""

    def starts(self, observed: Observations) -> tuple[Values, ...]:
        """Return onsets through the programme, of a muscle that stays tense and of one that lets go."""
        rise = self.parameters[2]
        return tuple(
            {"stiffening": 0.1, "onset": onset, "rise": rise.inside(share * apart), "away": gone}
            for onset, apart in moments(observed)
            for share, gone in ((0.4, 2.0), (1.5, 2.0), (0.4, AWAY.inside(apart)))
        )

    def deep_factor(self, values: Values, observed: Observations) -> FloatArray:
        """Return the stiffness over that at rest."""
        return 1.0 + values["stiffening"] * passing(values, observed)


_UNSEEN = 5
"""Ratios, and errors of the table, that stand for all."""
_SOURCE = "the table of fibres' own errors"


class MuscleFibres(Mechanism):
    r"""Force times :math:`f(d; r)^{1 + \sum_k a_k e_k(d)}`, see `legfem.legs.correction_of_leg`.

    The two :math:`e_k` are the modes that the table's errors are mostly made of, as shares of
    :math:`\ln f` and in standard deviations. Only a cylinder that ends bends fibres, so that it
    shows where the base model has ends.
    """

    name = "muscle-fibres"
    needs = MUSCLE
    statement = "muscle is fibrous along the leg: its fibres bend at the cylinder's ends, and resist"
    parameters = (
        factor(
            "ratio",
            "of the muscle's shear moduli along the leg and across",
            (1.0, HIGHEST_RATIO),
            0.8,
            "shear waves in vivo: about 3 in the vastus lateralis (PMC8754054)",
        ),
        error_mode("size", "error of the table that is mostly alike at all depths", _SOURCE),
        error_mode("course", "error of the table that changes along the depth", _SOURCE),
    )
    next_experiment = (
        "press with the cylinder across the leg or with an end-on punch, or measure the muscle by "
        "shear-wave elastography along its fibres and across"
    )
    measured_sd = 0.15
    """An estimate: moduli to 10 % each."""

    expected = 5.0
    """All skeletal muscle is fibrous; its part that presses on a cylinder may lie otherwise."""
    unseen_statement = (
        "muscle is stiffer along its fibres than across them, and pressing one place does not show by how much"
    )
    hides_in_stiffness = True

    def unseen_factors(self, between: tuple[float, float], observed: Observations) -> FloatArray:
        """Return how much stiffer a muscle has to be that is alike in all directions, for as much force.

        Ratios lie evenly in their logarithm, and the table has its errors.
        """
        even = norm.ppf((np.arange(_UNSEEN) + 0.5) / _UNSEEN)
        errors = [{"size": float(z), "course": 0.0} for z in even]
        ratios = np.geomspace(*between, _UNSEEN)
        force = observed.force**2 / np.sum(observed.force**2)
        found = [
            np.exp(force @ np.log(self.force_factor({"ratio": float(ratio), **error}, observed)))
            for ratio in ratios
            for error in errors
        ]
        return np.array(found)

    def starts(self, observed: Observations) -> tuple[Values, ...]:
        """Return fibres of usual ratios."""
        others = {one.name: null_of(one) for one in self.parameters[1:]}
        return tuple({"ratio": ratio, **others} for ratio in (1.6, 3.0))

    def for_length(self, values: Values, factor: float) -> Values:
        """Return fibres of a ratio nearer to one: a longer cylinder's ends count less."""
        return {**values, "ratio": values["ratio"] ** (1 / factor)}

    def force_factor(self, values: Values, observed: Observations) -> FloatArray:
        """Return the factor by fibres under the cylinder's ends."""
        d = observed.displacement
        grid, modes = _modes()
        share = 1.0 + values["size"] * np.interp(d, grid, modes[0])
        share += values["course"] * np.interp(d, grid, modes[1])
        return np.asarray(np.exp(share * read_fibres().log_at(values["ratio"], d)))


@cache
def _modes() -> tuple[FloatArray, FloatArray]:
    """Return the table's displacements (n,), mm, and the two greatest modes of its errors."""
    table = read_fibres()
    _, sizes, modes = np.linalg.svd(np.array(list(table.errors.values())), full_matrices=False)
    return table.displacement, sizes[:2, None] * modes[:2]


_DEPTHS_MM, _SIDES_MM = (6.0, 18.0, 30.0), (-16.0, 0.0, 16.0)
_RADII_MM = (5.5, 11.0)
"""Of a lump."""
_LUMPS = tuple(product(_RADII_MM, _DEPTHS_MM, _SIDES_MM))
_SHARED = 0.4
"""Of the distance between places: how far from one its response is shared with the next."""
_SATURATION = 0.5
"""Of solutions on a leg of 0.8 kPa: right within 7 % up to three times as stiff, and within 11 % down to a third."""
_HARD = 10.0
"""Factor at which it is solved, too: from there on a lump is as good as rigid."""


def _places(site: Site, depth_and_side: Sequence[tuple[float, float]]) -> FloatArray:
    """Return places (n, 2) in the section, of depths below the fascia along the travel and to its left, mm."""
    travel, touch = site.direction, site.touch
    fascia = first_crossing(site.section.polygon("fascia").exterior, touch, travel)
    depth, side = np.array(depth_and_side).T
    return np.asarray(touch + np.outer(fascia + depth, travel) + np.outer(side, across(travel)))


class UnevenMuscle(TissueMechanism):
    r"""A lump, or a weak spot, somewhere under the indenter.

    A smaller one that is stiffer changes the force likewise, but moves the tissue about it less, so that the rest of
    the muscle is told apart from it by other channels. Between places and radii of a lattice its response is shared
    out among them; its own solution is of one lump. The force follows the excess e as :math:`g = \ln(1 + c e) / c`,
    less and less as that of an inclusion does (J. D. Eshelby, Proc. R. Soc. A 241 (1957) 376); what that misses of a
    solution with a hard lump at each place counts with the square of g over its own there.
    """

    name = "uneven-muscle"
    needs = MUSCLE
    statement = "a region of the muscle is stiffer or softer than the rest of it"
    parameters = (
        factor(
            "factor",
            "on the stiffness there",
            (0.1, 10.0),
            0.7,
            "the calf's muscles differ by up to a factor of two in shear-wave elastography",
        ),
        shape(
            "depth",
            "mm",
            "of its middle below the fascia, along the travel",
            Prior(18.0, 9.0, "linear", "anywhere under the indenter"),
            (0.0, 36.0),
        ),
        shape(
            "side",
            "mm",
            "of its middle from the line of travel, counter-clockwise positive",
            Prior(0.0, 10.0, "linear", "anywhere under the indenter"),
            (-20.0, 20.0),
        ),
        shape(
            "radius",
            "mm",
            "of it, taken as a disk",
            Prior(8.0, 2.5, "linear", "from a tendon's to a muscle's own size"),
            (_RADII_MM[0], _RADII_MM[-1]),
        ),
    )
    would_be = "a region of the muscle of {} times the stiffness of the rest"
    next_experiment = "press at a second place of the muscle, or map the muscle by shear-wave elastography"
    expected = 3.0
    """Aponeuroses and tendons run through every calf, and vessels: what isn't known is whether they matter."""
    variant = "uneven"

    def acts_in(self, values: Values, site: Site) -> tuple[FloatArray, float]:
        """Return the lump."""
        return _places(site, [(values["depth"], values["side"])])[0], values["radius"]

    @property
    def derivatives(self) -> tuple[str, ...]:
        """Excesses at the lattice's places."""
        return tuple(f"deep.uneven_stiffness.excess{k + 1}" for k in range(len(_LUMPS)))

    def starts(self, observed: Observations) -> tuple[Values, ...]:
        """Return stiffer and softer ones, near the fascia, deep, and at the sides."""
        return tuple(
            {"factor": size, "depth": depth, "side": side, "radius": 8.0}
            for size in (0.6, 1.7)
            for depth, side in ((8.0, 0.0), (26.0, 0.0), (14.0, -12.0), (14.0, 12.0))
        )

    def terms(self, leg: IndentedLeg) -> Sequence[Any]:
        """Return the muscle's excess of stiffness at the lattice's places, and at one that solutions choose."""
        from legfem.mechanics.terms.muscle import StiffLump, UnevenStiffness

        muscle, travel = leg.tissues.deep, leg.indenter.direction
        places = _places(Site(leg.section, leg.indenter), [(0.0, 0.0), *(place[1:] for place in _LUMPS)])
        origin, *points = [(float(x), float(y)) for x, y in places]
        radii = tuple(radius for radius, _, _ in _LUMPS)
        return [
            UnevenStiffness("deep", muscle, tuple(points), radii),
            StiffLump("deep", muscle, origin, (float(travel[0]), float(travel[1])), radius=_RADII_MM[0]),
        ]

    @property
    def nodes(self) -> tuple[Values, ...]:
        """A hard lump at each of the lattice's places, of each radius."""
        return tuple(
            {"factor": _HARD, "depth": depth, "side": side, "radius": radius} for radius, depth, side in _LUMPS
        )

    def shares(self, values: Values) -> FloatArray:
        """Return what the derivative by every place's excess is multiplied by, and what a hard lump's rest there."""
        at, weights = _saturating(values["factor"]), _weights(values)
        return np.concatenate([at * weights, (max(at, 0.0) / _saturating(_HARD)) ** 2 * weights])

    def solution(self, values: Values) -> Solution:
        """Return the model with one lump."""
        given = {"excess": values["factor"] - 1, **{name: values[name] for name in ("depth", "side", "radius")}}
        return Solution(self.variant, {f"deep.stiff_lump.{name}": float(value) for name, value in given.items()})

    def in_limb(self, section: LegSection) -> Sequence[Mechanism]:
        """Return it, and the muscles that are known by name: together as often there as it is by itself."""
        grouped = {one for own in section.groups.values() for one in own}
        if not (names := [*section.groups, *(one for one in section.muscles if one not in grouped)]):
            return (self,)
        kin, share = "some part of the muscle is stiffer or softer than the rest of it", 0.5 * self.expected
        muscles = [NamedMuscle.called(name).restated(expected=share / len(names), kin=kin) for name in names]
        return (self.restated(expected=share, kin=kin), *muscles)


@dataclass(frozen=True)
class NamedMuscle(TissueMechanism):
    """A muscle, or a group of muscles, that is stiffer or softer than the rest of the deep tissue.

    Parameters
    ----------
    muscle
        Its name.
    """

    muscle: str

    name = "muscle-stiffness"
    statement = "a muscle is stiffer or softer than the rest"
    parameters = UnevenMuscle.parameters[:1]
    next_experiment = UnevenMuscle.next_experiment
    measured_sd = 0.15
    """An estimate: moduli of both to 10 % each."""
    strengths = (0.3, 0.6, 1.8, 5.0)

    @classmethod
    def called(cls, muscle: str) -> "NamedMuscle":
        """Return the mechanism of a muscle, or group, with its name in all that it says."""
        rest, words = "the rest of the muscle", muscle.replace("_", " ")
        said = f"the {words} is stiffer or softer than {rest}"
        would_be = f"a {words} of {{}} times the stiffness of {rest}"
        return cls(muscle).restated(name=f"{muscle}-stiffness", statement=said, would_be=would_be)

    def acts_in(self, values: Values, site: Site) -> tuple[FloatArray, float]:
        """Return the muscle's middle, and the radius of a disk as large."""
        area = union_all([site.section.polygon(one) for one in site.section.muscles_of(self.muscle)])
        return np.array(area.centroid.coords[0]), float(np.sqrt(area.area / np.pi))

    def terms(self, leg: IndentedLeg) -> Sequence[Any]:
        """Return the muscle's excess of stiffness."""
        from legfem.mechanics.terms import Excess

        return [Excess(self.muscle, "deep", leg.tissues.deep)]

    def solution(self, values: Values) -> Solution:
        """Return the model with the excess."""
        return Solution(parameters={f"{self.muscle}.stiffness.excess": values["factor"] - 1})


def _saturating(factor: float) -> float:
    return float(np.log1p(_SATURATION * (factor - 1)) / _SATURATION)


def _weights(values: Values) -> FloatArray:
    """Return the shares of the lattice's lumps in one between them; their sum is one."""
    small, large = np.log(_RADII_MM)
    larger = float(np.clip((np.log(values["radius"]) - small) / (large - small), 0.0, 1.0))
    of_places = np.outer(_near(values["depth"], _DEPTHS_MM), _near(values["side"], _SIDES_MM)).ravel()
    return np.outer([1 - larger, larger], of_places).ravel()


def _near(at: float, nodes: Sequence[float]) -> FloatArray:
    away = (at - np.array(nodes)) / (_SHARED * (nodes[1] - nodes[0]))
    each = np.exp(-0.5 * (away**2 - np.min(away**2)))
    return np.asarray(each / each.sum())
