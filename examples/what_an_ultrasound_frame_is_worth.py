"""
What an ultrasound frame is worth
=================================

Force alone can't tell a soft muscle under a stiff fat from a stiff muscle under a soft fat. The thickness of the fat while the
cylinder presses can. Here a leg with 12 mm of fat, which is 0.4 times as stiff as its folder says, is pressed (simulated, on a mesh
twice as fine as that it is identified with), and read by force alone, with one frame of ultrasound, with three, and with one a
second.
"""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np

import legfem as lf
from legfem.channels.kinds import CHANNELS
from legfem.data import Recording
from legfem.data.recording import RecordedChannel
from legfem.experiments.plane_strain import PlaneStrainSettings
from legfem.legs.finite_element_models import plane_strain_test

leg = lf.load_subject("4")
stated = leg.tissues["superficial"].C10  # MPa
truth = {"deep.C10": 0.7e-3, "deep.C20": 0.8e-3, "superficial.C10": 0.4 * stated}
speed, depth = 0.4, 20.0  # mm/s, mm
test = plane_strain_test(leg, PlaneStrainSettings())
curve = test.solve(truth, depth).curve

# %%
# Three trials. A frame is off by 0.3 mm from reading to reading, and all frames by 0.25 mm: where somebody puts the boundary.

rng = np.random.default_rng(3)
time = np.arange(0.0, depth / speed, 0.1)
kind = CHANNELS["fat_thickness"]


def recorded(frames):
    """Return the leg with recordings of force, and of the fat's thickness at some displacements (mm)."""
    trials = []
    for k in range(3):
        force = curve(np.maximum(speed * time, 1e-9)) + rng.normal(0.0, 0.02, len(time))
        read = curve.channel("fat_thickness", np.array(frames)) + 0.25 + rng.normal(0.0, 0.3, len(frames))
        channel = RecordedChannel(kind.name, np.array(frames) / speed, read, kind.usual)
        trials.append(Recording(time, speed * time, force, f"trial{k + 1}", channels=(channel,) if frames else ()))
    return replace(leg, recordings=tuple(trials))


# %%
# What a refit hides in the force stands in the thickness. With the fat held at what the folder states, a softer muscle makes
# nearly the same force; between it and the cylinder the stiffer fat stays thicker.

alike = {"law": "reduced-polynomial", "mesh": "coarse", "correction": "none", "depth": depth}
fitted = lf.identify(recorded([]), identify=["deep.C10", "deep.C20"], **alike)["reduced-polynomial"]
values = {name: one.value for name, one in fitted.estimates.items()}
refit = test.solve({**values, "superficial.C10": stated}, depth).curve
at = np.linspace(0.5, depth, 40)
fig, (left, right) = plt.subplots(1, 2, figsize=(9, 3.4), layout="constrained")
for model, fat, muscle in ((curve, truth["superficial.C10"], truth["deep.C10"]), (refit, stated, values["deep.C10"])):
    left.plot(at, model(at), label=f"fat {1e3 * fat:.1f} kPa, muscle {1e3 * muscle:.2f} kPa")
    right.plot(at, model.channel("fat_thickness", at))
left.set(xlabel="displacement (mm)", ylabel="force (N)")
left.legend(frameon=False)
right.set(xlabel="displacement (mm)", ylabel="fat under the cylinder (mm)")
print(f"forces differ by {np.abs(refit(at) - curve(at)).max():.2f} N at most, of {curve(depth):.0f} N;", end=" ")
print(
    f"the fat by {refit.channel('fat_thickness', depth) - curve.channel('fat_thickness', depth):+.2f} mm at {depth:.0f} mm"
)
plt.show()

# %%
# Each set of frames through the same identification of both tissues.

seen = {
    "force alone": [],
    "one frame, at 10 mm": [10.0],
    "three frames, at 0, 10 and 20 mm": [0.0, 10.0, 19.9],
    "one frame a second": list(np.arange(0.0, depth, speed)),
}
both = ["deep.C10", "deep.C20", "superficial.C10"]
found = {name: lf.identify(recorded(frames), identify=both, **alike).to_frame() for name, frames in seen.items()}

# %%
# The dashed lines are the truth. The frames say how stiff the fat is; the muscle's interval narrows with it, since the two trade
# off. Under a thin or a stiff fat, whose thickness hardly changes, a frame is worth less: with subject 3 and a fat 2.5 times as
# stiff as stated one frame adds nothing to three trials of force.

fig, panels = plt.subplots(1, 2, figsize=(9, 2.8), sharey=True, layout="constrained")
for axes, key, true in zip(panels, ("c10_deep", "c10_superficial"), (0.7, 1e3 * 0.4 * stated), strict=True):
    for place, (name, frame) in enumerate(found.items()):
        row = frame.set_index("parameter").loc[key]
        print(f"{name}: {key} {row['value']:.2f} [{row['low']:.2f}, {row['high']:.2f}] {row['unit']}")
        axes.plot([row["low"], row["high"]], [place, place], "C0", lw=3)
        axes.plot(row["value"], place, "ko")
    axes.axvline(true, color="0.5", ls="--")
    axes.set(yticks=range(len(found)), yticklabels=found)
    axes.margins(y=0.2)
    axes.invert_yaxis() if axes is panels[0] else None
panels[0].set_xlabel("C10 of the muscle (kPa)")
panels[1].set_xlabel("C10 of the fat (kPa)")
plt.show()
