"""
What was assumed widens the interval
====================================

C10 of the muscle depends on what is assumed of the fat. Three ways to say so: fat held at the folder's value, fat known to a
factor of 1.5, and fat half as stiff as stated. One law, a coarse mesh and the first 8 mm, for a quick look.
"""

import math

import matplotlib.pyplot as plt

import legfem as lf
from legfem.inverse.parameter import Parameter, Prior
from legfem.inverse.settings import IdentificationSettings

leg = lf.load_subject("3")
fat = leg.tissues["superficial"].C10  # MPa
muscle = Parameter("deep.C10", "MPa", (1e-5, 1e-1), scale="log")
unsure = Parameter(
    "superficial.C10",
    "MPa",
    (fat / 10, 10 * fat),
    scale="log",
    role="nuisance",
    prior=Prior(fat, math.log(1.5), "log", "a factor of 1.5"),
)
how = {
    "fat as stated": {"identify": [muscle]},
    "fat known to a factor 1.5": {"identify": [muscle, unsure]},
    "fat half as stiff": {"identify": [muscle], "fix": {"superficial.C10": fat / 2}},
}
alike = {"law": "neo-hookean", "mesh": "coarse", "depth": 8.0}
alike["settings"] = IdentificationSettings(weighting="covariance")  # for a prior to weigh against
found = {name: lf.identify(leg, **alike, **given).to_frame() for name, given in how.items()}

# %%
# The interval knows what was allowed to err, and nothing of what was held though it is wrong.

fig, axes = plt.subplots(figsize=(6, 2.6), layout="constrained")
for place, (name, frame) in enumerate(found.items()):
    row = frame.set_index("parameter").loc["c10_deep"]
    print(f"{name}: C10 {row['value']:.3f} [{row['low']:.3f}, {row['high']:.3f}] {row['unit']}")
    axes.plot([row["low"], row["high"]], [place, place], "C0", lw=3)
    axes.plot(row["value"], place, "ko")
axes.set(yticks=range(len(found)), yticklabels=found, xlabel="C10 of the muscle (kPa), neo-Hookean")
axes.margins(y=0.3)
plt.show()
