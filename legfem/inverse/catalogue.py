"""The parameters that models and instruments have, by name: units, bounds, and how they are written."""

import difflib
import math
import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from legfem.common.errors import Argument, InputError
from legfem.common.resources import resource
from legfem.common.units import FloatArray, readable_unit
from legfem.inverse.parameter import Parameter, Priors, Scale
from legfem.inverse.readings import INSTRUMENT, READINGS

type Values = Mapping[str, float]
"""Numbers of a model and its instrument by full name, in the model's units (mm, N, MPa, s)."""

DEEP_C10, DEEP_C20, DEEP_D2 = "deep.C10", "deep.C20", "deep.D2"
RATIO = "fibre_ratio"
"""What the ratio of a tissue's shear moduli along its fibres and across is called after it."""
DEEP_RATIO = f"deep.{RATIO}"
RATIO_BOUNDS = (1.0, 10.0)
UNITS = {"C10": "MPa", "C20": "MPa", "C30": "MPa", "stiffening": "MPa", "D1": "1/MPa", "D2": "1/MPa"}
_BOUNDS = {"C10": (2e-5, 0.03), "C20": (0.0, 0.05)}
# The designs' greatest extent: legs lie within, and the extremes take longest to solve.
_USUAL_DEEP = {DEEP_C10: (1.5e-4, 4e-3), DEEP_C20: (0.0, 6e-3)}
_USUAL_RATIO = 1.0, 4.0
# By which an assumed number may be off, and by which it usually is at most.
_MOST, _USUAL = 100.0, 3.0
# Standard deviations of a prior that a design spans and that a search may go, and the least span.
_PRIOR_SPAN, _PRIOR_MOST, _LEAST_SPAN = 2.0, 8.0, 1.2
_INSTRUMENT_BOUNDS = {
    "instrument.gain": (0.5, 2.0),
    "instrument.zero": (-2.0, 2.0),
    "instrument.contact_offset": (-2.0, 2.0),
}
STATEMENTS = resource("parameters", dict[str, dict[str, Any]])["statements"]
"""What parameters are, by their key or full name."""


def check_known(names: Collection[str], nominal: Values, source: Argument) -> None:
    """Check that there are parameters of these names.

    Raises
    ------
    InputError
        With the nearest known name.
    """
    known = (*nominal, *INSTRUMENT)
    for name in names:
        if name not in known:
            nearest = difflib.get_close_matches(name, known, 1, 0.0)
            problem = "is not a parameter of this model"
            raise InputError(source, name, problem, f"did you mean {nearest[0]}? There are {', '.join(known)}")


def check_held(source: Argument, text: str, name: str, value: float) -> None:
    """Check that a value can be held.

    Raises
    ------
    InputError
        If it is a stiffness or compressibility that is negative or nothing.
    """
    least = 0.0 if name.endswith("C20") else 1e-12
    if not name.startswith("instrument.") and value < least:
        raise InputError(source, text, "is negative or nothing", "give a positive value")


def is_ratio(name: str) -> bool:
    """Return whether a full name is that of a ratio of fibres."""
    return name.endswith(f".{RATIO}")


def unit_of(name: str) -> str:
    """Return the model's unit of a parameter; 1 (-) where it isn't known."""
    return READINGS[name].unit if name in READINGS else UNITS.get(name.rpartition(".")[2], "-")


def parameter_of(name: str, nominal: Values) -> Parameter:
    """Return a parameter with bounds that suit legs, without a prior.

    Parameters
    ----------
    name : str
        Of the model's values, or of `INSTRUMENT`.
    nominal : Mapping[str, float]
        The model's values as assumed.
    """
    term, _, field = name.rpartition(".")
    statement = STATEMENTS.get(name, f"{STATEMENTS.get(field, field)} of the {term} tissue")
    scale: Scale = "log"
    if name in INSTRUMENT:
        scale = "log" if name == "instrument.gain" else "linear"
        bounds = _INSTRUMENT_BOUNDS[name]
    elif field == RATIO:
        bounds = RATIO_BOUNDS
    elif term == "deep" and field in _BOUNDS:
        bounds = _BOUNDS[field]
    else:
        centre = centre_of(name, nominal)
        bounds = _BOUNDS["C20"] if field == "C20" else (centre / _MOST, centre * _MOST)
    return Parameter(name, unit_of(name), bounds, scale=scale, statement=statement)


