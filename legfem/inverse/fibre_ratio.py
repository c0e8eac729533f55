r"""Fibres of a tissue: their ratio as a parameter.

The ratio of the shear moduli along and across, :math:`r = \mu_L / \mu_T`, stands for both numbers
of `legfem.mechanics.terms.Fibres`: :math:`\mu_L - \mu_T = 2 C_{10} (r - 1)`, and the extension's is
four times that (`Fibres.of_ratio`). So the force F stays in proportion to the stiffnesses at a
given ratio, and with S the sum of its derivatives by shear and, four times, by extension,

.. math:: \frac{\partial F}{\partial r} = 2 C_{10} S, \qquad
          \left.\frac{\partial F}{\partial C_{10}}\right|_r
          = \left.\frac{\partial F}{\partial C_{10}}\right|_{\mu_L - \mu_T} + 2 (r - 1) S.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.common.wording import Argument, Remedy
from legfem.inverse.catalogue import DEEP_RATIO, RATIO
from legfem.mechanics.terms import Fibres
from legfem.solve.path import ForceCurve

USUAL_RATIO = 2.0
"""At which a test is solved before anything is known."""
SHAPE_SD_OF_FIBRES = 1.0
"""Of a curve's rise over its depth, relative, where nothing but its bend tells fibres from a
stiffer tissue: real fibres, slack at first, bend it by tens of percent otherwise than the term has
it."""


def ratio_of(tissue: str) -> str:
    """Return the full name of a tissue's ratio."""
    return f"{tissue}.{RATIO}"


def check_in_plane(names: Collection[str]) -> None:
    """Check that a section in plane strain knows of all that is named.

    Raises
    ------
    InputError
        If the leg's fibres are, which do no work there.
    """
    if DEEP_RATIO in names:
        raise InputError(
            Argument("identify"),
            DEEP_RATIO,
            "fibres along the leg do no work in plane strain",
            Remedy("solve the leg in 3D: ", Argument("model", "3d")),
        )


def moduli(values: Mapping[str, float], tissues: Collection[str]) -> dict[str, float]:
    """Return shear and extension (MPa) of tissues whose C10 and ratio are among values."""
    found = dict[str, float]()
    for tissue in tissues:
        c10, ratio = values[f"{tissue}.C10"], values[ratio_of(tissue)]
        found |= Fibres.of_ratio(tissue, c10, ratio).parameters
    return found


def moduli_needed(tissues: Collection[str], sensitivities: Collection[str]) -> list[str]:
    """Return by what to differentiate besides, for derivatives by C10 and ratios of tissues."""
    return [
        name
        for tissue in tissues
        if {f"{tissue}.C10", ratio_of(tissue)} & set(sensitivities)
        for name in Fibres(tissue).parameters
    ]


def at_ratios(
    curve: ForceCurve, values: Mapping[str, float], tissues: Collection[str], sensitivities: Sequence[str]
) -> ForceCurve:
    """Return a curve with derivatives by ratios, and by C10 along which the ratio stays.

    Parameters
    ----------
    curve
        With the derivatives of `moduli_needed`.
    values
        C10 and ratio of every tissue, by full name.
    tissues
        Those that have fibres.
    sensitivities
        Full names that were asked for.
    """
    return replace(
        curve,
        sensitivities=_by_ratios(curve.sensitivities, values, tissues, sensitivities),
        channel_sensitivities={
            name: _by_ratios(by, values, tissues, sensitivities) for name, by in curve.channel_sensitivities.items()
        },
    )


def _by_ratios(
    found: Mapping[str, FloatArray], values: Mapping[str, float], tissues: Collection[str], sensitivities: Sequence[str]
) -> dict[str, FloatArray]:
    """Return one reading's derivatives by ratios, and by C10 along which the ratio stays."""
    by = dict(found)
    for tissue in tissues:
        c10, ratio = f"{tissue}.C10", ratio_of(tissue)
        names = Fibres(tissue).parameters
        if not set(names) <= set(by):
            continue
        # Of a C10 of a half: by the shear, and the extension with it.
        through = Fibres.slope_by_ratio(tissue, 0.5, {name: by[name] for name in names})
        by = {name: each for name, each in by.items() if name in sensitivities or name not in names}
        if c10 in sensitivities:
            by[c10] = by[c10] + 2 * (values[ratio] - 1) * through
        if ratio in sensitivities:
            by[ratio] = 2 * values[c10] * through
    return by
