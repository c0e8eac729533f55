"""The two laws of the deep tissue, as identification sees them."""

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

from legfem.common.errors import InputError
from legfem.inverse.catalogue import (
    DEEP_C10,
    DEEP_C20,
    DEEP_D2,
    DEEP_RATIO,
    IdentifiedLaw,
    LawName,
    Values,
    check_known,
    parameter_of,
    within_prior,
)
from legfem.inverse.instrument import INSTRUMENT
from legfem.inverse.parameter import Parameter, Prior
from legfem.legs.elastography import elastography_priors
from legfem.legs.subject import Subject

_OF_POLYNOMIAL_ONLY = (DEEP_C20, DEEP_D2)


def default_parameters(nominal: Values) -> tuple[Parameter, ...]:
    """Return C10 and C20 of the deep tissue; a law takes what it has."""
    return tuple(parameter_of(name, nominal) for name in (DEEP_C10, DEEP_C20))


def law_of(
    name: LawName,
    subject: Subject,
    nominal: Values,
    parameters: Sequence[Parameter] | None = None,
    fixed: Values | None = None,
) -> IdentifiedLaw:
    """Return a law with what the subject's folder assumes.

    Parameters
    ----------
    name : str
        Of the law.
    subject : Subject
        Whose deep tissue it is.
    nominal : Mapping[str, float]
        The model's values as assumed.
    parameters : sequence of Parameter, optional
        Free ones, of which the law takes those that it has, and those of role "fixed" not; C10 and
        C20 of the deep tissue without them. What elastography of the subject says of a stiffness,
        and the folder of its fibres' ratio, is its prior unless it has one.
    fixed : Mapping[str, float], optional
        Held in place of the assumed values.

    Raises
    ------
    InputError
        For a name that the model hasn't, or a stiffness that is neither free nor given.
    """
    given = default_parameters(nominal) if parameters is None else parameters
    held = dict(fixed or {})
    given = _with_what_is_known(given, subject, nominal)
    check_known([one.name for one in given], nominal, "--identify")
    check_known(list(held), nominal, "--fix")
    without = _OF_POLYNOMIAL_ONLY if name == "neo-hookean" else ()
    free = tuple(
        within_prior(one)
        for one in sorted(given, key=lambda one: one.name in INSTRUMENT)
        if one.role != "fixed" and one.name not in (*without, *held)
    )
    if not free:
        raise InputError("--identify", name, "nothing is left to identify", "name a parameter")
    deep = subject.tissues["deep"]
    if name == "neo-hookean":
        own = {DEEP_C10: deep.C10, DEEP_C20: 0.0, DEEP_D2: math.inf}
        held = {key: value for key, value in held.items() if key not in without}
    else:
        own = {DEEP_C10: deep.C10, DEEP_C20: deep.C20, DEEP_D2: deep.D2 or math.inf}
    names = {one.name for one in free}
    for key, value in own.items():
        if key in names or key in held:
            continue
        if value is None:
            raise InputError(
                "--identify",
                key,
                f"is neither identified nor given for the {name} law",
                f"add --identify {key}, or --fix '{key}=VALUE kPa'",
            )
        held[key] = value
    return IdentifiedLaw(name, free, held, nominal)


def _with_what_is_known(given: Sequence[Parameter], subject: Subject, nominal: Values) -> list[Parameter]:
    """Return parameters with what was measured of them, and what was measured of others."""
    known = {one.name: one for one in given}
    priors, fibres = elastography_priors(subject.elastography), subject.fibres
    if DEEP_RATIO in nominal and fibres is not None and fibres.sd:
        priors[DEEP_RATIO] = Prior(fibres.value, fibres.sd, "linear", fibres.source)
    for name, prior in priors.items():
        own = known.get(name) or replace(parameter_of(name, nominal), role="nuisance")
        known[name] = replace(own, prior=own.prior or prior)
    return list(known.values())


def laws_of(
    subject: Subject,
    names: Sequence[LawName],
    nominal: Values,
    parameters: Sequence[Parameter] | None = None,
    fixed: Values | None = None,
) -> dict[LawName, IdentifiedLaw]:
    """Return the laws asked for, and the neo-Hookean one if it is the limit of another.

    Raises
    ------
    InputError
        For a name that the model hasn't, or a stiffness that is neither free nor given.
    """
    laws = {name: law_of(name, subject, nominal, parameters, fixed) for name in names}
    stiffening = any(law.index(DEEP_C20) is not None for law in laws.values())
    if stiffening and "neo-hookean" not in laws:
        with suppress(InputError):
            laws["neo-hookean"] = law_of("neo-hookean", subject, nominal, parameters, fixed)
    return laws
