"""
Identify a leg's stiffness
==========================

The main thing: recordings in, stiffness with an interval out. Here with one law, the first 12 mm and a coarse mesh, for a
quick look; `lf.identify(leg)` alone is what a result rests on.
"""

import matplotlib.pyplot as plt

import legfem as lf

leg = lf.load_subject("3")
result = lf.identify(leg, law="reduced-polynomial", mesh="coarse", depth=12.0)
result.to_frame()

# %%
# What it was found from, and what it says of itself: a notebook shows a result like this.

result

# %%
# The numbers behind the figure are there too. Down to 12 mm C20 hardly shows: its interval says so.

found = result["reduced-polynomial"]
(site,) = found.tests
force = site.force
fig, axes = plt.subplots(figsize=(6, 3.6), layout="constrained")
axes.plot(force.channel.station, force.channel.values, "k.", label="mean of the recordings")
axes.plot(force.channel.station, force.predicted, label="model")
axes.set(xlabel="displacement (mm)", ylabel="force (N)", title=f"subject 3, {leg.origin}")
axes.legend(frameon=False)
print(f"root mean square {force.rms:.3f} N")
plt.show()
