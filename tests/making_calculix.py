"""A leg in plane strain by a third code, CalculiX: its own elements, contact and Newton's method.

``scripts/in-env env PYTHONPATH=.:tests python -m making_calculix SEED FIRST LAST OUT`` conceals effects on the sealed
study's legs (`studies.cases.sealed`), solves them by CalculiX, and diagnoses what a lab records of them: cases FIRST to
LAST, six a leg. ``... -m making_calculix FILE`` writes what it makes of subject 3. Both need ``ccx`` on the path
(Debian: calculix-ccx).

Quadrilaterals of eight points with reduced integration (CPE8R) press against a ring of stiff ones by CalculiX's penalty
of nodes on faces; bones and ring are moved as a whole. Its laws are its own: ``*HYPERELASTIC, REDUCED POLYNOMIAL``.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest.mock import patch

import numpy as np
import pandas as pd
from scipy.interpolate import CubicSpline

from legfem.channels import Sight
from legfem.common.units import FloatArray, kpa_to_mpa
from legfem.inverse.correction import read_correction
from legfem.legs.correction_of_leg import REFERENCE
from legfem.legs.loading import load_subject
from legfem.legs.schema import SUBJECTS
from legfem.legs.subject import Subject
from legfem.solve.protocol import Protocol
from studies.cases.forms import drawn_values
from studies.cases.sealed import Lab
from studies.cases.sealed_case import SUBJECTS_OF_LEGS, Kind, SealedCase
from studies.cases.sealed_draw import C10_KPA, INSIDE, LATERAL, RISES, SUBSETS, THICKNESSES
from studies.cases.sealed_page import cell_of
from studies.cases.truth import ForceCourse, Truths
from studies.making.plane_leg import OtherCase, OtherCode
from studies.making.plane_mesh import Ints
from studies.making.pressing import OtherCurve

_STICKS = 5.0
"""Coulomb's coefficient of a skin that sticks."""
_RING_MM, _RING_DEG, _RING_PARTS = 2.0, 110.0, 180
"""Thickness of the ring, how far it reaches to each side of the travel, and in how many parts."""
_FACES = ((0, 1), (1, 2), (2, 3), (3, 0))
"""Corners of a quadrilateral's faces S1 to S4."""


def quadrilaterals(points: FloatArray, triangles: Mapping[str, Ints]) -> tuple[FloatArray, dict[str, Ints]]:
    """Split quadratic triangles into three quadrilaterals of eight points each."""
    made, number = list(points), dict[tuple[int, int], int]()

    def middle(a: int, b: int) -> int:
        key = min(a, b), max(a, b)
        if key not in number:
            number[key] = len(made)
            made.append(0.5 * (made[a] + made[b]))
        return number[key]

    found = {}
    for name, cells in triangles.items():
        own = []
        for a, b, c, ab, bc, ca in cells.tolist():
            centre = len(made)
            made.append((points[[a, b, c]].sum(axis=0) + points[[ab, bc, ca]].sum(axis=0)) / 6)
            for corners in ((a, ab, centre, ca), (b, bc, centre, ab), (c, ca, centre, bc)):
                own.append([*corners, *(middle(corners[k], corners[(k + 1) % 4]) for k in range(4))])
        found[name] = np.array(own)
    return np.array(made), found


