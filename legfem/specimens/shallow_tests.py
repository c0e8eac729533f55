"""Numerical settings of tests of a few millimetres, as labs make them."""

from dataclasses import replace

from legfem.experiments.axisymmetric import AxisymmetricSettings
from legfem.experiments.bodies import Faces
from legfem.mechanics.contact import ContactSettings
from legfem.meshing.structured import MeridianMeshSettings
from legfem.solve.settings import StepSettings

_STEPS, _ELEMENTS = 20, 5
"""Of a shallow test: steps to its depth, and elements across half of its contact."""


def settings_to(depth: float) -> AxisymmetricSettings:
    """Return settings for a depth (mm)."""
    usual = AxisymmetricSettings()
    # The same ones at any stiffness: forces are compared and differentiated.
    steps = StepSettings.regular(
        first=min(usual.steps.first, depth / _STEPS), largest=min(usual.steps.largest, depth / 10)
    )
    # A shallow test's forces are of millinewtons, which the volume of large elements rounds.
    newton = replace(usual.newton, absolute_tolerance=1e-10)
    return replace(usual, steps=steps, newton=newton)


def onset_to(faces: Faces, depth: float) -> ContactSettings:
    """Return a contact that sets on well within a depth (mm)."""
    usual = ContactSettings(tangential=faces, stiffness=4000.0)
    return replace(usual, onset=min(usual.onset, 2e-3 * depth))


def round_indenter(radius: float, faces: Faces, depth: float, usual_size: float) -> AxisymmetricSettings:
    """Return settings for a round indenter: elements resolve the contact, its onset the depth (mm)."""
    size = min(usual_size, (radius * depth) ** 0.5 / _ELEMENTS)
    return replace(settings_to(depth), mesh=MeridianMeshSettings(size), contact=onset_to(faces, depth))
