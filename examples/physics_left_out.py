"""
Physics that a model leaves out
===============================

A mechanism is a term added to the model, or one of its parts exchanged. Here the base model of a leg, the same with a dermis
(which both papers leave out), with a fascia under tension, and with a skin that slides along the cylinder: what each would do to
a recording. A refit of C10 hides most of it; what is left has another shape, and by that a diagnosis knows it. Coarse meshes.
"""

import matplotlib.pyplot as plt
import numpy as np

import legfem as lf
from legfem.experiments.plane_strain import PlaneStrainSettings
from legfem.legs.finite_element_models import plane_strain_test
from legfem.mechanics.contact import ContactSettings
from legfem.mechanics.terms import Prestress
from legfem.mechanics.terms.membranes import Dermis
from legfem.meshing.section import SectionMeshSettings

leg = lf.load_subject("3")
mesh = SectionMeshSettings().refined(0.5)
tape = PlaneStrainSettings(mesh)
slippery = PlaneStrainSettings(mesh, ContactSettings(tangential="frictionless"))
of = plane_strain_test
tests = {
    "base model": of(leg, tape),
    "dermis of 0.1 N/mm": of(leg, tape, mechanisms=[Dermis(0.1)]),
    "fascia under 0.02 MPa": of(leg, tape, mechanisms=[Prestress(leg.section.fascia, 0.02)]),
    "no friction": of(leg, slippery),
}
stiffness = {"deep.C10": 0.70e-3, "deep.C20": 0.80e-3}  # MPa
depth = np.linspace(1.0, 15.0, 29)
curves = {name: test.solve(stiffness, depth=15.0, sensitivities=("deep.C10",)).curve for name, test in tests.items()}

# %%
# On the left what each changes; on the right what is left of it once C10 is fitted anew, to first order.

base = curves.pop("base model")
slope = base.sensitivity("deep.C10", depth)
fig, panels = plt.subplots(1, 2, figsize=(9, 3.6), sharey=True, layout="constrained")
for name, curve in curves.items():
    change = curve(depth) - base(depth)
    left = change - slope * (slope @ change) / (slope @ slope)
    panels[0].plot(depth, change, label=name)
    panels[1].plot(depth, left)
    print(f"{name}: {change[-1]:+.3f} N at 15 mm, {np.abs(left).max():.3f} N at most after a refit")
panels[0].set(xlabel="displacement (mm)", ylabel="change of the force (N)", title="as it is")
panels[1].set(xlabel="displacement (mm)", title="after a refit of C10")
panels[0].legend(frameon=False)
plt.show()
