"""
Laws of soft tissue
===================

Four laws with the same stiffness at small strain, pulled and pressed: they differ only where tissue is stretched. That is
why a recording has to go deep enough before it can tell C20 from C10. Closed forms, nothing is solved.
"""

import matplotlib.pyplot as plt

from legfem.experiments.bodies import UniaxialSpecimen
from legfem.experiments.homogeneous import HomogeneousTest
from legfem.mechanics.materials import ExponentialStiffening, NeoHookean, ReducedPolynomial, Yeoh

C10, D1 = 0.7e-3, 28.0  # MPa, 1/MPa
laws = {
    "neo-Hookean": NeoHookean(C10, D1),
    "reduced polynomial, C20 = 0.8 kPa": ReducedPolynomial(C10, D1, C20=0.8e-3),
    "Yeoh, also C30 = 2 kPa": Yeoh(C10, D1, C20=0.8e-3, C30=2e-3),
    "exponential": ExponentialStiffening(C10, D1, C20=0.0, stiffening=0.2e-3, exponent=3.0),
}

# %%
# A bar of 10 mm and 100 mm2, compressed by 4 mm, then pulled as far. The force over the area is the nominal stress.

fig, axes = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
for pulled, panel in zip(("compression", "tension"), axes, strict=True):
    for name, law in laws.items():
        curve = HomogeneousTest(UniaxialSpecimen(10.0, 100.0, pulled), law).solve(depth=4.0).curve
        panel.plot(curve.displacement / 10, 1e3 * curve.force / 100, label=name)
    panel.set(xlabel=f"nominal strain in {pulled}", ylabel="nominal stress (kPa)")
axes[0].legend(frameon=False)
plt.show()
