"""Laws of a specimen's tissue, and what is free in them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from legfem.common.errors import InputError
from legfem.identify.catalogue import (
    DEEP_C10,
    DEEP_C20,
    UNITS,
    Values,
    check_known,
    parameter_of,
    within_prior,
)
from legfem.identify.laws import LAWS, IdentifiedLaw, LawName
from legfem.identify.reading import INSTRUMENT, RELAXATION
from legfem.identify.written import Written, read_prior
from legfem.inference.parameter import Parameter, Prior
from legfem.mechanics.materials import (
    ExponentialStiffening,
    Hyperelastic,
    NeoHookean,
    ReducedPolynomial,
    Yeoh,
)
from legfem.specimens.relaxation import relaxation_parameters

REFERENCE_MPA = 0.01
"""Stiffness C10 at which a test is solved before anything is known."""
BULK_RATIO = 1000.0
"""Bulk over shear modulus of what is called incompressible."""
_KINDS: dict[LawName, type[Hyperelastic]] = {
    "neo-hookean": NeoHookean,
    "reduced-polynomial": ReducedPolynomial,
    "yeoh": Yeoh,
    "exponential": ExponentialStiffening,
}
_FREE: dict[LawName, tuple[str, ...]] = {
    "neo-hookean": ("C10",),
    "reduced-polynomial": ("C10", "C20"),
    "yeoh": ("C10", "C20", "C30"),
    "exponential": ("C10", "stiffening", "exponent"),
}
_STATEMENTS = {
    "C10": "stiffness at small strain",
    "C20": "stiffening",
    "C30": "late stiffening",
    "stiffening": "stiffness of the exponential part",
    "exponent": "exponent of the stiffening",
    "D1": "compressibility",
    "D2": "compressibility at large changes of volume",
}
# About the stiffness that the recordings ask for at small strain: bounds, and where to look first.
_FAR, _RELATIVE = 100.0, 8.0


@dataclass(frozen=True)
class Asked:
    """What a user asks to be free or held, by full name in the model's units."""

    names: tuple[str, ...] = ()
    """To identify; the law's own without them."""
    priors: Mapping[str, Prior] = field(default_factory=dict)
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    fixed: Values = field(default_factory=dict)


def laws_named(name: str | None) -> tuple[LawName, ...]:
    """Return the laws of a name; the two of legs for ``both`` or none.

    Raises
    ------
    InputError
        If there is no such law.
    """
    if name in (None, "both"):
        return LAWS
    found = tuple(law for law in _KINDS if law == name)
    if not found:
        raise InputError("law", str(name), "unknown law", f"give one of {', '.join(_KINDS)}, both")
    return found


def asked_in_writing(written: Written) -> Asked:
    """Return what a command line asks for.

    Raises
    ------
    InputError
        For names, numbers or units that can't be.
    """
    known = dict[str, float]()
    for law in _KINDS:
        known |= known_values(specimen_law(law, 1.0, None))
    given = {DEEP_C10: written.c10_bounds, DEEP_C20: written.c20_bounds}
    checked = {one.name: one.bounds for one in replace(written, identify=()).parameters(known)}
    return Asked(
        tuple(written.identify),
        dict(read_prior(text, known) for text in written.priors),
        {name: checked[name] for name, bounds in given.items() if bounds is not None},
        written.held(known),
    )


def bulk_ratio(poisson_ratio: float | None) -> float:
    """Return the bulk over the shear modulus at small strain."""
    if poisson_ratio is None:
        return BULK_RATIO
    return 2 * (1 + poisson_ratio) / (3 * (1 - 2 * poisson_ratio))


def specimen_law(name: LawName, c10: float, poisson_ratio: float | None) -> Hyperelastic:
    """Return a law at a stiffness C10 (MPa), without stiffening."""
    ratio = bulk_ratio(poisson_ratio)
    kind = _KINDS[name]
    plain = NeoHookean(c10, 1 / (ratio * c10))
    return plain if kind is NeoHookean else kind(**{"C20": 0.0, **plain.parameters})


