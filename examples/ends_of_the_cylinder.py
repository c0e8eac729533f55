"""
The ends of the cylinder
========================

Plane strain takes the cylinder for endless. A real one is short, and the tissue beyond its ends helps to bear it: the force a
length is larger by 1 - P(d) (Eq. 3 of Frauziols et al.). The table that comes with legfem was computed with the idealised leg
in 3D; nothing is solved here.
"""

import matplotlib.pyplot as plt
import numpy as np

from legfem.inverse.correction import read_correction
from legfem.legs.correction_of_leg import LEGS, REFERENCE, read_leg_corrections

reference = read_correction(REFERENCE)
sizes = read_leg_corrections(LEGS)
depth = np.linspace(0.5, 20.0, 40)
c10, c20 = np.array(1.0), np.array(0.0)  # kPa

# %%
# Legs of three girths, and how far off P is said to be: most of it since nobody knows a leg's effective length.

fig, axes = plt.subplots(figsize=(6, 4), layout="constrained")
for girth in (300, 360, 420):
    radius = girth / (2 * np.pi)
    leg = sizes.of_leg(reference, radius, 0.55 * radius)
    factor = leg.factor(depth, c10, c20)
    error = 1.96 * leg.standard_deviation(depth)
    axes.plot(depth, factor, label=f"girth {girth} mm")
    axes.fill_between(depth, factor - error, factor + error, alpha=0.15)
axes.set(xlabel="displacement (mm)", ylabel="force in 3D over plane strain, 1 - P(d)")
axes.legend(frameon=False)
plt.show()
