"""What folders of legs, stockings and specimens share: instruments, recordings, and those that come with legfem."""

import math
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from legfem.common import input_files
from legfem.common.errors import MISSING, Argument, InputError, Remedy
from legfem.data.noise import Instrument
from legfem.data.recording import SourceColumn, SourceColumns
from legfem.geometry.indenter import IndenterShape

# Half-width of a uniform distribution to its standard deviation.
_UNIFORM = 1.0 / math.sqrt(3.0)


Accuracy = Annotated[float, Field(gt=0, le=1e6, allow_inf_nan=False)]


class InstrumentEntry(input_files.FileTable):
    """``[instrument]``: standard deviations, or accuracies and range.

    An accuracy of plus or minus a is read as a uniform distribution of half-width a, whose
    standard deviation is a / sqrt(3).
    """

    force_sd_N: Accuracy | None = None
    """Standard deviation of a reading of the force."""
    force_accuracy_percent: Accuracy | None = None
    """Accuracy of the force in percent of its range, as data sheets give it; in place of force_sd_N."""
    force_range_N: Accuracy | None = None
    """Greatest force of the instrument's range."""
    displacement_sd_mm: Accuracy | None = None
    """Standard deviation of a reading of the displacement."""
    displacement_accuracy_mm: Accuracy | None = None
    """Accuracy of the displacement, plus or minus, as data sheets give it; in place of displacement_sd_mm."""

    def troubles(self) -> Iterator[input_files.Trouble]:
        """Yield an accuracy that is missing, or given twice."""
        stated = self.force_accuracy_percent is not None or self.force_range_N is not None
        if self.force_sd_N is not None and stated:
            remedy = "give either force_sd_N or force_accuracy_percent with force_range_N"
            yield "force_sd_N", "given beside accuracy and range", remedy
        if self.force_sd_N is None:
            for key in ("force_accuracy_percent", "force_range_N"):
                if getattr(self, key) is None:
                    remedy = "give force_sd_N, or force_accuracy_percent and force_range_N"
                    yield key if stated else "force_sd_N", MISSING, remedy
        remedy = "give either displacement_sd_mm or displacement_accuracy_mm"
        yield from input_files.unless_one_of(self, "displacement_sd_mm", "displacement_accuracy_mm", remedy)

    def instrument(self) -> Instrument:
        """Return the standard deviations of readings."""
        force, displacement = self.force_sd_N, self.displacement_sd_mm
        if force is None:
            assert self.force_accuracy_percent is not None and self.force_range_N is not None
            force = self.force_accuracy_percent / 100.0 * self.force_range_N * _UNIFORM
        if displacement is None:
            assert self.displacement_accuracy_mm is not None
            displacement = self.displacement_accuracy_mm * _UNIFORM
        return Instrument(force, displacement)


class ChannelEntry(input_files.FileTable):
    """``[recordings.time]``, ``[recordings.displacement]`` or ``[recordings.force]``."""

    column: input_files.Text
    unit: input_files.Text
    sign: Literal[1, -1] = 1


class RecordingsEntry(input_files.FileTable):
    """``[recordings]``, optional; its channels as ``legfem data look`` writes them."""

    time: ChannelEntry | None = None
    displacement: ChannelEntry | None = None
    force: ChannelEntry | None = None
    sheet: input_files.Text | None = None
    """Name of the table or sheet in files that have several."""

    starts_at_contact: bool = False
    """Whether displacement counts from first contact; otherwise first contact is looked for."""
    plane_strain: bool | None = None
    """Whether a plane-strain model, whose cylinder has no ends, made the recordings; without it, that is so of all
    legs but measured ones."""

    def troubles(self) -> Iterator[input_files.Trouble]:
        """Yield a channel that is missing beside others."""
        keys = ("time", "displacement", "force")
        given = [key for key in keys if getattr(self, key) is not None]
        missing = [key for key in keys if key not in given]
        if missing and (given or self.sheet is not None):
            yield missing[0], MISSING, f"give column and unit of {', '.join(keys)}"

    def channels(self) -> SourceColumns | None:
        """Return where the quantities are found; None where files are in legfem's own form."""
        if self.time is None or self.displacement is None or self.force is None:
            return None
        time, displacement, force = (
            SourceColumn(entry.column, entry.unit, entry.sign) for entry in (self.time, self.displacement, self.force)
        )
        return SourceColumns(time, displacement, force, self.sheet)


