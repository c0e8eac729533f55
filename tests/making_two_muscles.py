"""Calves of two muscles, drawn and pressed by another code at three sites, with thicknesses and the skin's rise.

``scripts/in-env env PYTHONPATH=.:tests python -m making_two_muscles 1 30`` identifies the calves of seeds 1 to 30, and
counts how often both muscles are found, and how often one site is said not to tell them apart.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from making_limbs import MUSCLES, SPEED, two_muscles, write_limb

import legfem as lf
from legfem.inverse.estimates import Estimate
from legfem.legs.loading import load_subject
from legfem.legs.subject import SitedLeg, Subject
from studies.cases.instruments import Gauge
from studies.making.plane_leg import OtherCase, OtherCode
from studies.making.recording import Course, LabErrors, record

GASTROCNEMIUS_KPA, SOLEUS_KPA, REST_KPA = (0.45, 0.8), (0.9, 1.6), 0.8
"""Between which both are drawn; the rest is known."""
WAYS = {"medial": 55.0, "lateral": 130.0, "behind": 90.0}
"""Directions of travel through the middle; 5 degrees more or less."""
DEPTH = 10.0
SEEN = (
    "fat_thickness",
    "muscle_thickness",
    *(f"skin_rise_{side}_{at}" for side in ("left", "right") for at in (25, 40)),
)
ERRORS = LabErrors(gain_sd=0.005, air=3.0)


def drawn(folder: Path, seed: int) -> tuple[SitedLeg, dict[str, float]]:
    """Return a calf with its recordings, and both muscles' C10 (kPa)."""
    rng = np.random.default_rng([58, 2, seed])
    size = rng.uniform(0.93, 1.07)
    planted = {
        name: float(np.exp(rng.uniform(*np.log(ends))))
        for name, ends in (("gastrocnemius", GASTROCNEMIUS_KPA), ("soleus", SOLEUS_KPA))
    }
    parts = {name: size * outline for name, outline in two_muscles().items()}
    sites = "".join(
        f'\n[[site]]\nname = "{name}"\n'
        f"indenter = {{aim_mm = [{8 * (name == 'behind')}, 0], direction_deg = {way + rng.uniform(-5, 5):.2f}}}\n"
        for name, way in WAYS.items()
    )
    toml = write_limb(folder, parts, MUSCLES + sites) / "subject.toml"
    law = 'law = "reduced-polynomial"\nD1_per_MPa = 28.0\nD2_per_MPa = 28.0'
    known = f'law = "neo-hookean"\nC10_kPa = {REST_KPA}\nD1_per_MPa = 28.0'
    text = toml.read_text()
    assert law in text
    toml.write_text(text.replace(law, known).replace("starts_at_contact = true\n", ""))
    every = [recorded(load_subject(folder, need_recordings=False, site=name), planted, rng) for name in WAYS]
    return SitedLeg(f"calf-{seed}", "A calf, simulated", tuple(every), folder), planted


def recorded(leg: Subject, planted: dict[str, float], rng: np.random.Generator) -> Subject:
    """Return one site with three trials by another code, and what a lab sees beside their force."""
    found = OtherCode(leg, OtherCase(REST_KPA, muscles=planted), 0.8).solve(DEPTH, 0.8)
    assert found.reached
    time = np.arange(0.0, DEPTH / SPEED, 0.1)
    at = SPEED * time
    # No bone lies ahead of some lines of travel.
    seen = [name for name in SEEN if name in found.channels]
    beside = {name: np.interp(at, found.displacement, found.channels[name]) for name in seen}
    course = Course(time, at, np.interp(at, found.displacement, found.force), beside)
    gauges = [Gauge(name, rng) for name in seen]
    trials = []
    for one in record([course] * 3, ERRORS, rng, leg.instrument):
        late = float(one.time[-1] - time[-1])
        trials.append(replace(one, channels=tuple(gauge.read(one, course, late) for gauge in gauges)))
    return replace(leg, recordings=tuple(trials))


def found_of(leg: Subject | SitedLeg, planted: dict[str, float]) -> list[Estimate]:
    """Return the estimates of both muscles."""
    fit = lf.identify(leg, identify=[f"{name}.C10" for name in planted], progress=False)["neo-hookean"]
    return [fit.estimates[f"{name}.C10"] for name in planted]


def main(first: int, last: int) -> None:
    """Print what is found of each calf, and the counts."""
    near = held = told = 0
    for seed in range(first, last + 1):
        with TemporaryDirectory() as folder:
            leg, planted = drawn(Path(folder) / "leg", seed)
            both = found_of(leg, planted)
            forces = tuple(replace(one, channels=()) for one in leg.sites[-1].recordings)
            alone = found_of(replace(leg.sites[-1], recordings=forces), planted)
        pairs = list(zip([one.shown for one in both], planted.values(), strict=True))
        near += all(abs(one.value / true - 1) < 0.1 for one, true in pairs)
        held += all(one.ci95[0] < true < one.ci95[1] for one, true in pairs)
        told += any(one.identifiability == "not identifiable" for one in alone)
        for one, true in pairs:
            print(f"{seed}: {one.value:.3f} ({one.ci95[0]:.3f} to {one.ci95[1]:.3f}) for {true:.3f} kPa")
        print("  by one site", [one.identifiability for one in alone], flush=True)
    print(f"of {last + 1 - first}: both within 10 % in {near}, both held in {held}")
    print(f"by one site: said not to be told apart in {told}")


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
