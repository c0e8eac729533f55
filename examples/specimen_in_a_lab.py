"""
A specimen in a lab's test
==========================

A cube of muscle, compressed at three rates and held: two recordings are fitted together, the third is predicted. The folder
``examples/specimen`` is **simulated**.
"""

from pathlib import Path

import matplotlib.pyplot as plt

import legfem as lf

folder = Path("specimen") if Path("specimen").is_dir() else Path("examples/specimen")
specimen = lf.load_specimen(folder)
result = lf.identify(specimen, law="yeoh", leave_out=["middle"])
result.to_frame()

# %%
# What it says of itself.

result

# %%
# Fitted and predicted, by recording.

found = result["yeoh"]
fig, axes = plt.subplots(figsize=(6, 3.6), layout="constrained")
for one in found.tests:
    channel = one.force.channel
    how = "fitted" if one.fitted else "predicted"
    (line,) = axes.semilogx(channel.station, channel.values, ".", label=f"{one.name}, {how}")
    axes.semilogx(channel.station, one.force.predicted, color=line.get_color())
axes.set(xlabel="time after first contact (s)", ylabel="force (N)")
axes.legend(frameon=False)
plt.show()
