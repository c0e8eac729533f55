"""The tissues of a specimen, one or layers on each other, their laws, and what is free in them."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from legfem.common.errors import Argument, InputError, Remedy
from legfem.common.units import kpa_to_mpa
from legfem.inverse import catalogue
from legfem.inverse.fibre_ratio import USUAL_RATIO, ratio_of
from legfem.inverse.parameter import Parameter, Prior
from legfem.inverse.parse_parameters import AskedParameters, read_prior
from legfem.inverse.readings import INSTRUMENT, RELAXATION
from legfem.mechanics.materials import ExponentialStiffening, Hyperelastic, NeoHookean, ReducedPolynomial, Yeoh
from legfem.specimens.course import relaxation_parameters
from legfem.specimens.schema import FibresEntry, SpecimenFile

ONE = "deep"
"""What the tissue of a specimen of one is called, as the leg's that is identified."""

REFERENCE_MPA = 0.01
"""Stiffness C10 at which a test is solved before anything is known."""
BULK_RATIO = 1000.0
"""Bulk over shear modulus of what is called incompressible."""
KINDS: dict[catalogue.LawName, type[Hyperelastic]] = {
    "neo-hookean": NeoHookean,
    "reduced-polynomial": ReducedPolynomial,
    "yeoh": Yeoh,
    "exponential": ExponentialStiffening,
}


def bulk_ratio(poisson_ratio: float | None) -> float:
    """Return the bulk over the shear modulus at small strain."""
    if poisson_ratio is None:
        return BULK_RATIO
    return 2 * (1 + poisson_ratio) / (3 * (1 - 2 * poisson_ratio))


def specimen_law(name: catalogue.LawName, c10: float, poisson_ratio: float | None) -> Hyperelastic:
    """Return a law at a stiffness C10 (MPa), without stiffening."""
    kind = KINDS[name]
    plain = NeoHookean(c10, 1 / (bulk_ratio(poisson_ratio) * c10))
    return plain if kind is NeoHookean else kind(**{"C20": 0.0, **plain.parameters})


@dataclass(frozen=True)
class SpecimenTissue:
    """What is given of a tissue.

    Parameters
    ----------
    name : str
        By which its parameters are called.
    law : str, optional
        The one that is asked for without it.
    poisson_ratio : float, optional
        At small strain; a bulk modulus of 1000 shear moduli without it.
    stated : Mapping[str, float]
        Numbers of its law that aren't looked for, MPa, and the ratio of its fibres.
    fibrous : bool
        Whether it is stiffer along its fibres.
    """

    name: str = ONE
    law: catalogue.LawName | None = None
    poisson_ratio: float | None = None
    stated: Mapping[str, float] = field(default_factory=dict)
    fibrous: bool = False

    @property
    def fibre_ratio(self) -> float:
        """Shear modulus along the fibres over that across: as stated, or a usual one."""
        return self.stated.get(catalogue.RATIO, USUAL_RATIO)

    @property
    def bulk_ratio(self) -> float:
        """Bulk over shear modulus at small strain."""
        return bulk_ratio(self.poisson_ratio)

    def of_law(self, name: catalogue.LawName) -> "SpecimenTissue":
        """Return the tissue with the law that is asked for, unless it has its own."""
        return self if self.law else replace(self, law=name)

    def at(self, c10: float) -> Hyperelastic:
        """Return its law at a stiffness C10 (MPa) if none is stated."""
        plain = specimen_law(self.law or "neo-hookean", self.stated.get("C10", c10), self.poisson_ratio)
        known = plain.parameters
        return replace(plain, **{n: v for n, v in self.stated.items() if n in known})  # type: ignore[type-var]


def tissues_of(given: SpecimenFile) -> tuple[SpecimenTissue, ...]:
    """Return a file's tissues, from the base up."""
    poisson_ratio = given.tissue.poisson_ratio
    if not given.layers:
        one = SpecimenTissue(poisson_ratio=poisson_ratio)
        return (one if given.fibres is None else _with_fibres(one, given.fibres),)
    every, fibres = list[SpecimenTissue](), given.fibres
    for entry in reversed(given.layers):
        stated = {"C10": entry.C10_kPa, "C20": entry.C20_kPa}
        law: catalogue.LawName | None = entry.law
        if law is None and stated["C20"] is not None:
            law = "reduced-polynomial"
        elif law is None and stated["C10"] is not None:
            law = "neo-hookean"
        own = poisson_ratio if entry.poisson_ratio is None else entry.poisson_ratio
        known = {name: kpa_to_mpa(value) for name, value in stated.items() if value is not None}
        tissue = SpecimenTissue(entry.name, law, own, known)
        every.append(_with_fibres(tissue, fibres) if fibres is not None and fibres.layer == entry.name else tissue)
    return tuple(every)