def centre_of(name: str, nominal: Values) -> float:
    """Return the value about which a parameter is looked for."""
    if name in INSTRUMENT:
        return INSTRUMENT[name].null
    value = nominal.get(name, math.nan)
    term, _, field = name.rpartition(".")
    if field == "D2" and not math.isfinite(value):
        return nominal.get(f"{term}.D1", math.nan)
    return value


def usual_range(parameter: Parameter, nominal: Values) -> tuple[float, float]:
    """Return where a parameter usually lies, within its bounds: what a design spans."""
    if (prior := parameter.prior) is not None:
        low, high = (prior.value_at(side * _PRIOR_SPAN) for side in (-1, 1))
        if parameter.scale == "log":
            low = max(low, prior.centre / _USUAL**2)
            low, high = min(low, prior.centre / _LEAST_SPAN), max(high, prior.centre * _LEAST_SPAN)
    elif parameter.name in _USUAL_DEEP:
        low, high = _USUAL_DEEP[parameter.name]
    elif is_ratio(parameter.name):
        low, high = _USUAL_RATIO
    elif parameter.scale == "log" and parameter.bounds[0] > 0:
        centre = centre_of(parameter.name, nominal)
        centre = parameter.inside(centre) if math.isfinite(centre) else math.sqrt(math.prod(parameter.bounds))
        low, high = centre / _USUAL, centre * _USUAL
    else:
        low, high = parameter.bounds
    low, high = max(low, parameter.bounds[0]), min(high, parameter.bounds[1])
    return (low, high) if low < high else parameter.bounds


def within_prior(parameter: Parameter) -> Parameter:
    """Return a parameter whose bounds don't reach where its prior rules it out."""
    if (prior := parameter.prior) is None:
        return parameter
    low, high = (prior.value_at(side * _PRIOR_MOST) for side in (-1, 1))
    bounds = max(low, parameter.bounds[0]), min(high, parameter.bounds[1])
    if not bounds[0] < bounds[1]:
        problem = f"lies outside the bounds of the search, {parameter.bounds[0]:g} to "
        problem += f"{parameter.bounds[1]:g} {parameter.unit}"
        raise InputError(Argument("prior"), parameter.name, problem, "widen the bounds, or correct the prior")
    return replace(parameter, bounds=bounds)


def deep_stiffness(values: Mapping[str, float]) -> tuple[float, float]:
    """Return C10 and C20 of the deep tissue, MPa; a law without C20 has none."""
    return values[DEEP_C10], values.get(DEEP_C20, 0.0)


def key_of(name: str) -> str:
    """Return how a parameter is called in documents: ``c10_deep`` for ``deep.C10``."""
    term, _, field = name.rpartition(".")
    return f"{field.lower()}_{term.replace('.', '_')}"


_KEY = re.compile(r"([cd][12]0?)_(deep|superficial|fascia)")
_TISSUES = {"deep": "muscle", "superficial": "fat", "fascia": "fascia"}


def called(key: str) -> str:
    """Return how a parameter of documents and tables is called on pages: C10 of the muscle for ``c10_deep``."""
    found = _KEY.fullmatch(key)
    return f"{found[1].upper()} of the {_TISSUES[found[2]]}" if found else key.replace("_", " ")


def symbol_of(name: str) -> str:
    """Return how a parameter is called in sentences: ``C10`` for ``deep.C10``, else with its tissue."""
    term, _, field = name.rpartition(".")
    if field in UNITS and term not in ("", "deep"):
        return f"{field} of the {_TISSUES.get(term, term.replace('_', ' '))}"
    return name.removeprefix("deep.")


