"""A small round leg pressed in 3D by hexahedra, recorded as a lab does: the truth is known.

The identification has tetrahedra, a membrane for the fascia, and a fibula behind the bone, which
the hexahedra have not; they have a layer for the fascia.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from legfem.common.errors import UnsolvedError
from legfem.common.units import kpa_to_mpa
from legfem.data import Recording
from legfem.experiments.indentation import IndentationTest
from legfem.experiments.indenter_pose import Cylinder
from legfem.experiments.leg_3d import IdealisedLegIndentation, IdealisedLegSettings
from legfem.geometry.leg_shape import HULL, SKIN, LegShape
from legfem.geometry.section import LegSection
from legfem.jobs.store import Store
from legfem.legs.folder import write_subject_folder
from legfem.mechanics.materials import Hyperelastic, NeoHookean, ReducedPolynomial
from legfem.mechanics.terms import Fibres
from legfem.meshing.structured import IdealisedLeg, LegMeshSettings
from legfem.solve.path import ForceCurve
from studies.making.recording import INSTRUMENT, LabErrors, loading, record

LEG = IdealisedLeg(radius=40.0, bone_radius=12.0, length=70.0, fat=9.0, fascia=0.6, ends="held")
CYLINDER = Cylinder(length=30.0)
DEPTH = 7.0
"""mm."""
RATE = 0.5
"""mm/s."""
TRIALS = 3
MESH = LegMeshSettings(contact_size=4, depth_size=6, edge_size=3, growth=0.4, far_size=15)
FIBULA = 3.0, 17.0
"""Radius of the one that folders have, and how far behind the tibia's middle (mm)."""
FIBRES_SD = 0.1
"""Of the ratio that a folder states, over the ratio."""
_POINTS = 120


@dataclass(frozen=True)
class Planted:
    """What is recorded.

    Parameters
    ----------
    c10, c20
        Of the deep tissue (kPa).
    fibres
        Ratio of its shear moduli along the leg and across; the folder states it, give or take a
        tenth.
    depth
        mm.
    mesh
        Of the hexahedra.
    """

    c10: float = 1.2
    c20: float = 0.0
    fibres: float = 1.0
    depth: float = DEPTH
    mesh: LegMeshSettings = field(default_factory=lambda: MESH)

    @property
    def tissues(self) -> dict[str, Hyperelastic]:
        """Law by region; fat and fascia are those that a folder assumes."""
        deep: Hyperelastic = NeoHookean(kpa_to_mpa(self.c10), 28.0)
        if self.c20:
            deep = ReducedPolynomial(kpa_to_mpa(self.c10), 28.0, kpa_to_mpa(self.c20), 28.0)
        return {"deep": deep, "superficial": NeoHookean(2e-3, 22.5), "fascia": NeoHookean(0.1, 22.5)}

    @property
    def mechanisms(self) -> tuple[Fibres, ...]:
        """What the muscle's law is stiffened by."""
        return () if self.fibres == 1 else (Fibres.of_ratio("deep", kpa_to_mpa(self.c10), self.fibres),)

    @property
    def name(self) -> str:
        """What tells its folder from others."""
        return f"leg-{self.c10:g}-{self.c20:g}-{self.fibres:g}"

    def written(self, out: Path, seed: int, kept: Path) -> Path:
        """Write the folder with recordings; solves are kept. See `true_curve`."""
        return folder_of(self, true_curve(self, kept), out, seed)


def round_shape(points: int, levels: int, fibula: bool = False) -> LegShape:
    """Return the leg's shape by contours of so many points at so many levels."""
    angle = np.linspace(0, 2 * np.pi, points, endpoint=False)
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    parts = {SKIN: LEG.radius * ring, HULL: (LEG.radius - LEG.fat) * ring}
    parts["tibia"] = LEG.bone_radius * ring
    if fibula:
        radius, behind = FIBULA
        parts["fibula"] = radius * ring + [0.0, behind]
    z = np.linspace(-LEG.length / 2, LEG.length / 2, levels)
    return LegShape(z, {part: np.tile(xy, (levels, 1, 1)) for part, xy in parts.items()})


def whole_curve(test: IndentationTest, depth: float, what: str = "the leg in 3D") -> ForceCurve:
    """Return a test's force to a depth (mm).

    Raises
    ------
    UnsolvedError
        If the solution stops short.
    """
    found = test.solve(depth=depth)
    if not found.report.complete:
        raise UnsolvedError(f"{what}: {found.report.reason}")
    return found.curve


def true_curve(planted: Planted, kept: Path, cylinder: Cylinder = CYLINDER) -> ForceCurve:
    """Return the leg's force in 3D by hexahedra, along it unless another cylinder is given; it is kept in a folder.

    Raises
    ------
    UnsolvedError
        If the solution stops short.
    """

    def solved() -> ForceCurve:
        settings = replace(IdealisedLegSettings(), mesh=planted.mesh)
        test = IdealisedLegIndentation(LEG, cylinder, planted.tissues, 3, settings, mechanisms=planted.mechanisms)
        return whole_curve(test, planted.depth)

    return Store(kept, ForceCurve, modules=(__name__,)).get_or_make((planted, cylinder), solved)


def recorded(curve: ForceCurve, depth: float, seed: int) -> list[Recording]:
    """Return trials of a curve to a depth (mm), with a lab's errors."""
    return record([loading(curve, depth, RATE)] * TRIALS, LabErrors(gain_sd=0.01), np.random.default_rng(seed))


def folder_of(planted: Planted, curve: ForceCurve, out: Path, seed: int) -> Path:
    """Write the subject's folder with recordings of a curve, simulated with a lab's errors."""
    folder = write_subject_folder(
        _section(),
        out,
        "A round leg, simulated in 3D",
        np.array([0.0, -LEG.radius]),
        90.0,
        "simulated",
        recorded(curve, planted.depth, seed),
        starts_at_contact=True,
        plane_strain=False,
        instrument=INSTRUMENT,
        deep_law="reduced-polynomial" if planted.c20 else "neo-hookean",
    )
    toml = folder / "subject.toml"
    text = toml.read_text(encoding="utf-8")
    text = text.replace("fascia_thickness_mm", f"length_mm = {LEG.length}\nfascia_thickness_mm", 1).replace(
        "length_mm = 50.0", f"length_mm = {CYLINDER.length}", 1
    )
    toml.write_text(with_fibres(f"{text}\n[accuracy]\ncontact_sd_mm = 0.0\n", planted.fibres), encoding="utf-8")
    return folder


def with_fibres(text: str, ratio: float) -> str:
    """Return the text of a ``subject.toml`` that states a ratio of its muscle's shear moduli."""
    law, sd = "[tissues.deep]\n", FIBRES_SD * ratio
    if ratio == 1:
        return text
    return text.replace(law, f"{law}fibre_ratio = {ratio:g}\nfibre_ratio_sd = {sd:g}\n", 1)


def _section() -> LegSection:
    outlines = {part: levels[0] for part, levels in round_shape(_POINTS, 2, fibula=True).contours.items()}
    return LegSection(outlines.pop(SKIN), outlines.pop(HULL), outlines, LEG.fascia)
