"""A leg's own folder, pressed in 3D by finer elements and another contact law: the truth is known.

The identification has the same shape, coarser elements and its own contact law.
"""

from __future__ import annotations

import shutil
import tomllib
from dataclasses import dataclass, replace
from pathlib import Path

from legfem.common.errors import InputError
from legfem.data import write_recording
from legfem.experiments.leg_3d import SolidLegSettings
from legfem.jobs.store import Store
from legfem.legs.finite_element_models import spatial_test
from legfem.legs.loading import load_subject
from legfem.legs.placement import spatial_leg
from legfem.mechanics.contact import ContactSettings
from legfem.solve.path import ForceCurve
from studies.leg3d.meshes import refined, stiffened
from studies.leg3d.planted import recorded, whole_curve, with_fibres
from studies.making.recording import INSTRUMENT

FINER, CONTACT_SIZE = 1.3, 3.5
"""Division of the default sizes, and elements under the cylinder (mm)."""
CONTACT = ContactSettings(normal="exponential", stiffness=2000.0, onset=0.02)


@dataclass(frozen=True)
class PlantedInLeg:
    """What is recorded on a leg of one's own.

    Parameters
    ----------
    subject
        Its folder, without recordings and instruments.
    c10, c20
        Of the deep tissue (kPa).
    fibres
        Ratio of its shear moduli along the leg and across.
    depth
        mm.
    """

    subject: Path
    c10: float
    c20: float = 0.0
    fibres: float = 1.0
    depth: float = 10.0

    @property
    def name(self) -> str:
        """What tells its folder from others."""
        return f"{self.subject.resolve().name}-{self.c10:g}-{self.c20:g}-{self.fibres:g}"

    def written(self, out: Path, seed: int, kept: Path) -> Path:
        """Write the folder with recordings, simulated with a lab's errors; solves are kept.

        Raises
        ------
        InputError
            For a folder without the muscle's law, or with instruments or recordings of its own.
        UnsolvedError
            If the solution stops short.
        """
        text = (self.subject / "subject.toml").read_text(encoding="utf-8")
        if "[tissues.deep]\n" not in text:
            raise InputError(self.subject / "subject.toml", "[tissues.deep]", "is missing", "give the law")
        for table in ("[recordings]", "[instrument]"):
            if table in text:
                raise InputError(
                    self.subject / "subject.toml",
                    table,
                    "the study writes its own",
                    "leave it out: the recordings are simulated",
                )
        text = with_fibres(self._found_from_elsewhere(text), self.fibres)
        curve = self._curve(text, kept)
        shutil.copytree(self.subject, out)
        (out / "recordings").mkdir()
        for recording in recorded(curve, self.depth, seed):
            write_recording(recording, out / "recordings" / f"{recording.trial}.csv")
        text += (
            f"\n[instrument]\nforce_sd_N = {INSTRUMENT.force_sd}\n"
            f"displacement_sd_mm = {INSTRUMENT.displacement_sd}\n"
            "[recordings]\nstarts_at_contact = true\nplane_strain = false\n"
        )
        (out / "subject.toml").write_text(text, encoding="utf-8")
        return out

    def _found_from_elsewhere(self, text: str) -> str:
        """Return the folder's text with what lies outside the folder by its full path."""
        here = self.subject.resolve()
        for value in tomllib.loads(text).get("section", {}).values():
            if isinstance(value, str) and not (path := here / value).resolve().is_relative_to(here):
                text = text.replace(f'"{value}"', f'"{path.resolve()}"')
        return text

    def _curve(self, text: str, kept: Path) -> ForceCurve:
        def solved() -> ForceCurve:
            subject = load_subject(self.subject, need_recordings=False, need_instrument=False)
            settings = replace(SolidLegSettings(), contact=CONTACT)
            test = spatial_test(subject, spatial_leg(subject), settings)
            test = stiffened(test, self.c10, self.c20, self.fibres)
            return whole_curve(refined(test, FINER, CONTACT_SIZE), self.depth)

        store = Store(kept, ForceCurve, modules=(__name__,))
        asked = [text, self.c10, self.c20, self.fibres, self.depth]
        return store.get_or_make(asked, solved)
