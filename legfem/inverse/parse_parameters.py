"""Parameters as people write them: ``superficial.C10=2±1 kPa``."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from legfem.common.errors import Argument, InputError
from legfem.common.units import MPA_PER_KPA, kpa_to_mpa
from legfem.inverse import catalogue
from legfem.inverse.parameter import Parameter, Prior
from legfem.inverse.population import CALF, TISSUES, cohort_prior, population_prior

_NUMBER = r"[-+]?\d*\.?\d+(?:[eE][-+]?\d+)?"
_LINEAR, _FACTOR = r"±|∓|\+/-|\+-|-\+|-/\+", r"x/|×/|\*/"
_WRITTEN = re.compile(
    rf"\s*(?P<name>[\w.]+)\s*=\s*(?P<value>{_NUMBER})"
    rf"(?:\s*(?P<how>{_LINEAR}|{_FACTOR})\s*(?P<width>{_NUMBER}))?\s*(?P<unit>[^\s].*?)?\s*"
)
_FACTORS = {"kPa": ("MPa", MPA_PER_KPA), "1/kPa": ("1/MPa", 1 / MPA_PER_KPA)}
_PRIOR_EXAMPLES = (
    "'superficial.C10=2±1 kPa', 'superficial.C10=2 x/ 1.5 kPa' for a factor, 'superficial.C10=population', or "
    "'deep.C10=FILE.json' of a cohort"
)
_POPULATION = "population"
_FIX_EXAMPLE = "'deep.D1=28 1/MPa'"


@dataclass(frozen=True)
class AskedParameters:
    """What is asked to be free and held: in a command line's words, and whole by a call.

    Parameters
    ----------
    identify : sequence of str
        Full names; empty for the law's own.
    priors : sequence of str
        ``NAME=CENTRE±SD UNIT``, ``NAME=MEDIAN x/ FACTOR UNIT``, or ``NAME=population`` for that of
        people (`legfem.inverse.population`), or ``NAME=FILE.json`` for a cohort's.
    fixed : sequence of str
        ``NAME=VALUE UNIT``.
    c10_bounds, c20_bounds : tuple of float, optional
        Of the deep tissue, kPa.
    given : mapping
        Parameters that were given whole, by name.
    numbers : mapping
        Values to hold, in the model's units.
    """

    identify: Sequence[str] = ()
    priors: Sequence[str] = ()
    fixed: Sequence[str] = ()
    c10_bounds: tuple[float, float] | None = None
    c20_bounds: tuple[float, float] | None = None
    given: Mapping[str, Parameter] = field(default_factory=dict)
    numbers: catalogue.Values = field(default_factory=dict)

    def parameters(self, nominal: catalogue.Values, people: str = CALF) -> tuple[Parameter, ...]:
        """Return what is free: what is to be identified, and as nuisances what has a prior only.

        Parameters
        ----------
        nominal
            The model's values as assumed.
        people
            Site of the population's table.

        Raises
        ------
        InputError
            For names, numbers or units that can't be.
        """
        names = dict.fromkeys(self.identify or (catalogue.DEEP_C10, catalogue.DEEP_C20))
        catalogue.check_known(names, nominal, Argument("identify"))
        free = {name: catalogue.parameter_of(name, nominal) for name in names}
        for text in self.priors:
            name, prior = read_prior(text, nominal, people)
            own = free.get(name) or replace(catalogue.parameter_of(name, nominal), role="nuisance")
            free[name] = replace(own, prior=prior)
        for option, name, least, bounds in (
            (Argument("c10_bounds"), catalogue.DEEP_C10, 1e-6, self.c10_bounds),
            (Argument("c20_bounds"), catalogue.DEEP_C20, 0.0, self.c20_bounds),
        ):
            if bounds is not None and name in free:
                free[name] = replace(free[name], bounds=_bounds(option, bounds, least))
        for name, one in self.given.items():
            known = free[name].prior if name in free else None
            free[name] = replace(one, prior=known or one.prior)
        return tuple(free.values())

    def renamed(self, tissue: str, known: str) -> "AskedParameters":
        """Return the same where a tissue is called by the name that the model has for it."""
        words = (self.identify, self.priors, self.fixed)
        identify, priors, fixed = ([re.sub(rf"^\s*{tissue}\.", f"{known}.", one) for one in each] for each in words)
        return replace(self, identify=identify, priors=priors, fixed=fixed)

    @property
    def names(self) -> set[str]:
        """Full names of all that is asked for, held or given a prior."""
        written = [*self.identify, *self.priors, *self.fixed]
        return {*(text.partition("=")[0].strip() for text in written), *self.given, *self.numbers}

    def held(self, nominal: catalogue.Values) -> dict[str, float]:
        """Return what is held, in the model's units.

        Raises
        ------
        InputError
            For names, numbers or units that can't be, and for what is to be identified as well.
        """
        held = {**dict(read_value(text, nominal) for text in self.fixed), **self.numbers}
        for name in held:
            if name in self.identify:
                raise InputError(Argument("fix"), name, "is to be identified as well", "leave one of them out")
        return held

    def laws(
        self, asked: str | None, parameters: Sequence[Parameter], given_c20: float | None, held: catalogue.Values
    ) -> list[catalogue.LawName]:
        """Return the laws to identify: ``both``, one, or without a word those of the names.

        Parameters
        ----------
        asked : str, optional
            ``both`` or a law's name.
        parameters : sequence of Parameter
            What is free.
        given_c20 : float, optional
            Of the deep tissue in the subject's folder (MPa).
        held : Mapping[str, float]
            Values that are held.
        """
        if asked is not None and asked != "both":
            return [name for name in catalogue.LAWS if name == asked]
        names = {one.name for one in parameters}
        if asked == "both" or (catalogue.DEEP_C20 in names and names - {catalogue.DEEP_C20, catalogue.DEEP_D2}):
            return list(catalogue.LAWS)
        stiffens = given_c20 is not None or catalogue.DEEP_C20 in (*names, *held)
        return ["reduced-polynomial" if stiffens else "neo-hookean"]


def read_prior(text: str, nominal: catalogue.Values, people: str = CALF) -> tuple[str, Prior]:
    """Return the name and the prior of ``NAME=CENTRE±SD UNIT``, in the model's unit.

    Raises
    ------
    InputError
        If it can't be read.
    """
    name, _, wanted = (part.strip() for part in text.partition("="))
    if wanted == _POPULATION:
        catalogue.check_known([name], nominal, Argument("prior"))
        if name not in TISSUES:
            raise InputError(
                Argument("prior"), name, "is not in the population's table", f"there is one of {' and '.join(TISSUES)}"
            )
        return name, population_prior(name, people)
    if wanted.endswith(".json"):
        catalogue.check_known([name], nominal, Argument("prior"))
        return name, cohort_prior(name, Path(wanted))
    found = _WRITTEN.fullmatch(text)
    if found is None or found["how"] is None:
        raise InputError(Argument("prior"), text, "can't be read", f"write {_PRIOR_EXAMPLES}")
    name, factor = _known(found, nominal, Argument("prior"), _PRIOR_EXAMPLES)
    centre, width = float(found["value"]), float(found["width"])
    logarithmic = re.fullmatch(_FACTOR, found["how"]) is not None
    if logarithmic and not (width > 1 and centre > 0):
        raise InputError(Argument("prior"), text, "is not a factor about a positive value", "give a factor over 1")
    if not logarithmic and not width > 0:
        raise InputError(Argument("prior"), text, "has no width", "give a standard deviation over 0")
    sd = math.log(width) if logarithmic else width * factor
    return name, Prior(centre * factor, sd, "log" if logarithmic else "linear", "--prior")


def deep_prior(texts: Sequence[str], people: str = CALF) -> Prior:
    """Return the prior (MPa) of the deep tissue's C10, the one that a diagnosis takes.

    Raises
    ------
    InputError
        If it can't be read, or is another's.
    """
    (name, prior), *others = (read_prior(text, {catalogue.DEEP_C10: 1.0}, people) for text in texts)
    if others or name != catalogue.DEEP_C10:
        raise InputError(
            Argument("prior"), ", ".join(texts), "can't be taken by a diagnosis", f"give one of {catalogue.DEEP_C10}"
        )
    if prior.scale != "log" and not 0 < prior.sd < prior.centre:
        raise InputError(Argument("prior"), texts[0], "reaches below zero", "give a median and a factor")
    return prior


def read_value(text: str, nominal: catalogue.Values) -> tuple[str, float]:
    """Return the name and the value of ``NAME=VALUE UNIT``, in the model's unit.

    Raises
    ------
    InputError
        If it can't be read.
    """
    found = _WRITTEN.fullmatch(text)
    if found is None or found["how"] is not None:
        raise InputError(Argument("fix"), text, "can't be read", f"write {_FIX_EXAMPLE}")
    name, factor = _known(found, nominal, Argument("fix"), _FIX_EXAMPLE)
    value = float(found["value"]) * factor
    catalogue.check_held(Argument("fix"), text, name, value)
    return name, value


def _known(found: re.Match[str], nominal: catalogue.Values, source: Argument, example: str) -> tuple[str, float]:
    """Return the name, and the factor from the unit as written to the model's."""
    name, unit = found["name"], found["unit"]
    catalogue.check_known([name], nominal, source)
    wanted = catalogue.unit_of(name)
    own, factor = _FACTORS.get(unit or "-", (unit or "-", 1.0))
    if own != wanted:
        others = " or ".join([wanted, *(u for u, (o, _) in _FACTORS.items() if o == wanted)])
        raise InputError(
            source, name, f"has the unit {unit!r}" if unit else "has no unit", f"give it in {others}, as in {example}"
        )
    return name, factor


def _bounds(option: Argument, bounds: tuple[float, float], least: float) -> tuple[float, float]:
    low, high = bounds
    if not least <= low < high < float("inf"):
        remedy = "give two values in kPa, the lower one first; C10 must be positive"
        raise InputError(option, f"{low:g} {high:g}", "is not a range of stiffnesses", remedy)
    return kpa_to_mpa(low), kpa_to_mpa(high)
