"""The laws of a leg's tissues, as a subject's file has them."""

from __future__ import annotations

import math
from dataclasses import dataclass

from legfem.mechanics.materials import Hyperelastic, NeoHookean, ReducedPolynomial
from legfem.subjects.subject import Subject, TissueParameters


@dataclass(frozen=True)
class Tissues:
    """The laws of the three tissues (MPa, 1/MPa)."""

    deep: Hyperelastic
    superficial: Hyperelastic
    fascia: Hyperelastic


def tissues_of(subject: Subject) -> Tissues:
    """Return the laws of a subject's tissues; what is to be identified stands at 1 kPa.

    The deep tissue is a reduced polynomial: with ``C20 = 0`` and ``D2 = inf`` it is neo-Hookean.
    """
    given = subject.tissues
    deep = given["deep"]
    return Tissues(
        deep=ReducedPolynomial(
            C10=1e-3 if deep.C10 is None else deep.C10,
            D1=deep.D1,
            C20=deep.C20 or 0.0,
            D2=math.inf if deep.D2 is None else deep.D2,
        ),
        superficial=_law(given["superficial"]),
        fascia=_law(given["fascia"]),
    )


def _law(given: TissueParameters) -> Hyperelastic:
    if given.C10 is None:
        raise ValueError("only the deep tissue's stiffness is identified")
    if given.law == "neo-hookean":
        return NeoHookean(given.C10, given.D1)
    second = math.inf if given.D2 is None else given.D2
    return ReducedPolynomial(given.C10, given.D1, given.C20 or 0.0, second)