def short_key_of(name: str) -> str:
    """Return ``c10`` for ``deep.C10``, and `key_of` for what isn't the deep tissue's."""
    return symbol_of(name).lower() if name.startswith("deep.") else key_of(name)


def with_units(
    values: Mapping[str, Any], key: Callable[[str], str] = lambda name: name.replace(".", "_")
) -> dict[str, Any]:
    """Return values as people read them, by keys of their names that end with the unit."""
    found = {}
    for name, value in values.items():
        unit, factor = readable_unit(unit_of(name))
        found[f"{key(name)}_{unit_suffix(unit)}"] = factor * value
    return found


def stiffness_in_words(values: Values) -> str:
    """Return stiffnesses that aren't zero, and the ratio of fibres, as progress tells them: ``C10 1.2 kPa``."""
    told = []
    for name, value in values.items():
        unit, factor = readable_unit(unit_of(name))
        if unit == "kPa" and value:
            told.append(f"{symbol_of(name)} {factor * value:.4g} kPa")
        elif name == DEEP_RATIO:
            told.append(f"fibres {value:.3g}")
    return ", ".join(sorted(told))


def unit_suffix(unit: str) -> str:
    """Return a unit as the end of a document's key."""
    return {"1/MPa": "per_MPa", "-": "1"}.get(unit, unit)


LawName = Literal["neo-hookean", "reduced-polynomial", "yeoh", "exponential"]


LAWS: tuple[LawName, ...] = ("neo-hookean", "reduced-polynomial")
"""Of legs; specimens take all."""


@dataclass(frozen=True, eq=False)
class IdentifiedLaw:
    """A law, what of it is free, and what is held.

    Parameters
    ----------
    name : str
        Of the deep tissue's strain energy.
    parameters : tuple of Parameter
        p free ones: identified, or nuisances that a prior holds.
    fixed : Mapping[str, float]
        Values of the model and the instrument that are held.
    nominal : Mapping[str, float]
        The model's values as assumed, for those that are neither.
    usual : Mapping[str, tuple of float]
        Where to look first, in place of where legs lie.
    starts : tuple of Mapping[str, float]
        Values of the free parameters to solve first, in place of a design.
    """

    name: LawName
    parameters: tuple[Parameter, ...]
    fixed: Values
    nominal: Values
    usual: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    starts: tuple[Values, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Names (p) of the free parameters."""
        return tuple(one.name for one in self.parameters)

    @cached_property
    def of_model(self) -> list[int]:
        """Which of the free parameters are the model's, and not the instrument's."""
        return [k for k, name in enumerate(self.names) if name not in READINGS]

    @property
    def priors(self) -> Priors:
        """Those of the free parameters."""
        return Priors(self.parameters)

    def index(self, name: str) -> int | None:
        """Return which free parameter has a name."""
        return self.names.index(name) if name in self.names else None

    def values(self, point: FloatArray) -> dict[str, float]:
        """Return all values of a point (p,) of free parameters."""
        return {**self.fixed, **dict(zip(self.names, map(float, point), strict=True))}

    def point(self, values: Values) -> FloatArray:
        """Return the free parameters (p,) of values."""
        return np.array([values[name] for name in self.names])

    def column(self, points: FloatArray, name: str) -> FloatArray:
        """Return a value (...) at points (..., p), free or held."""
        index = self.index(name)
        if index is not None:
            return np.asarray(points[..., index])
        null = READINGS[name].null if name in READINGS else self.nominal.get(name, 0.0)
        return np.full(points.shape[:-1], self.fixed.get(name, null))

    def readings(self, points: FloatArray) -> FloatArray:
        """Return the numbers (..., k) of `READINGS` at points (..., p)."""
        return np.stack([self.column(points, name) for name in READINGS], axis=-1)


def model_values(values: Values) -> dict[str, float]:
    """Return what of values is the model's."""
    return {name: value for name, value in values.items() if name not in READINGS}
