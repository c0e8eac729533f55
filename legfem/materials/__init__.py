"""Strain energies per unit reference volume, as frozen dataclasses with checked parameters."""

from legfem.materials.hyperelastic import Hyperelastic, NeoHookean, ReducedPolynomial

__all__ = ["Hyperelastic", "NeoHookean", "ReducedPolynomial"]
