"""Folders of every kind with a file broken at random, and what reads them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from making_broken import broken_bytes, broken_text
from making_scans import PARTS, labels, subject_of_scan, write_cross_sections, write_nifti, write_surfaces
from making_sites import SITES, write_sites
from making_specimens import write_bars
from making_stocking import LEG_TOML, write_shape

from legfem.common.errors import InputError
from legfem.geometry.leg_shape import LegShape
from legfem.legs.loading import load_subject
from legfem.mechanics.materials import ReducedPolynomial
from legfem.specimens.folder import load_specimen
from legfem.stockings.loading import load_leg
from studies.making.shapes import parametric_leg, read_legs
from studies.stockings.command import LEGS

COARSE = (2.6, 2.8, 5.0)
"""Of voxels, mm."""


@dataclass(frozen=True)
class Kind:
    """A good folder, and what reads it."""

    make: Callable[[Path], object]
    read: Callable[[Path], object]

    def told(self, folder: Path) -> str:
        """Return the error that a folder ends in; nothing for one that is read."""
        try:
            self.read(folder)
        except InputError as error:
            text = str(error)
            assert "\n" not in text and error.remedy, text
            return text
        return ""


def _stocking(folder: Path) -> None:
    folder.mkdir()
    bare = parametric_leg(read_legs(LEGS)["1"], n_points=40).at_levels(np.linspace(20, 120, 11))
    thinner = {part: (0.99 if part == "skin" else 1.0) * xy for part, xy in bare.contours.items()}
    write_shape(bare, folder / "bare.csv")
    write_shape(LegShape(bare.levels, thinner), folder / "compressed.csv")
    (folder / "leg.toml").write_text(LEG_TOML)


def _section(folder: Path) -> object:
    return load_subject(folder, need_recordings=False)


def _volume(folder: Path) -> None:
    folder.mkdir()
    write_nifti(folder / "leg.nii", *labels(COARSE), COARSE)
    subject_of_scan(folder, 'scan = "leg.nii"\nlevel_mm = 52.0')


def _surfaces(folder: Path) -> None:
    folder.mkdir()
    write_surfaces(folder)
    files = ", ".join(f'{part} = "{part}.stl"' for part in PARTS)
    subject_of_scan(folder, f"surfaces = {{{files}}}\nlevel_mm = 52.0")


def _cross_sections(folder: Path) -> None:
    folder.mkdir()
    write_cross_sections(folder / "sections.csv", np.arange(0.0, 101.0, 20.0))
    subject_of_scan(folder, 'contours = "sections.csv"\nlevel_mm = 52.0')


KINDS = {
    "specimens": Kind(lambda folder: write_bars(folder, ReducedPolynomial(5e-3, 1.0, C20=5e-3)), load_specimen),
    "sites": Kind(write_sites, lambda folder: load_subject(folder, site=SITES[1])),
    "stockings": Kind(_stocking, load_leg),
    "volumes": Kind(_volume, _section),
    "surfaces": Kind(_surfaces, _section),
    "cross-sections": Kind(_cross_sections, _section),
}


def broken_anywhere(folder: Path, seed: int) -> str:
    """Break one file of a folder, its TOML in 3 of 10; return what was done."""
    rng = np.random.default_rng(seed)
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    tables = [path for path in files if path.suffix == ".toml"]
    others = [path for path in files if path.suffix != ".toml"]
    among = tables if rng.random() < 0.3 else others
    path = among[int(rng.integers(len(among)))]
    text = path.suffix in (".toml", ".csv")
    return broken_text(path, rng) if text else broken_bytes(path, rng)