class LabIndenterEntry(input_files.FileTable):
    """``[indenter]`` of a lab."""

    diameter_mm: input_files.Positive | None = None
    length_mm: input_files.Positive | None = None
    shape: IndenterShape | None = None


class AccuracyEntry(input_files.FileTable):
    """``[accuracy]``, optional: how well the leg is known."""

    contour_sd_mm: input_files.LengthError | None = None
    """Standard deviation of the outlines, over 20 mm of arc; 0 where they are exact."""
    aim_sd_mm: input_files.LengthError | None = None
    """Standard deviation of the place that was pressed, across the line of travel."""
    direction_sd_deg: Annotated[float, Field(ge=0, le=90)] | None = None
    """Standard deviation of the direction of travel."""
    assumed_sd_percent: input_files.NotNegative | None = None
    """Standard deviation of what is assumed: stiffness of fat and fascia, compressibility."""
    contact_sd_mm: input_files.LengthError | None = None
    """Standard deviation of first contact, alike in all trials, where ``starts_at_contact`` says that they begin there;
    without it, the way on which the load cell comes to feel the leg, over the square root of 12."""
    rig_sd_mm_per_N: input_files.RigError | None = None
    """Standard deviation of what the rig yields with the force, however it was taken off the displacement."""


class LabFile(input_files.FileTable):
    """``lab.toml``: rig, instrument, accuracies and columns where a folder's own file doesn't state them."""

    indenter: LabIndenterEntry | None = None
    instrument: InstrumentEntry | None = None
    accuracy: AccuracyEntry | None = None
    recordings: RecordingsEntry | None = None


def with_lab(toml: Path, content: Mapping[str, Any], tables: Collection[str]) -> dict[str, Any]:
    """Return a folder's file with what the nearest ``lab.toml`` adds to some of its tables.

    Keys of the folder's own count; an instrument is one or the other's whole.

    Raises
    ------
    InputError
        If the lab's file can't be read, or has keys that it can't have.
    """
    whole = dict(content)
    if (path := input_files.lab_of(toml.parent)) is None:
        return whole
    shared = input_files.read_toml(path, "a lab's folder")
    input_files.checked(path, shared, LabFile)
    for name in tables:
        given = content.get(name, {})
        if name in shared and isinstance(given, Mapping) and not (given and name == "instrument"):
            whole[name] = {**shared[name], **given}
    return whole


@dataclass(frozen=True)
class Catalogue:
    """Subjects of one kind that come with legfem.

    Parameters
    ----------
    folder : Path
        That holds a folder for each.
    file : str
        That every subject's folder holds.
    """

    folder: Path
    file: str

    @property
    def names(self) -> tuple[str, ...]:
        """Ids of the subjects."""
        return tuple(sorted(path.parent.name for path in self.folder.glob(f"*/{self.file}")))

    def find(self, name: str) -> Path:
        """Return a subject's folder.

        Raises
        ------
        InputError
            If there is none of that name; lists those there are.
        """
        if name in self.names:
            return self.folder / name
        known = ", ".join(self.names)
        there = f"known subjects are {known}" if known else f"none are in {self.folder}"
        remedy = Remedy(f"{there}; for a folder of your own give ", Argument("subject_dir", "PATH"))
        raise InputError(Argument("subject"), name, "unknown subject", remedy)

    def named(self, subject: str | None, subject_dir: Path | None) -> Path:
        """Return the folder that a command's --subject or --subject-dir names.

        Raises
        ------
        InputError
            If both or none are given, or the subject isn't known.
        """
        if subject is not None and subject_dir is not None:
            problem = f"{Argument('subject_dir')} is given too"
            raise InputError(Argument("subject"), subject, problem, "give one of them")
        if subject_dir is not None:
            return subject_dir
        if subject is None:
            remedy = Remedy("give ", Argument("subject", "ID"), " or ", Argument("subject_dir", "PATH"))
            raise InputError(Argument("subject"), "missing", "no subject is given", remedy)
        return self.find(subject)

    def opened(self, directory: Path) -> Path:
        """Return the subject's file in a folder.

        Raises
        ------
        InputError
            If there is no such folder.
        """
        if not directory.is_dir():
            raise InputError(directory, "subject folder", "not found", f"give a folder that contains {self.file}")
        return directory / self.file