def _with_fibres(tissue: SpecimenTissue, fibres: FibresEntry) -> SpecimenTissue:
    known = {} if fibres.ratio is None else {catalogue.RATIO: fibres.ratio}
    return replace(tissue, stated={**tissue.stated, **known}, fibrous=True)


def begin_at(tissues: Sequence[SpecimenTissue], usual: float) -> float:
    """Return the stiffness C10 (MPa) to begin at: about what is stated, else the usual one."""
    stated = [math.log(one.stated["C10"]) for one in tissues if "C10" in one.stated]
    return math.exp(sum(stated) / len(stated)) if stated else usual


_FREE: dict[catalogue.LawName, tuple[str, ...]] = {
    "neo-hookean": ("C10",),
    "reduced-polynomial": ("C10", "C20"),
    "yeoh": ("C10", "C20", "C30"),
    "exponential": ("C10", "stiffening", "exponent"),
}
# About the stiffness that the recordings ask for at small strain: bounds, and where to look first.
_FAR, _FAR_OF_LAYERS, _RELATIVE = 100.0, 300.0, 8.0


@dataclass(frozen=True)
class ParameterRequest:
    """What a user asks to be free or held, by full name in the model's units."""

    names: tuple[str, ...] = ()
    """To identify; the law's own without them."""
    priors: Mapping[str, Prior] = field(default_factory=dict)
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    fixed: catalogue.Values = field(default_factory=dict)


def laws_named(name: str | None) -> tuple[catalogue.LawName, ...]:
    """Return the laws of a name; the two of legs for ``both`` or none.

    Raises
    ------
    InputError
        If there is no such law.
    """
    if name in (None, "both"):
        return catalogue.LAWS
    found = tuple(law for law in KINDS if law == name)
    if not found:
        raise InputError("law", str(name), "unknown law", f"give one of {', '.join(KINDS)}, both")
    return found


def request_of(asked: AskedParameters, tissues: Sequence[SpecimenTissue]) -> ParameterRequest:
    """Return what is asked for, of tissues.

    Raises
    ------
    InputError
        For names, numbers or units that can't be.
    """
    known = dict[str, float]()
    for law in KINDS:
        known |= known_values([replace(one.of_law(law), stated={}) for one in tissues], 1.0)
    limits = {catalogue.DEEP_C10: asked.c10_bounds, catalogue.DEEP_C20: asked.c20_bounds}
    bounds = {name: one.bounds for name, one in asked.given.items()}
    if any(limits.values()):
        if catalogue.DEEP_C10 not in known:
            remedy = Remedy("leave it out, or say by ", Argument("prior", "LAYER.C10"), " what is known")
            raise InputError(Argument("c10_bounds"), ", ".join(one.name for one in tissues), "are layers", remedy)
        checked = {one.name: one.bounds for one in replace(asked, identify=(), given={}).parameters(known)}
        bounds |= {name: checked[name] for name, one in limits.items() if one is not None}
    held = asked.held(known)
    for name, value in held.items():
        if catalogue.is_ratio(name) and value < catalogue.RATIO_BOUNDS[0]:
            problem = f"{value:g} is less along the fibres than across"
            raise InputError(Argument("fix"), name, problem, "give at least 1")
    priors = {name: one.prior for name, one in asked.given.items() if one.prior is not None}
    priors |= dict(read_prior(text, known) for text in asked.priors)
    return ParameterRequest(tuple(asked.identify), priors, bounds, held)


def known_values(tissues: Sequence[SpecimenTissue], c10: float) -> dict[str, float]:
    """Return all numbers of tissues at a stiffness (MPa), and of relaxation, by full name."""
    own = {f"{one.name}.{key}": value for one in tissues for key, value in one.at(c10).parameters.items()} | {
        ratio_of(one.name): one.fibre_ratio for one in tissues if one.fibrous
    }
    return own | {name: number.null for name, number in RELAXATION.items()}


def free_names(tissues: Sequence[SpecimenTissue], relaxes: bool) -> tuple[str, ...]:
    """Return what tissues have free of themselves, each of its law."""
    own = (
        f"{one.name}.{key}"
        for one in tissues
        for key in (*_FREE[one.law or "neo-hookean"], *([catalogue.RATIO] if one.fibrous else []))
        if key not in one.stated
    )
    return (*own, *(RELAXATION if relaxes else ()))


