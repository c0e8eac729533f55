"""
A leg's section and its mesh
============================

A subject is a folder: contours, where the cylinder is aimed, recordings. Here is subject 3, which comes with legfem. It is
**reconstructed**: drawn to resemble a published study; no leg was measured. The mesh is fine where the cylinder will press.
"""

import matplotlib.pyplot as plt

import legfem as lf
from legfem.geometry.section import girth
from legfem.legs.finite_element_models import plane_strain_test

leg = lf.load_subject("3")
test = plane_strain_test(leg)
meshed = test.section_mesh
print(f"{leg.title}, {leg.origin}: girth {girth(leg.section):.0f} mm")
print(f"worst element: {min(meshed.quality.minimum.values()):.2f} of an ideal one's 1")

# %%
# The arrow is the line of travel, from first touch.

points, triangles = meshed.mesh.geometry.x, meshed.mesh.geometry.dofmap
touch, way = meshed.touch, 30 * meshed.direction
fig, axes = plt.subplots(figsize=(6, 6), layout="constrained")
axes.triplot(points[:, 0], points[:, 1], triangles, color="0.6", lw=0.4)
for part, colour in zip(("skin", "fascia", "tibia", "fibula"), "krbb", strict=True):
    axes.fill(*leg.section.contour(part).T, fill=False, edgecolor=colour, label=part)
axes.annotate("", touch + way, touch, arrowprops={"arrowstyle": "->", "lw": 2})
axes.set(aspect="equal", xlabel="x (mm)", ylabel="y (mm)")
axes.legend(frameon=False, ncols=4, loc="lower center", bbox_to_anchor=(0.5, 1.0))
plt.show()
