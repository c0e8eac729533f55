"""
A leg in a compression stocking
===============================

The pressure of a stocking is its tension times the leg's curvature (Laplace's law), of the leg as the stocking shapes it: both are
found together. Leg 1 of those that come with legfem (**simulated**), 40 mm of it, at a given stiffness, with few tetrahedra: a
quick look at the pressures, not a result. `lf.stocking(lf.load_leg("1"))` identifies the stiffness from both scans first.
"""

import matplotlib.pyplot as plt
import numpy as np

import legfem as lf
from legfem.experiments.compression import CompressionSettings
from legfem.mechanics.materials import NeoHookean
from legfem.meshing.leg_sizes import SolidMeshSettings
from legfem.stockings.equilibrium import EquilibriumSolver, LegModel3D
from legfem.stockings.fabric import stocking_load

leg = lf.load_leg("1")
levels = leg.bare.levels
middle = levels[np.abs(levels - levels.mean()) <= 20.0]
shape = leg.bare.at_levels(middle)
laws = {"deep": NeoHookean(2.5e-3, 2.0), "superficial": NeoHookean(6e-3, 2.0)}  # MPa, 1/MPa
mesh = SolidMeshSettings(skin_size=12, inside_size=16, bone_size=12)
model = LegModel3D(shape, laws, mesh, CompressionSettings(ends="held"))
worn = EquilibriumSolver(model, leg.stocking).solve()
print(f"{model.compression.spaces.unknowns} unknowns, {len(worn.changes)} states, {worn.converged=}")

# %%
# Round the leg at mid-height: the bare leg's curvature would press where it is sharpest; the leg gives way.

bare = stocking_load(shape, leg.stocking)
row = len(middle) // 2
skin = shape.contours["skin"][row]
angle = np.degrees(np.arctan2(*(skin - skin.mean(axis=0)).T[::-1]))
order = np.argsort(angle)
mmHg = 7500.6  # of a MPa
fig, axes = plt.subplots(figsize=(6, 3.6), layout="constrained")
axes.plot(angle[order], mmHg * bare.pressure[row][order], "--", label="on the bare shape")
axes.plot(angle[order], mmHg * worn.load.pressure[row][order], label="in equilibrium")
axes.set(xlabel="angle round the leg (degrees)", ylabel="pressure on the skin (mmHg)")
axes.legend(frameon=False)
plt.show()