def identified_law(
    name: catalogue.LawName, tissues: Sequence[SpecimenTissue], c10: float, longest: float, asked: ParameterRequest
) -> catalogue.IdentifiedLaw:
    """Return what is free and held in a law.

    A compressibility D1 that is neither is left out: it follows from C10 and Poisson's ratio.

    Parameters
    ----------
    name : str
        Of the law.
    tissues : sequence of SpecimenTissue
        From the base up; those without a law of their own have this one.
    c10 : float
        MPa, about which to look.
    longest : float
        Time (s) within which stress relaxes; 0 where it doesn't.
    asked : ParameterRequest
        By the user; names that other laws have alone are left out.

    Raises
    ------
    InputError
        For a name that no law has, or where nothing is left to identify.
    """
    tissues = [one.of_law(name) for one in tissues]
    known = known_values(tissues, c10)
    every = {f"{one.name}.{key}" for one in tissues for keys in _FREE.values() for key in keys}
    catalogue.check_known([n for n in (*asked.names, *asked.priors) if n not in every], known, Argument("identify"))
    catalogue.check_known([n for n in asked.fixed if n not in every], known, Argument("fix"))
    names = asked.names or free_names(tissues, longest > 0)
    wanted = dict.fromkeys((*names, *asked.priors))
    nuisances = set(asked.priors) - set(names)
    far = _FAR if len(tissues) == 1 else _FAR_OF_LAYERS
    free = []
    for one in sorted(wanted, key=lambda one: (one in RELAXATION, one in INSTRUMENT)):
        if one in asked.fixed or (one not in known and one not in INSTRUMENT):
            continue
        parameter = _parameter(one, known, far, longest)
        parameter = replace(
            parameter,
            bounds=asked.bounds.get(one, parameter.bounds),
            prior=asked.priors.get(one, parameter.prior if one in RELAXATION else None),
            role="nuisance" if one in nuisances else "identified",
        )
        free.append(catalogue.within_prior(parameter))
    if not free:
        raise InputError(Argument("identify"), name, "nothing is left to identify", "name a parameter")
    away = {*wanted, *(f"{one.name}.D1" for one in tissues)} - set(asked.fixed)
    away |= set() if longest > 0 else set(RELAXATION)
    there = {*known, *INSTRUMENT} - away
    held = {key: value for key, value in {**known, **asked.fixed}.items() if key in there}
    beside = len(tissues) > 1 or any(catalogue.is_ratio(one.name) for one in free)
    usual = {
        key: within
        for one in tissues
        for key, within in _usual(one.name, known, longest > 0, beside).items()
        if key not in asked.priors
    }
    return catalogue.IdentifiedLaw(name, tuple(free), held, known, usual)


def _parameter(name: str, known: catalogue.Values, far: float, longest: float) -> Parameter:
    """Return a parameter with bounds about the stiffness that the recordings ask for."""
    if name in RELAXATION:
        return next(one for one in relaxation_parameters(longest) if one.name == name)
    if name in INSTRUMENT:
        return catalogue.parameter_of(name, known)
    tissue, _, key = name.rpartition(".")
    of = "" if tissue == ONE else f" of the {tissue}"
    c10, statement, unit = known[f"{tissue}.C10"], catalogue.STATEMENTS[key] + of, catalogue.UNITS.get(key, "-")
    if key in ("C30", "stiffening"):
        return Parameter(name, unit, (0.0, c10 * _RELATIVE), statement=statement)
    centre = catalogue.centre_of(name, known)
    within = {"C20": (0.0, c10 * far), catalogue.RATIO: catalogue.RATIO_BOUNDS, "exponent": (0.1, 20.0)}
    bounds = within.get(key, (centre / far, centre * far))
    return Parameter(name, unit, bounds, scale="log", statement=statement)


def _usual(tissue: str, known: catalogue.Values, relaxes: bool, beside: bool) -> dict[str, tuple[float, float]]:
    """Return where to look first: of a force that relaxes, the lasting part is less.

    Where other layers or fibres bear a part that isn't known, it is less or more.
    """
    c10 = known[f"{tissue}.C10"]
    stiffness = (c10 / 8, 1.5 * c10) if relaxes else (c10 / 3, 2 * c10)
    found = {
        "C10": (c10 / 6, 6 * c10) if beside else stiffness,
        "C20": (0.0, 2 * c10),
        "C30": (0.0, 2 * c10),
        "stiffening": (0.0, 2 * c10),
        "exponent": (0.5, 4.0),
        catalogue.RATIO: (1.0, 4.0),
    }
    return {f"{tissue}.{key}": within for key, within in found.items()}