class ByCalculix(OtherCode):
    """A leg pressed by a disk; see `studies.making.plane_leg.OtherCode`, whose mesh and readings it has."""

    def __init__(self, subject: Subject, case: OtherCase, finer: float = 0.5, sights: Sequence[Sight] = ()) -> None:
        own = OtherCase(case.c10, case.c20, factors=case.factors, friction=case.friction, lumps=case.lumps)
        assert case == own, "springs, muscles, sliding fat and the exponential law aren't written for CalculiX"
        super().__init__(subject, case, finer, sights)
        self.at, self.cells = quadrilaterals(self.mesh.points, self.mesh.cells)
        self._face = np.zeros(0), np.zeros(0)  # CalculiX's pressures on the face aren't read

    def solve(self, depth: float, step: float) -> OtherCurve:
        """Press to a depth (mm); channels are of the triangles' points."""
        with TemporaryDirectory() as name:
            folder = Path(name)
            (folder / "leg.inp").write_text("\n".join(self._deck(depth, step)) + "\n", encoding="ascii")
            one = {**os.environ, "OMP_NUM_THREADS": "1"}
            # What stops short shows in the last increment that is written.
            subprocess.run(["ccx", "leg"], cwd=folder, env=one, stdout=subprocess.DEVNULL, check=False)
            return self._read(folder, depth)

    def _deck(self, depth: float, step: float) -> Iterable[str]:
        count = len(self.at)
        ring, parts = self._ring()
        yield "*NODE, NSET=ALL"
        for k, (x, y) in enumerate(self.at):
            yield f"{k + 1}, {x:.9g}, {y:.9g}, 0"
        yield "*NODE, NSET=RING"
        for k, (x, y) in enumerate(ring):
            yield f"{count + k + 1}, {x:.9g}, {y:.9g}, 0"
        number, faces = 1, dict[frozenset[int], str]()
        for name, group, factor in self._groups():
            yield f"*ELEMENT, TYPE=CPE8R, ELSET={name}"
            for cell in group:
                yield f"{number}, " + ", ".join(str(n + 1) for n in cell)
                faces |= {frozenset((cell[a], cell[b])): f"{number}, S{k + 1}" for k, (a, b) in enumerate(_FACES)}
                number += 1
            yield from self._material(name, factor)
        yield "*ELEMENT, TYPE=CPE8R, ELSET=ERING"
        first = number
        for cell in parts:
            yield f"{number}, " + ", ".join(str(count + n + 1) for n in cell)
            number += 1
        yield "*MATERIAL, NAME=ERING\n*ELASTIC\n1., 0.3\n*SOLID SECTION, ELSET=ERING, MATERIAL=ERING\n1."
        yield "*SURFACE, NAME=SKIN"
        for a, b, middle in self.mesh.skin:
            yield from (faces[frozenset((end, middle))] for end in (a, b))
        yield "*SURFACE, NAME=DISK"
        yield from (f"{first + k}, S1" for k in range(len(parts)))
        yield f"*SURFACE INTERACTION, NAME=TOUCH\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n{self.penalty:.6g}"
        friction = self.case.friction if np.isfinite(self.case.friction) else _STICKS
        if friction > 0:
            yield f"*FRICTION\n{friction:.6g}, {self.penalty:.6g}"
        yield "*CONTACT PAIR, INTERACTION=TOUCH, TYPE=NODE TO SURFACE\nSKIN, DISK"
        yield "*NSET, NSET=BONE"
        yield from (str(n + 1) for n in self._held_points())
        yield "*BOUNDARY\nBONE, 1, 2, 0."
        yield "*STEP, NLGEOM, INC=2000"
        share = step / depth
        yield f"*STATIC\n{0.25 * share:.6g}, 1., 1e-6, {share:.6g}"
        yield "*BOUNDARY"
        yield from (f"RING, {k + 1}, {k + 1}, {depth * self.travel[k]:.9g}" for k in range(2))
        yield "*NODE PRINT, NSET=RING, TOTALS=ONLY\nRF\n*NODE PRINT, NSET=ALL\nU\n*END STEP"

    def _ring(self) -> tuple[FloatArray, Ints]:
        """Return the ring's points, outer faces S1, and its elements."""
        angles = np.deg2rad(np.linspace(-_RING_DEG, _RING_DEG, 2 * _RING_PARTS + 1))
        left = np.array([-self.travel[1], self.travel[0]])
        ways = np.outer(np.cos(angles), self.travel) + np.outer(np.sin(angles), left)
        rows = [self.start + (self.radius - k * 0.5 * _RING_MM) * ways for k in range(3)]
        wide = len(angles)
        parts = []
        for k in range(0, wide - 1, 2):
            outer, middle, inner = (row * wide + k for row in range(3))
            # Counter-clockwise from the outer face.
            parts.append([outer, outer + 2, inner + 2, inner, outer + 1, middle + 2, inner + 1, middle])
        return np.concatenate(rows), np.array(parts)

    def _groups(self) -> Iterable[tuple[str, Ints, float]]:
        """Return elements by tissue and factor on its stiffness."""
        for name, cells in self.cells.items():
            factors: FloatArray = np.ones(len(cells))
            if name == "deep":
                for lump in self.case.lumps:
                    middle = self.at[cells[:, :4]].mean(axis=1)
                    inside = lump.holds(middle, self.start + self.radius * self.travel, self.travel)
                    factors[inside] = lump.factor
            for k, factor in enumerate(np.unique(factors)):
                yield f"{name.upper()}{k}", cells[factors == factor], float(factor)

    def _material(self, name: str, factor: float) -> Iterable[str]:
        tissue, case = name.rstrip("0123456789").lower(), self.case
        own = self.subject.tissues[tissue]
        yield f"*MATERIAL, NAME={name}"
        if tissue == "deep":
            c10, c20 = factor * kpa_to_mpa(case.c10), factor * kpa_to_mpa(case.c20)
            d1, d2 = own.D1 * case.factors.get("deep", 1.0), own.D2 or 1e12
            yield "*HYPERELASTIC, REDUCED POLYNOMIAL, N=2"
            yield f"{c10:.9g}, {c20:.9g}, {d1:.9g}, {d2:.9g}"
        else:
            assert own.C10 is not None
            yield f"*HYPERELASTIC, NEO HOOKE\n{own.C10 * case.factors.get(tissue, 1.0):.9g}, {own.D1:.9g}"
        yield f"*SOLID SECTION, ELSET={name}, MATERIAL={name}\n1."

    def _held_points(self) -> Ints:
        """Return the points of bones, those between the triangles' among them."""
        on = np.zeros(len(self.at), dtype=bool)
        for points in self.mesh.bones.values():
            on[points] = True
        for cells in self.cells.values():
            for a, b in _FACES:
                middle = cells[:, 4 + a]
                both = on[cells[:, a]] & on[cells[:, b]]
                on[middle[both]] = True
        return np.flatnonzero(on)

    def _read(self, folder: Path, depth: float) -> OtherCurve:
        """Read forces and channels of every increment that converged."""
        text = (folder / "leg.dat").read_text(encoding="ascii") if (folder / "leg.dat").exists() else ""
        length = self.subject.indenter.length
        times, forces, channels = [0.0], [0.0], [self._seen(np.zeros(2 * len(self.mesh.points)), np.zeros(2))]
        moved = np.zeros(2 * len(self.mesh.points))
        blocks = re.split(r"\n (?=total force|displacements)", "\n" + text)
        for block in blocks:
            head, _, rest = block.partition("\n")
            time = float(head.split()[-1]) if head else 0.0
            if "set RING" in head:
                resultant = np.array(rest.split()[:2], dtype=float)
            elif head.startswith("displacements"):
                table = np.array(rest.split(), dtype=float).reshape(-1, 4)
                u = np.zeros((len(self.at), 2))
                u[table[:, 0].astype(int) - 1] = table[:, 1:3]
                moved = u[: len(self.mesh.points)].ravel()
                times.append(depth * time)
                forces.append(float(resultant @ self.travel) * length)
                channels.append(self._seen(moved, resultant))
        # No bone lies ahead of some lines of travel.
        seen = [name for name, value in channels[0].items() if np.isfinite(value)]
        found = {name: np.array([one[name] for one in channels]) for name in seen}
        return OtherCurve(np.array(times), np.array(forces), times[-1] > depth - 1e-6, moved, found)