def known_values(law: Hyperelastic) -> dict[str, float]:
    """Return all numbers of a law and of its relaxation by full name."""
    own = {f"deep.{key}": value for key, value in law.parameters.items()}
    return own | {name: one.null for name, one in RELAXATION.items()}


def free_names(name: LawName, relaxes: bool) -> tuple[str, ...]:
    """Return what a law has free of itself."""
    return (*(f"deep.{key}" for key in _FREE[name]), *(RELAXATION if relaxes else ()))


def identified_law(name: LawName, law: Hyperelastic, relaxes: bool, asked: Asked) -> IdentifiedLaw:
    """Return what is free and held in a law.

    Parameters
    ----------
    name : str
        Of the law.
    law : Hyperelastic
        At the stiffness about which to look.
    relaxes : bool
        Whether the spectrum counts.
    asked : Asked
        By the user; names that other laws have alone are left out.

    Raises
    ------
    InputError
        For a name that no law has, or where nothing is left to identify.
    """
    known = known_values(law)
    every = dict.fromkeys(f"deep.{key}" for keys in _FREE.values() for key in keys)
    check_known([n for n in (*asked.names, *asked.priors) if n not in every], known, "--identify")
    check_known([n for n in asked.fixed if n not in every], known, "--fix")
    names = asked.names or free_names(name, relaxes)
    wanted = dict.fromkeys((*names, *asked.priors))
    nuisances = set(asked.priors) - set(names)
    free = []
    for one in sorted(wanted, key=lambda one: (one in RELAXATION, one in INSTRUMENT)):
        if one in asked.fixed or (one not in known and one not in INSTRUMENT):
            continue
        parameter = _parameter(one, known)
        parameter = replace(
            parameter,
            bounds=asked.bounds.get(one, parameter.bounds),
            prior=asked.priors.get(one),
            role="nuisance" if one in nuisances else "identified",
        )
        free.append(within_prior(parameter))
    if not free:
        raise InputError("--identify", name, "nothing is left to identify", "name a parameter")
    held = {key: value for key, value in {**known, **asked.fixed}.items()
            if key in known or key in INSTRUMENT}  # fmt: skip
    held = {key: value for key, value in held.items() if key not in wanted or key in asked.fixed}
    if not relaxes:
        held = {key: value for key, value in held.items() if key not in RELAXATION}
    return IdentifiedLaw(name, tuple(free), held, known, _usual(known[DEEP_C10], relaxes))


def _parameter(name: str, known: Values) -> Parameter:
    """Return a parameter with bounds about the stiffness that the recordings ask for."""
    for one in relaxation_parameters():
        if one.name == name:
            return one
    if name in INSTRUMENT:
        return parameter_of(name, known)
    key = name.rpartition(".")[2]
    c10, statement, unit = known[DEEP_C10], _STATEMENTS[key], UNITS.get(key, "-")
    if key == "C10":
        return Parameter(name, unit, (c10 / _FAR, c10 * _FAR), scale="log", statement=statement)
    if key == "C20":
        return Parameter(name, unit, (0.0, c10 * _FAR), scale="log", statement=statement)
    if key in ("C30", "stiffening"):
        return Parameter(name, unit, (0.0, c10 * _RELATIVE), statement=statement)
    if key == "exponent":
        return Parameter(name, unit, (0.1, 20.0), scale="log", statement=statement)
    centre = known[name] if math.isfinite(known[name]) else known["deep.D1"]
    return Parameter(name, unit, (centre / _FAR, centre * _FAR), scale="log", statement=statement)


def _usual(c10: float, relaxes: bool) -> dict[str, tuple[float, float]]:
    """Return where to look first: of a force that relaxes, the lasting part is less."""
    return {
        DEEP_C10: (c10 / 8, 1.5 * c10) if relaxes else (c10 / 3, 2 * c10),
        "deep.C20": (0.0, 2 * c10),
        "deep.C30": (0.0, 2 * c10),
        "deep.stiffening": (0.0, 2 * c10),
        "deep.exponent": (0.5, 4.0),
    }
