"""The stiffnesses that are identified, and what is known of them beforehand."""

from __future__ import annotations

from collections.abc import Iterable

from legfem.common.units import kpa_to_mpa
from legfem.inverse.parameter import Parameter, Priors
from legfem.legs.elastography import ShearModulus, elastography_priors
from legfem.stocking.leg_model import PARAMETERS

BOUNDS = (kpa_to_mpa(0.1), kpa_to_mpa(100.0))
"""Of a search (MPa)."""


def stiffness_priors(moduli: Iterable[ShearModulus] = ()) -> Priors:
    """Return what shear waves say of `PARAMETERS` (MPa); nothing without them."""
    known = elastography_priors(moduli)
    return Priors(tuple(Parameter(name, "MPa", BOUNDS, known.get(name), scale="log") for name in PARAMETERS))
