"""
What is seen in a recording
===========================

Before anything is solved: the phases of a recording, where the cylinder first touches, how noisy it is, and a grade. Subject 3's
first trial (**reconstructed**), with 4 mm of air put before it.
"""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np

import legfem as lf
from legfem.data import segment
from legfem.data.quality import quality_of

leg = lf.load_subject("3")
trial = leg.recordings[0]
rate = 0.4  # mm/s
wait = np.arange(0.0, 4.0 / rate, np.diff(trial.time).mean())
generator = np.random.default_rng(1)
recording = replace(
    trial,
    time=np.concatenate([wait, wait[-1] + trial.time[1] - trial.time[0] + trial.time]),
    displacement=np.concatenate([rate * wait, 4.0 + trial.displacement]),
    force=np.concatenate([0.05 * generator.standard_normal(len(wait)), trial.force]),
)
seen = segment(recording)
quality, contact = quality_of(seen), seen.contact
print(f"grade {quality.grade}:", "; ".join(quality.reasons) or "nothing to say")
print(f"first contact at {contact.estimate:.2f} mm, give or take {contact.displacement_error:.2f}")

# %%
# ``legfem data look FILE`` does this with any instrument's file.

fig, axes = plt.subplots(figsize=(8, 3.6), layout="constrained")
axes.plot(recording.time, recording.force, "k", lw=0.8)
colours = {"loading": "C0", "hold": "C1", "unloading": "C7", "air": "C8"}
for part in seen.parts:
    axes.axvspan(part.start, part.end, color=colours[part.phase], alpha=0.2, lw=0)
    axes.text((part.start + part.end) / 2, axes.get_ylim()[1], part.phase, ha="center")
axes.set(xlabel="time (s)", ylabel="force (N)")
plt.show()
