"""
A ball on a layer, against closed forms
=======================================

On a thick layer a ball follows Hertz; on a thin one bonded to its base the force is larger, by the series of Dimitriadis et
al., Biophys. J. 82 (2002) 2798. Both hold at small depth without friction; legfem goes on where they end.
"""

import matplotlib.pyplot as plt
import numpy as np

from legfem.experiments.axisymmetric import AxisymmetricSettings, BallIndentation
from legfem.experiments.bodies import BallOnLayer
from legfem.mechanics.contact import ContactSettings
from legfem.mechanics.materials import NeoHookean
from legfem.meshing.structured import MeridianMeshSettings
from legfem.solve.settings import NewtonSettings, StepSettings

C10, radius = 5e-3, 5.0  # MPa, mm
law = NeoHookean(C10, 1e-3 / C10)  # nearly incompressible
settings = AxisymmetricSettings(
    MeridianMeshSettings(0.1, far_size=20.0),
    ContactSettings(tangential="frictionless", stiffness=4e3, onset=1e-4),
    NewtonSettings(absolute_tolerance=1e-10),  # forces are of millinewtons at first
    steps=StepSettings(first=0.05, largest=0.1),
)

# %%
# Forces over Hertz' own, :math:`F = \frac{16}{9} E \sqrt{R}\, d^{3/2}` with :math:`E = 6\, C_{10}`.

fig, axes = plt.subplots(figsize=(6, 4), layout="constrained")
for thickness, colour in ((60.0, "C0"), (5.0, "C1")):
    test = BallOnLayer(thickness, radius, max(8 * thickness, 40.0), ball="frictionless")
    curve = BallIndentation(test, law, settings).solve(depth=0.5).curve
    d = curve.displacement[curve.displacement >= 0.1]
    hertz = 16 / 9 * 6 * C10 * radius**0.5 * d**1.5
    x = np.sqrt(radius * d) / thickness
    series = 1 + 1.133 * x + 1.283 * x**2 + 0.769 * x**3 + 0.0975 * x**4
    axes.plot(d, curve(d) / hertz, color=colour, label=f"legfem, {thickness:g} mm")
    axes.plot(d, series, "--", color=colour, label=f"closed form, {thickness:g} mm")
    print(f"{thickness:g} mm: {curve(d[0]) / hertz[0] / series[0] - 1:+.1%} at {d[0]:.2f} mm")
axes.set(xlabel="displacement (mm)", ylabel="force over Hertz' force")
axes.legend(frameon=False)
plt.show()
