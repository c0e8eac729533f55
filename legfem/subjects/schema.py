"""The schema of ``subject.toml``."""

from __future__ import annotations

import math
from typing import Literal

from pydantic import Field, model_validator

from legfem.common.toml_file import FileTable, Finite, NotNegative, PlainName, Positive, Text, Title, trouble
from legfem.imaging.shape_entry import LabelsEntry, ShapeEntry
from legfem.recording import Channel, Channels
from legfem.subjects.elastography import ElastographyEntry, StatedRatio, check_once
from legfem.subjects.indenter_entry import IndenterEntry

HOLDER = "a subject folder"
"""That holds the file."""
# Half-width of a uniform distribution to its standard deviation.
_UNIFORM = 1.0 / math.sqrt(3.0)


class SectionEntry(ShapeEntry):
    """``[section]``: contours of one section, or what a section is cut from."""

    fascia_thickness_mm: Positive
    level_mm: Finite | None = None
    """At which to cut, square to z; without it through the indenter's position."""
    length_mm: Positive | None = None
    """Of the leg that a model in 3D holds, the cylinder at its middle; 120 mm without it."""


class TissueEntry(FileTable):
    """What ``[tissues.deep]``, ``[tissues.superficial]`` and ``[tissues.fascia]`` share."""

    law: Literal["neo-hookean", "reduced-polynomial"]
    C10_kPa: Positive | None = None
    C20_kPa: NotNegative | None = None
    D1_per_MPa: Positive
    D2_per_MPa: Positive | None = None

    @model_validator(mode="after")
    def _law_has_parameters(self) -> TissueEntry:
        if self.law == "neo-hookean":
            for key in ("C20_kPa", "D2_per_MPa"):
                if getattr(self, key) is not None:
                    raise trouble(
                        key,
                        "the neo-Hookean law has no such parameter",
                        f'remove {key} or set law = "reduced-polynomial"',
                    )
        return self


class GivenTissueEntry(TissueEntry):
    """A tissue whose stiffness isn't identified and must be given."""

    @model_validator(mode="after")
    def _stiffness_is_given(self) -> GivenTissueEntry:
        if self.C10_kPa is None:
            raise trouble("C10_kPa", "missing", "give it; only the deep tissue is identified")
        if self.law == "reduced-polynomial" and self.C20_kPa is None:
            raise trouble("C20_kPa", "missing", "give it; only the deep tissue is identified")
        return self


class DeepTissueEntry(TissueEntry):
    """``[tissues.deep]``."""

    fibre_ratio: StatedRatio | None = None
    """Shear modulus along the leg over that across; alike in all directions without it."""
    fibre_ratio_sd: Positive | None = None

    @model_validator(mode="after")
    def _error_of_something(self) -> DeepTissueEntry:
        if self.fibre_ratio_sd is not None and self.fibre_ratio is None:
            raise trouble("fibre_ratio_sd", "is given without fibre_ratio", "give the ratio too")
        return self


class TissuesEntry(FileTable):
    """``[tissues]``."""

    deep: DeepTissueEntry
    superficial: GivenTissueEntry
    fascia: GivenTissueEntry


class InstrumentEntry(FileTable):
    """``[instrument]``: standard deviations, or accuracies and range.

    An accuracy of plus or minus a is read as a uniform distribution of half-width a, whose
    standard deviation is a / sqrt(3).
    """

    force_sd_N: Positive | None = None
    force_accuracy_percent: Positive | None = None
    force_range_N: Positive | None = None
    displacement_sd_mm: Positive | None = None
    displacement_accuracy_mm: Positive | None = None

    @model_validator(mode="after")
    def _each_once(self) -> InstrumentEntry:
        stated = self.force_accuracy_percent is not None or self.force_range_N is not None
        if self.force_sd_N is not None and stated:
            raise trouble(
                "force_sd_N",
                "given beside accuracy and range",
                "give either force_sd_N or force_accuracy_percent with force_range_N",
            )
        if self.force_sd_N is None:
            for key in ("force_accuracy_percent", "force_range_N"):
                if getattr(self, key) is None:
                    raise trouble(
                        key if stated else "force_sd_N",
                        "missing",
                        "give force_sd_N, or force_accuracy_percent and force_range_N",
                    )
        if (self.displacement_sd_mm is None) == (self.displacement_accuracy_mm is None):
            missing = self.displacement_sd_mm is None
            raise trouble(
                "displacement_sd_mm",
                "missing" if missing else "given beside displacement_accuracy_mm",
                "give either displacement_sd_mm or displacement_accuracy_mm",
            )
        return self

    def force_sd(self) -> float:
        """Return the standard deviation of a force reading, N."""
        if self.force_sd_N is not None:
            return self.force_sd_N
        assert self.force_accuracy_percent is not None and self.force_range_N is not None
        return self.force_accuracy_percent / 100.0 * self.force_range_N * _UNIFORM

    def displacement_sd(self) -> float:
        """Return the standard deviation of a displacement reading, mm."""
        if self.displacement_sd_mm is not None:
            return self.displacement_sd_mm
        assert self.displacement_accuracy_mm is not None
        return self.displacement_accuracy_mm * _UNIFORM


