"""Limbs that are no calf, and what another code records on them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import shapely
from making import TOML, circle, leg, write_contours

from legfem.data import write_recording
from legfem.legs.loading import load_subject
from legfem.legs.subject import Subject
from studies.making.plane_leg import OtherCase, OtherCode
from studies.making.recording import Course, LabErrors, record

SPEED = 0.5
"""mm/s."""


def thigh() -> dict[str, np.ndarray]:
    """Girth 550 mm, 15 mm of fat; one bone, before the middle."""
    return {"skin": circle(0, 0, 87.5, 240), "fascia": circle(0, 0, 72.5, 200), "femur": circle(6, 12, 14)}


def forearm() -> dict[str, np.ndarray]:
    """Girth some 245 mm, wider than deep, 4 mm of fat; two bones beside each other."""
    oval = np.array([1.15, 0.85])
    return {
        "skin": circle(0, 0, 39, 200) * oval,
        "fascia": circle(0, 0, 35, 180) * oval,
        "radius": circle(-17, 6, 6),
        "ulna": circle(16, 8, 6.5),
    }


def write_limb(folder: Path, parts: Mapping[str, np.ndarray], more: str = "", origin: str = "simulated") -> Path:
    """Write a folder without recordings, pressed from below; ``more`` comes after the other tables."""
    folder.mkdir(parents=True)
    write_contours(folder / "contours.csv", dict(parts))
    toml = TOML.replace('origin = "simulated"', f'origin = "{origin}"')
    stated = "\n[recordings]\nstarts_at_contact = true\n" + ("plane_strain = true\n" if origin == "simulated" else "")
    (folder / "subject.toml").write_text(f"{toml}{stated}{more}")
    return folder


def two_muscles() -> dict[str, np.ndarray]:
    """A calf whose back is two muscles: they share a slanted border and lie next to the fascia."""
    back = np.radians(np.linspace(190, 350, 120))
    x, y = 53.2 * np.array([np.cos(back), np.sin(back)])
    arc, own = np.column_stack([x, y]), x < 0.25 * y + 6
    border = [(6 + 0.25 * v, v) for v in np.linspace(y[own][-1], -2, 40)]

    def closed(*points: np.ndarray) -> np.ndarray:
        return np.asarray(shapely.Polygon(np.vstack(points)).segmentize(2.0).exterior.coords)[:-1]

    return {
        **leg(),
        "gastrocnemius": closed(arc[own], border, [(-40, -2)]),
        "soleus": closed(border[::-1], arc[~own], [(40, -2)]),
    }


MUSCLES = "".join(f'\n[regions.{name}]\nkind = "muscle"\n' for name in ("gastrocnemius", "soleus"))


def pressed(
    folder: Path, case: OtherCase, depth: float, trials: int = 2, finer: float = 1.0, site: str = ""
) -> Subject:
    """Write recordings of a limb by another code, with a lab's errors, into its folder."""
    leg = load_subject(folder, need_recordings=False, site=site)
    curve = OtherCode(leg, case, finer).solve(depth, 0.8)
    assert curve.reached
    time = np.arange(0.0, depth / SPEED, 0.1)
    at = SPEED * time
    course = Course(time, at, np.interp(at, curve.displacement, curve.force))
    errors = LabErrors(gain_sd=0.002)
    within = folder / "recordings" / site
    within.mkdir(exist_ok=True, parents=True)
    for one in record([course] * trials, errors, np.random.default_rng([58, *site.encode()]), leg.instrument):
        write_recording(one, within / f"{one.trial}.csv")
    return load_subject(folder, site=site)