STEP_MM = 1.0
SUBJECT_3 = OtherCase(0.7, 0.8)
KEPT = (*LATERAL, *THICKNESSES, *RISES)
ALL = (*KEPT, INSIDE)
"""Further channels; the pressure on the face isn't read of CalculiX."""
CHANNELS = {"all": ("loading", ALL), "all, holds": ("holds", ALL)}
CONCEALED: tuple[tuple[tuple[Kind, tuple[str, ...], tuple[tuple[str, float], ...]], ...], ...] = (
    (("none", (), ()),),
    (("single", ("superficial-stiffness",), ()),),
    (("single", ("fascia-stiffness",), ()), ("pair", ("fascia-stiffness", "force-drift"), ())),
    (("single", ("compressibility",), ()), ("pair", ("compressibility", "preconditioning"), ())),
    (("outside", (), (("hard-lump", 1.0),)), ("outside", (), (("tendon", 1.0),))),
    (("single", ("support-compliance",), ()), ("single", ("preconditioning",), ()), ("outside", (), (("drop", 1.0),))),
)
"""Kind, effects, and effects by names of their own; six cases a leg, of each one form, in turn from leg to leg."""


class ThirdTruths(Truths):
    """What legs did, by CalculiX."""

    def _by_legfem(self, case: SealedCase, effects: dict[str, dict[str, float]], protocol: Protocol) -> ForceCourse:
        with (
            patch("studies.making.plane_leg.OtherCode", ByCalculix),
            patch("studies.cases.truth._OTHER_STEP_MM", STEP_MM),
        ):
            return self._by_other_code(case, effects, protocol)