class ChannelEntry(FileTable):
    """``[recordings.time]``, ``[recordings.displacement]`` or ``[recordings.force]``."""

    column: Text
    unit: Text
    sign: Literal[1, -1] = 1


class RecordingsEntry(FileTable):
    """``[recordings]``, optional; its channels as ``python -m legfem.data look`` writes them."""

    time: ChannelEntry | None = None
    displacement: ChannelEntry | None = None
    force: ChannelEntry | None = None
    sheet: Text | None = None

    starts_at_contact: bool = False
    """Whether displacement counts from first touch; else first contact is looked for."""
    plane_strain: bool | None = None
    """Whether a plane-strain model made them, which has no ends; unless given, whether no leg was
    measured."""

    @model_validator(mode="after")
    def _all_channels_or_none(self) -> RecordingsEntry:
        keys = ("time", "displacement", "force")
        given = [key for key in keys if getattr(self, key) is not None]
        missing = [key for key in keys if key not in given]
        if missing and (given or self.sheet is not None):
            raise trouble(missing[0], "missing", f"give column and unit of {', '.join(keys)}")
        return self

    def channels(self) -> Channels | None:
        """Return where the quantities are found; None where files are in legfem's own form."""
        if self.time is None or self.displacement is None or self.force is None:
            return None
        time, displacement, force = (
            Channel(entry.column, entry.unit, entry.sign) for entry in (self.time, self.displacement, self.force)
        )
        return Channels(time, displacement, force, self.sheet)


class AccuracyEntry(FileTable):
    """``[accuracy]``, optional: how well the leg is known."""

    contour_sd_mm: NotNegative | None = None
    """Of its outlines, over 20 mm of arc; 0 where they are exact."""
    aim_sd_mm: NotNegative | None = None
    direction_sd_deg: NotNegative | None = None
    assumed_sd_percent: NotNegative | None = None
    """Of what is assumed: stiffness of fat and fascia, compressibility."""


class MeasuredEntry(FileTable):
    """One of ``[[measured]]``: how strong an effect is, by another instrument than the indenter."""

    effect: Text
    """Name of a mechanism, as diagnoses have it."""
    value: Finite
    """Its strength, in its own unit."""
    sd: Positive
    """Of that, likewise."""
    source: Text = "measured"


class SubjectFile(FileTable):
    """``subject.toml`` as it is written, in the file's units."""

    id: PlainName
    title: Title
    origin: Literal["measured", "reconstructed", "simulated"]
    section: SectionEntry
    labels: LabelsEntry = LabelsEntry()
    indenter: IndenterEntry
    tissues: TissuesEntry
    instrument: InstrumentEntry | None = None
    recordings: RecordingsEntry = RecordingsEntry()
    accuracy: AccuracyEntry = AccuracyEntry()
    elastography: list[ElastographyEntry] = Field(default_factory=list)
    measured: list[MeasuredEntry] = Field(default_factory=list)
    confirmed: list[Text] = Field(default_factory=list)
    """Fields whose unusual values are right: they aren't doubted."""

    @property
    def is_cut(self) -> bool:
        """Whether the section is cut from something, and not given as contours of its own."""
        return self.section.level_mm is not None or self.indenter.position_mm is not None

    @model_validator(mode="after")
    def _said_once(self) -> SubjectFile:
        check_once(self.elastography, self.tissues.deep.fibre_ratio is not None)
        effects = [entry.effect for entry in self.measured]
        for number, effect in enumerate(effects):
            if effect in effects[:number]:
                raise trouble(
                    f"measured.{number}.effect",
                    f"{effect} is given twice",
                    "give the mean of the measurements, with its standard deviation",
                )
        return self

    @model_validator(mode="after")
    def _one_plane(self) -> SubjectFile:
        level, position = self.section.level_mm, self.indenter.position_mm
        if level is not None and position is not None:
            raise trouble(
                "section.level_mm",
                "is given beside indenter.position_mm",
                "the position says where to cut: leave level_mm out",
            )
        if "labels" in self.model_fields_set and self.section.scan is None:
            raise trouble("labels", "are given without a scan", "give the scan, or leave them out")
        if not self.is_cut and self.section.contours is None:
            raise trouble(
                "section.level_mm",
                "missing: nothing says where to cut the scan",
                "give it, or position_mm and direction of the indenter",
            )
        return self
