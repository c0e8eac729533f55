"""Writing a subject folder from a section, with or without recordings."""

import json
import re
import shutil
import tempfile
from collections.abc import Sequence
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from legfem.common.errors import Argument, InputError
from legfem.common.resources import RESOURCES
from legfem.common.units import FloatArray
from legfem.data import Instrument, Recording, write_recording
from legfem.geometry.contours import write_contours
from legfem.geometry.motion import CuttingPlane
from legfem.geometry.section import LIMBS, LegSection
from legfem.geometry.section_from_outlines import facing_point

if TYPE_CHECKING:
    from legfem.imaging.leg_source import LegSource

_TEMPLATE = (RESOURCES / "frauziols" / "subject-template.toml").read_text(encoding="utf-8")
"""Tissues, indenter and instruments of the first paper."""
_DEEP = {
    "neo-hookean": 'law = "neo-hookean"\nD1_per_MPa = 28.0',
    "reduced-polynomial": 'law = "reduced-polynomial"\nD1_per_MPa = 28.0\nD2_per_MPa = 28.0',
}
_OUTER = "".join(
    f'[tissues.{name}]\nlaw = "neo-hookean"\nC10_kPa = {kPa}\nD1_per_MPa = 22.5\n\n'
    for name, kPa in (("superficial", 2.0), ("fascia", 100.0))
)
_PAPER_INSTRUMENT = """\
force_accuracy_percent = 0.25
force_range_N = 100.0
displacement_accuracy_mm = 0.25"""


def folder_of_leg(
    source: "LegSource",
    level: float,
    out: Path,
    fascia_thickness: float = 0.6,
    aim: FloatArray | None = None,
    direction_deg: float = 270.0,
) -> Path:
    """Make a subject folder of one level of a scanned leg.

    Tissues, indenter and instruments are the first paper's; put recordings into
    ``recordings/`` and the instruments' own figures into ``subject.toml``.

    Parameters
    ----------
    source : LegSource
        A label volume, contours at several levels, or surfaces.
    level : float
        mm.
    out : Path
        The folder to make; must not exist, or be empty.
    fascia_thickness : float
        mm.
    aim : (2,) array, optional
        A point on the cylinder's line of travel, mm; by default the skin's point that faces it.
    direction_deg : float
        Direction of travel from +x, counter-clockwise; 270 presses along -y.

    Returns
    -------
    Path
        ``out``.

    Raises
    ------
    InputError
        If the leg can't be used or ``out`` isn't empty; nothing is written then.
    """
    section = source.section(CuttingPlane.at_level(level), fascia_thickness)
    title = f"{Path(source.name).name}, level {level:g} mm"
    angle = np.deg2rad(direction_deg)
    travel = np.array([np.cos(angle), np.sin(angle)])
    target = facing_point(section, travel) if aim is None else aim
    return write_subject_folder(section, out, title, target, direction_deg)


def write_subject_folder(
    section: LegSection,
    out: Path,
    title: str,
    aim: FloatArray,
    direction_deg: float,
    origin: str = "measured",
    recordings: Sequence[Recording] = (),
    **stated: Any,
) -> Path:
    """Write ``subject.toml``, ``contours.csv`` and the recordings, all or nothing; ``stated`` is as of `subject_text`.

    Raises
    ------
    InputError
        If ``out`` exists and isn't an empty folder, or can't be written.
    """
    # Imported here: a subject stands above geometry.
    from legfem.legs.loading import load_subject

    out = Path(out)
    check_new_folder(out)
    name, thickness = plain_id(out.resolve().name), section.fascia_thickness
    text = subject_text(name, title, origin, thickness, aim, direction_deg, **stated) + _regions(section)
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        scratch = Path(tempfile.mkdtemp(prefix=f".{out.name}-", dir=out.parent))
    except OSError as error:
        problem, remedy = f"can't be written ({error})", "give a folder that you may write to"
        raise InputError(Argument("out"), str(out), problem, remedy) from None
    try:
        (scratch / "recordings").mkdir()
        for recording in recordings:
            write_recording(recording, scratch / "recordings" / f"{recording.trial}.csv")
        write_contours(section, scratch / "contours.csv")
        (scratch / "subject.toml").write_text(text, encoding="utf-8")
        load_subject(scratch, need_recordings=False)
        scratch.chmod(0o755)
        scratch.replace(out)
    except InputError as error:
        raise error.at(error.source.replace(str(scratch), str(out))) from None
    finally:
        shutil.rmtree(scratch, ignore_errors=True)
    return out


def subject_text(
    name: str,
    title: str,
    origin: str,
    fascia_thickness: float,
    aim: Sequence[float] | FloatArray,
    direction_deg: float,
    starts_at_contact: bool = False,
    instrument: Instrument | None = None,
    deep_law: str = "reduced-polynomial",
    plane_strain: bool | None = None,
) -> str:
    """Return the text of a ``subject.toml``; lengths in mm, the tissues are the first paper's.

    So are the instruments where none is given. ``plane_strain`` says whether simulated recordings know no ends of the
    cylinder, and may stay open.
    """
    own = instrument and f"force_sd_N = {instrument.force_sd}\ndisplacement_sd_mm = {instrument.displacement_sd}"
    return _TEMPLATE.format(
        id=_toml_string(name),
        title=_toml_string(title),
        origin=origin,
        thickness=fascia_thickness,
        x=float(aim[0]),
        y=float(aim[1]),
        direction=float(direction_deg),
        starts_at_contact=str(starts_at_contact).lower(),
        ends="" if plane_strain is None else f"plane_strain = {str(plane_strain).lower()}\n",
        pressed="deep" if fascia_thickness else "pad",
        deep=_DEEP[deep_law],
        outer=_OUTER if fascia_thickness else "",
        instrument=own or _PAPER_INSTRUMENT,
    )


def _regions(section: LegSection) -> str:
    kinds = dict.fromkeys(section.bones, "bone") | dict.fromkeys(section.muscles, "muscle")
    own = {part: kind for part, kind in kinds.items() if part not in chain(*LIMBS.values())}
    return "".join(f'\n[regions.{part}]\nkind = "{kind}"\n' for part, kind in own.items())


def check_new_folder(out: Path) -> None:
    """Raise InputError if a folder exists and isn't empty."""
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise InputError(Argument("out"), str(out), "exists already", "give a new folder or remove it")


def plain_id(name: str) -> str:
    """Return a folder's name without what an id may not have."""
    return re.sub(r"[^\w. -]", "-", name).lstrip(". -") or "leg"


def _toml_string(text: str) -> str:
    # A JSON string is a TOML basic string.
    return json.dumps(text)
