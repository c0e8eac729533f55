"""``legfem geometry``: a subject folder from a scanned leg, and a picture of it."""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import typer

from legfem.commands.options import Site, SubjectDir
from legfem.common.command_line import AsJson, CheckedCommand, Quiet, command_context
from legfem.common.errors import InputError, log_doubts
from legfem.geometry.part_names import plain_name
from legfem.geometry.section import fat_thickness, girth

if TYPE_CHECKING:
    from legfem.imaging.leg_source import LegSource

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)


@app.command(cls=CheckedCommand)
def convert(
    cross_sections: Path | None = None,
    scan: Path | None = None,
    label: list[str] | None = None,
    surface: list[str] | None = None,
    muscle: list[str] | None = None,
    level: float | None = None,
    out: Path | None = None,
    subject_dir: SubjectDir = None,
    site: Site = None,
    fascia_thickness: float = 0.6,
    aim: tuple[float, float] | None = None,
    direction: float = 270.0,
    quiet: Quiet = False,
    as_json: AsJson = False,
) -> None:
    """Make a subject folder (contours, subject.toml, a picture) from a scanned leg.

    Parts: skin, muscle_hull or muscles, and bones, as segmenters name them (bone_NAME and
    muscle_NAME for others). In DICOM's coordinates +y is posterior, which the default direction
    presses. With --subject-dir nothing is made but the picture of that folder's section, cut as its
    subject.toml says.

    Example: legfem geometry --cross-sections cross_sections_5mm.csv --level 300
    --out my-leg

    Parameters
    ----------
    cross_sections
        CSV file: level_mm,part,loop,i,x_mm,y_mm.
    scan
        Label volume (NIfTI, NRRD, DICOM-SEG, folder of a DICOM series or of masks).
    label
        PART=NUMBER of the scan; repeat it. superficial=1, deep=2, bone=3.
    surface
        PART=FILE (STL, PLY, OBJ, VTU, VTP); repeat it, for single muscles too.
    muscle
        One of the scan's or surfaces' with a C10 of its own; repeat it.
    level
        Level at which the section is cut (mm).
    out
        Subject folder to make.
    fascia_thickness
        Thickness of the fascia (mm); 0 of a limb without muscle, as a heel pad.
    aim
        Point on the line of travel, mm; by default the one that faces it.
    direction
        Direction of travel, degrees from +x; 270 is along -y.
    """
    with command_context("run the same command again", quiet):
        from legfem.geometry.contours import write_outlines
        from legfem.geometry.motion import CuttingPlane
        from legfem.legs.folder import folder_of_leg
        from legfem.legs.loading import load_subject
        from legfem.legs.plausibility import doubts_about
        from legfem.report.leg_figure import placement_figure
        from legfem.report.style import save

        given = [source for source in (cross_sections, scan, surface, subject_dir) if source]
        if len(given) != 1:
            remedy = "give one of --cross-sections, --scan, --surface and --subject-dir"
            raise InputError("--cross-sections", f"{len(given)} legs", "one is needed", remedy)
        if muscle and not (scan or surface):
            raise InputError("--muscle", muscle[0], "is taken from a scan or surfaces", "leave it out")
        if site is not None and subject_dir is None:
            raise InputError("--site", site, "belongs to a folder", "give --subject-dir, or leave it out")
        scanned = None
        if subject_dir is not None:
            folder = subject_dir
        else:
            if level is None or out is None:
                raise InputError("--level, --out", "missing", "both are needed", "give them")
            point = None if aim is None else np.array(aim)
            source, folder = _source(cross_sections, scan, label or (), surface or (), muscle or ()), out
            source = replace(source, muscle=fascia_thickness > 0)
            folder_of_leg(source, level, folder, fascia_thickness, point, direction)
            scanned = source.outlines(CuttingPlane.at_level(level))
            if cross_sections is None:
                write_outlines(source.outlines_about(level), folder / "cross-sections.csv")
        subject = load_subject(folder, need_recordings=False, need_instrument=False, site=site or "")
        log_doubts(doubts_about(subject))
        name = "section" if site is None else f"section-{site}"
        picture = save(placement_figure(subject, scanned), folder, name)[0]
    section, indenter = subject.section, subject.indenter
    fat = fat_thickness(section, indenter.aim, indenter.direction)
    if as_json:
        document = {
            "schema": 1,
            "folder": str(folder),
            "girth_mm": girth(section),
            "fat_under_indenter_mm": fat,
            "picture": str(picture),
        }
        print(json.dumps(document, indent=1))
        return
    if not quiet:
        print(f"{folder}: girth {girth(section):.0f} mm, fat under the indenter {fat:.1f} mm.")
    if subject_dir is None and not quiet:
        print(
            f"Next: put the trials into {folder / 'recordings'} and your instruments' figures into "
            f"{folder / 'subject.toml'}."
        )
    print(f"picture: {picture}")


def _source(
    cross_sections: Path | None, scan: Path | None, label: Sequence[str], surface: Sequence[str], muscle: Sequence[str]
) -> "LegSource":
    from legfem.imaging.leg_source import LegSource

    muscles = [plain_name(name) for name in muscle]
    if cross_sections is not None:
        return LegSource(str(cross_sections), contours=cross_sections)
    if scan is not None:
        meaning = {name: list(map(_label, given)) for name, given in _by_name(label).items()}
        return LegSource.of_scan(scan, meaning or None, muscles=muscles)
    files = {part: [Path(name) for name in names] for part, names in _by_name(surface).items()}
    return LegSource.of_surfaces(str(next(iter(files.values()))[0].absolute().parent), files, muscles)


def _by_name(options: Sequence[str]) -> dict[str, list[str]]:
    found: dict[str, list[str]] = {}
    for option in options:
        name, sign, value = option.partition("=")
        if not (sign and name and value):
            remedy = "write --label deep=2 or --surface skin=skin.stl"
            raise InputError("--label, --surface", option, "is not of the form NAME=VALUE", remedy)
        found.setdefault(name, []).append(value)
    return found


def _label(number: str) -> int:
    try:
        return int(number)
    except ValueError:
        raise InputError("--label", number, "is not a whole number", "give the scan's") from None
