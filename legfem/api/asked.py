"""What a call of the front door asks to be free and held."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from numbers import Real
from typing import Any, Self

from legfem.api import loading
from legfem.common.wording import Argument
from legfem.inverse.catalogue import Values, check_held
from legfem.inverse.parameter import Parameter
from legfem.inverse.parse_parameters import ParameterTexts


@dataclass(frozen=True)
class AskedParameters:
    """What a call asks to be free and held: names and texts as the command has them, parameters and numbers."""

    texts: ParameterTexts
    given: Mapping[str, Parameter]
    """Parameters that were given whole, by name."""
    numbers: Values
    """Values to hold, in the model's units."""

    @classmethod
    def of(cls, identify: Any, prior: Any, fix: Any, c10_bounds: Any, c20_bounds: Any) -> Self:
        """What arguments of `identify` ask for.

        Raises
        ------
        InputError
            If one is of another kind than `identify` says, or something is there twice.
        """
        listed = "a list of full names or of legfem.inverse.parameter.Parameter"
        if not isinstance(identify, list | tuple | None):
            raise loading.of_another_kind("identify", identify, listed)
        if identify is not None and not identify:
            raise loading.wrong("identify", "[]", "nothing is left to identify", "name a parameter")
        names, given = list[str](), dict[str, Parameter]()
        for one in identify or ():
            if not isinstance(one, str | Parameter):
                raise loading.of_another_kind("identify", one, listed)
            name = one if isinstance(one, str) else one.name
            if name in names or name in given:
                raise loading.wrong("identify", name, "is there twice", "give it once")
            if not isinstance(one, str):
                given[name] = one
            if isinstance(one, str) or one.role == "identified":
                names.append(name)
        numbers, texts = (fix, ()) if isinstance(fix, Mapping) else ({}, fix)
        if not isinstance(texts, list | tuple) or not all(isinstance(one, str) for one in texts):
            raise loading.of_another_kind(
                "fix", fix, "values by full name, as {'deep.D1': 28.0}, or texts, as 'deep.D1=28 1/MPa'"
            )
        for name, value in numbers.items():
            # Without its term of (J - 1)^4 a law has an infinite D2.
            endless = value == math.inf and str(name).endswith(".D2")
            if not isinstance(value, Real) or not (math.isfinite(value) or endless):
                remedy = "give a number in MPa, 1/MPa, N or mm, without its unit"
                raise loading.wrong("fix", str(name), f"{value!r} is not a value", remedy)
            check_held(Argument("fix"), f"{name}={value:g}", str(name), float(value))
            if name in names:
                raise loading.wrong("fix", name, "is to be identified as well", "leave one of them out")
        return cls(ParameterTexts(names, prior, texts, c10_bounds, c20_bounds), given, numbers)

    @property
    def names(self) -> set[str]:
        """Full names of all that is asked for, held or given a prior."""
        return {*self.texts.names, *self.given, *self.numbers}

    def parameters(self, nominal: Values) -> tuple[Parameter, ...]:
        """What is free in a leg whose values are assumed to be ``nominal``, with bounds that suit legs."""
        free = {one.name: one for one in self.texts.parameters(nominal)}
        for name, one in self.given.items():
            known = free[name].prior if name in free else None
            free[name] = replace(one, prior=known or one.prior)
        return tuple(free.values())

    def held(self, nominal: Values) -> dict[str, float]:
        """What is held, in the model's units."""
        return {**self.texts.held(nominal), **self.numbers}