def third_cases(legs: int, seed: int) -> list[SealedCase]:
    """Return the cases, leg after leg; a leg has one stiffness."""
    found: list[SealedCase] = []
    for leg in range(legs):
        law = SUBJECTS_OF_LEGS[leg % len(SUBJECTS_OF_LEGS)][1]
        rng = np.random.default_rng([seed, 56, leg])
        c10 = float(np.exp(rng.uniform(*np.log(C10_KPA))))
        c20 = 0.0 if law == "neo-hookean" else c10 * float(rng.uniform(0.4, 2.0))
        for forms in CONCEALED:
            kind, names, outside = forms[leg % len(forms)]
            effects = tuple((name, drawn_values(name, rng)) for name in names)
            sized = tuple((name, size * float(rng.uniform(0.7, 1.3))) for name, size in outside)
            given: Any = len(found), kind, leg, law, "legfem", c10, c20, effects, sized, int(rng.integers(2**31))
            found.append(SealedCase(*given))
    return found


def main(seed: int, first: int, last: int, out: Path) -> None:
    """Print what is said of each case."""
    lab = Lab(out, read_correction(REFERENCE), seed, confirms=True)
    with patch("studies.cases.sealed.Truths", ThirdTruths), patch.dict(SUBSETS, CHANNELS):
        for case in third_cases(last // len(CONCEALED) + 1, seed)[first : last + 1]:
            for subset in CHANNELS:
                said = lab.said(case, subset)
                hidden = "+".join(name for name, _ in (*case.effects, *case.outside)) or "nothing"
                told = "LEFT OUT" if said is None else f"{cell_of(said)}; right, if sure: {said.sure}"
                print(f"{case.number} {hidden}, C10 {case.c10_kpa:.3f}, {subset}: {told}", flush=True)


def table(curve: OtherCurve) -> pd.DataFrame:
    """Return a curve of a millimetre's steps: force (N), and what is seen beside it."""
    d = np.arange(1.0, curve.displacement[-1] + 1e-6)
    beside = {name: values for name, values in curve.channels.items() if name in KEPT}
    columns = {"force_N": curve.force, **beside}
    return pd.DataFrame({"displacement_mm": d} | {k: CubicSpline(curve.displacement, v)(d) for k, v in columns.items()})


if __name__ == "__main__":
    if shutil.which("ccx") is None:
        sys.exit("ccx: isn't on the path; install calculix-ccx, or: scripts/in-env env PATH=FOLDER_OF_CCX:$PATH ...")
    if len(sys.argv) == 2:
        subject = load_subject(SUBJECTS.find("3"), need_recordings=False)
        table(ByCalculix(subject, SUBJECT_3).solve(20.0, STEP_MM)).to_csv(sys.argv[1], index=False, float_format="%.6g")
    else:
        main(*map(int, sys.argv[1:4]), Path(sys.argv[4]))
