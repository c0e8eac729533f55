"""What shear-wave elastography of a person says of C10 beforehand."""

from __future__ import annotations

from collections.abc import Iterable

from legfem.inverse.parameter import Prior
from legfem.legs.elastography import ShearModulus


def elastography_priors(moduli: Iterable[ShearModulus]) -> dict[str, Prior]:
    r"""Return priors of stiffnesses (MPa), by full name.

    At small strain the shear modulus of every law here is :math:`2 C_{10}`, of muscle with fibres
    that across them.
    """
    return {
        f"{one.tissue}.C10": Prior(one.C10, one.sd / 2, "linear", one.source)
        for one in moduli
        if one.tissue == "superficial" or one.plane == "across"
    }
