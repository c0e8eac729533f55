"""
Tissue that relaxes
===================

Pressed at a rate and held, a tissue's force fades. A model is a sum of terms, and relaxation is one more of them: a ball on a
layer with one Prony branch, pressed at three rates and held. A coarse mesh.
"""

import matplotlib.pyplot as plt

from legfem.experiments.axisymmetric import AxisymmetricSettings, BallIndentation
from legfem.experiments.bodies import BallOnLayer
from legfem.mechanics.materials import NeoHookean
from legfem.mechanics.terms import Viscoelasticity
from legfem.meshing.structured import MeridianMeshSettings
from legfem.solve.protocol import Protocol

law = NeoHookean(2e-3, 0.2)  # C10 in MPa, D1 in 1/MPa
branch = Viscoelasticity("deep", law, ratio=0.8, relaxation_time=5.0)
coarse = AxisymmetricSettings(MeridianMeshSettings(1.5))
test = BallIndentation(BallOnLayer(12.0, layer_radius=20.0), law, coarse, mechanisms=[branch])

# %%
# What lasts is the law as it is: all three end at one force.

fig, (over_time, over_way) = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
for rate in (4.0, 0.4, 0.04):  # mm/s
    path = test.solve(None, Protocol.ramp_and_hold(2.0, rate, hold=30.0)).path
    over_time.plot(path.time - 2.0 / rate, 1e3 * path.force, label=f"{rate:g} mm/s")
    over_way.plot(path.displacement, 1e3 * path.force)
    print(f"{rate:g} mm/s: {1e3 * path.force.max():.1f} mN, then {1e3 * path.force[-1]:.1f} mN")
over_time.set(xlabel="time after the ramp (s)", ylabel="force (mN)", xlim=(-10, 30))
over_time.legend(frameon=False)
over_way.set(xlabel="displacement (mm)")
plt.show()
