"""A calf with two inclusions, pressed by another code, its tracked images with errors of another shape than assumed.

``scripts/in-env env PYTHONPATH=.:tests python -m making_inclusions 0.1 1 2 3`` maps three such muscles, by images
whose cells err by 0.1 mm, and counts what is found.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from making_limbs import SPEED, leg, write_limb

import legfem as lf
from legfem.channels import Sight
from legfem.channels.kinds.section_image import INSIDE
from legfem.common.units import FloatArray
from legfem.data import write_recording
from legfem.geometry.indenter import Site
from legfem.geometry.section import across
from legfem.legs.details import StiffnessMap
from legfem.legs.loading import load_subject
from legfem.legs.subject import Subject
from studies.making.plane_leg import Lump, OtherCase, OtherCode
from studies.making.recording import Course, LabErrors, flicker, record

C10_KPA, RADIUS_MM = 0.8, 6.0
DEPTH = 12.0
TRACKING = 0.1
"""Errors of a cell, mm; drift a third of it."""
_POINT = 1.6
"""Of the error of a point over that of a cell's mean, with errors alike over 4 mm."""
_TABLE = """
[channels.section_displacement]
file = "tracked-{{trial}}.csv"
optional = true
sd_mm = {sd:g}
slow_mm = {slow:g}
cells = 60
"""


@dataclass(frozen=True)
class Inclusions:
    """Disks in a muscle, each of a factor on its C10, below the skin (mm) along the travel and to its left."""

    stiff: tuple[float, float]
    soft: tuple[float, float]
    factors: tuple[float, float] = (3.0, 0.3)

    @property
    def lumps(self) -> list[Lump]:
        pairs = zip((self.stiff, self.soft), self.factors, strict=True)
        return [Lump(below, RADIUS_MM, RADIUS_MM, factor, left) for (below, left), factor in pairs]

    def middles(self, site: Site) -> FloatArray:
        """Return the disks' middles (2, 2), mm."""
        at = np.array([self.stiff, self.soft])
        return np.asarray(site.deepest + at[:, :1] * site.direction + at[:, 1:] * across(site.direction))


def drawn(seed: int) -> Inclusions:
    """Return inclusions at 14 to 34 mm below the skin, within 15 mm of the line of travel, 18 mm apart or more."""
    rng = np.random.default_rng([58, 6, seed])
    while True:
        stiff, soft = ((float(rng.uniform(14, 34)), float(rng.uniform(-15, 15))) for _ in range(2))
        if np.hypot(stiff[0] - soft[0], stiff[1] - soft[1]) >= 18:
            return Inclusions(stiff, soft)


def pressed_calf(folder: Path, case: Inclusions, seed: int, tracking: float = TRACKING) -> Subject:
    """Write a folder with three trials, and images of the first, which lie elsewhere than they are said to."""
    write_limb(folder, leg(), _TABLE.format(sd=tracking, slow=tracking / 3))
    toml = (folder / "subject.toml").read_text()
    polynomial = 'law = "reduced-polynomial"\nD1_per_MPa = 28.0\nD2_per_MPa = 28.0'
    assert polynomial in toml
    (folder / "subject.toml").write_text(toml.replace(polynomial, 'law = "neo-hookean"\nD1_per_MPa = 28.0'))
    bare = load_subject(folder, need_recordings=False)
    site, rng = Site(bare.section, bare.indenter), np.random.default_rng([58, seed])
    x, y = np.meshgrid(np.arange(-22.0, 23.0, 2.0), np.arange(3.0, 44.0, 2.0))
    stated = site.deepest + x.reshape(-1, 1) * across(site.direction) + y.reshape(-1, 1) * site.direction
    shift, turn = rng.uniform(-2, 2, 2), np.deg2rad(rng.uniform(-3, 3))
    turned = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    middle = stated.mean(axis=0)
    truly = middle + shift + (stated - middle) @ turned.T
    sight = Sight(INSIDE.name, tuple((float(px), float(py), float(way)) for px, py in truly for way in (0, 1)))
    found = OtherCode(bare, OtherCase(C10_KPA, lumps=case.lumps), 0.8, [sight]).solve(DEPTH, 0.75)
    assert found.reached
    time = np.arange(0.0, DEPTH / SPEED, 0.1)
    course = Course(time, SPEED * time, np.interp(SPEED * time, found.displacement, found.force))
    (folder / "recordings").mkdir()
    for one in record([course] * 3, LabErrors(gain_sd=0.005), rng, bare.instrument):
        write_recording(one, folder / "recordings" / f"{one.trial}.csv")
    frames = np.arange(0.0, time[-1], 1.0)
    rows = np.array([found.channels[name] for name in INSIDE.courses(2 * len(truly))])
    moved = np.array([np.interp(SPEED * frames, found.displacement, row) for row in rows]).T
    moved = 1.01 * moved.reshape(len(frames), -1, 2) @ turned
    apart = np.linalg.norm(stated[:, None] - stated[None], axis=-1)
    alike = np.linalg.cholesky(np.exp(-apart / 4.0) + 1e-9 * np.eye(len(stated)))
    moved += _POINT * tracking * alike @ rng.laplace(0.0, 2**-0.5, moved.shape)
    drift = np.array([flicker(len(frames), rng) for _ in range(2 * len(stated))])
    moved += tracking / 3 * drift.T.reshape(moved.shape)
    table = np.column_stack([np.repeat(frames, len(stated)), np.tile(stated, (len(frames), 1)), moved.reshape(-1, 2)])
    np.savetxt(folder / "tracked-trial1.csv", table, "%.4f", ",", header="time_s,x_mm,y_mm,ux_mm,uy_mm", comments="")
    return load_subject(folder)


def without_images(subject: Subject) -> Subject:
    """Return the same recordings, the force alone."""
    return replace(subject, recordings=tuple(replace(one, channels=()) for one in subject.recordings))


def mapped(leg: Subject) -> tuple[lf.Identification, StiffnessMap]:
    """Return a leg's fit and its map."""
    found = lf.identify(leg, identify=["deep.C10"], field=True)
    return found, found.best.details.field


def found_in(told: StiffnessMap, at: FloatArray, factor: float) -> tuple[bool, bool]:
    """Whether a place that is stiffer, or softer, stands out within 5 mm, and whether its interval has the true C10."""
    away = np.linalg.norm(told.points_mm[told.stands_out] - at, axis=1)
    near = [k for k, far in zip(told.stands_out, away, strict=True) if far < 5]
    near = [k for k in near if (told.C10_kPa[k] > told.whole_kPa) == (factor > 1)]
    held = (abs(np.log(told.C10_kPa[k] / (factor * C10_KPA))) < 1.96 * told.log_sd[k] for k in near)
    return bool(near), any(held)


def main(tracking: float, seeds: list[int]) -> None:
    """Print what is found of each case, and the counts."""
    every = []
    for seed in seeds:
        case = drawn(seed)
        with TemporaryDirectory() as folder:
            leg = pressed_calf(Path(folder) / "leg", case, seed, tracking)
            _, told = mapped(leg)
        middles = case.middles(Site(leg.section, leg.indenter))
        each = [found_in(told, at, factor) for at, factor in zip(middles, case.factors, strict=True)]
        false = len(told.stands_out) - sum(found for found, _ in each)
        print(f"{seed}: stiff and soft (found, held) {each}, {false} other places stand out", flush=True)
        every += each
    found, held = np.sum(every, axis=0)
    print(f"of {len(every)} inclusions {found} are found in place, {held} with their C10 in the interval")


if __name__ == "__main__":
    main(float(sys.argv[1]), list(map(int, sys.argv[2:])))
