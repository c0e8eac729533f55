"""Strain energies per unit reference volume, as frozen dataclasses with checked parameters."""

from legfem.mechanics.materials.hyperelastic import Hyperelastic, NeoHookean, ReducedPolynomial
from legfem.mechanics.materials.stiffening import ExponentialStiffening, Yeoh

__all__ = ["ExponentialStiffening", "Hyperelastic", "NeoHookean", "ReducedPolynomial", "Yeoh"]
