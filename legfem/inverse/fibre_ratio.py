r"""Fibres of a tissue: their ratio as a parameter.

The ratio of the shear moduli along and across, :math:`r = \mu_L / \mu_T`, stands for both numbers
of `legfem.mechanics.terms.Fibres`: :math:`\mu_L - \mu_T = 2 C_{10} (r - 1)`, and the extension's is
four times that (`Fibres.of_ratio`). So the force F stays in proportion to the stiffnesses at a
given ratio, and with S the sum of its derivatives by shear and, four times, by extension,

.. math:: \frac{\partial F}{\partial r} = 2 C_{10} S, \qquad
          \left.\frac{\partial F}{\partial C_{10}}\right|_r
          = \left.\frac{\partial F}{\partial C_{10}}\right|_{\mu_L - \mu_T} + 2 (r - 1) S.
"""

from collections.abc import Collection, Mapping

from legfem.common.errors import Argument, InputError, Remedy
from legfem.inverse.catalogue import DEEP_RATIO, RATIO
from legfem.mechanics.terms import Fibres

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
        remedy = Remedy("solve the leg in 3D: ", Argument("model", "3d"))
        raise InputError(Argument("identify"), DEEP_RATIO, "fibres along the leg do no work in plane strain", remedy)


def moduli(values: Mapping[str, float], tissues: Collection[str]) -> dict[str, float]:
    """Return shear and extension (MPa) of tissues whose C10 and ratio are among values."""
    found = dict[str, float]()
    for tissue in tissues:
        c10, ratio = values[f"{tissue}.C10"], values[ratio_of(tissue)]
        found |= Fibres.of_ratio(tissue, c10, ratio).parameters
    return found


def slopes_at_ratio(name: str, values: Mapping[str, float], tissues: Collection[str]) -> dict[str, float]:
    """Return the derivatives of the model's parameters by one that is asked for: of C10 at the same ratio, or a ratio.

    Parameters
    ----------
    name
        Full name of the parameter.
    values
        C10 and ratio of every tissue, by full name.
    tissues
        Those that have fibres.
    """
    tissue, _, key = name.rpartition(".")
    found = {} if key == RATIO else {name: 1.0}
    if tissue in tissues and key in ("C10", RATIO):
        at = (1.0, values[ratio_of(tissue)]) if key == "C10" else (values[f"{tissue}.C10"], 2.0)
        found |= Fibres.of_ratio(tissue, *at).parameters
    return found
