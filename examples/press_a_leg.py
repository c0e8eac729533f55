"""
Press a leg, and see what its force depends on
==============================================

One solution gives the force and its exact derivative by any parameter of the model. Over the depth they tell which stiffness
a recording can show at all: where two of these curves have one shape, no recording tells those two parameters apart.
A coarse mesh, since this is a quick look.
"""

import matplotlib.pyplot as plt
import numpy as np

import legfem as lf
from legfem.experiments.plane_strain import PlaneStrainSettings
from legfem.legs.finite_element_models import plane_strain_test
from legfem.meshing.section import SectionMeshSettings

leg = lf.load_subject("3")
coarse = PlaneStrainSettings(SectionMeshSettings().refined(0.5))
test = plane_strain_test(leg, coarse)
names = ("deep.C10", "deep.C20", "superficial.C10", "fascia.C10")
stiffness = {"deep.C10": 0.70e-3, "deep.C20": 0.80e-3}  # MPa
solved = test.solve(stiffness, depth=20.0, sensitivities=names)
print(solved.report)

# %%
# A sensitivity against what solving twice gives.

depth = np.linspace(1.0, 20.0, 39)
force = solved.curve(depth)
step = 1e-3
higher = test.solve({**stiffness, "deep.C10": stiffness["deep.C10"] * (1 + step)}, depth=20.0)
difference = (higher.curve(depth[-1]) - force[-1]) / (step * stiffness["deep.C10"])
exact = solved.curve.sensitivity("deep.C10", depth[-1])
print(f"dF/dC10 at 20 mm: {exact:.1f} N/MPa exactly, {difference:.1f} by a difference")

# %%
# As shares: how many percent the force rises when a parameter rises by one percent.

fig, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(6, 6), layout="constrained")
above.plot(depth, force, "k")
above.set(ylabel="force (N)", title="subject 3, reconstructed")
for name in names:
    slope = solved.curve.sensitivity(name, depth)
    below.plot(depth, slope * solved.parameters[name] / force, label=name)
below.set(xlabel="displacement (mm)", ylabel="% of force per % of parameter")
below.legend(frameon=False)
plt.show()
