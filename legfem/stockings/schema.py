"""The schema of ``leg.toml``: a leg with and without its stocking."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, model_validator

from legfem.common.input_files import (
    FileTable,
    Finite,
    NotNegative,
    PlainName,
    Positive,
    Text,
    Title,
    parse_toml,
    trouble,
)
from legfem.imaging.shape_schema import LabelsEntry, ShapeEntry
from legfem.legs.elastography import ElastographyEntry, check_once
from legfem.stockings.sensors import KINDS


class LevelsEntry(FileTable):
    """``[stocking.levels_mm]``: heights in the scan; B and C are looked for by the girth without them."""

    B: Finite | None = None
    B1: Finite | None = None
    C: Finite | None = None
    D: Finite | None = None


Share = Annotated[list[Positive], Field(min_length=2, max_length=2)]


class SharesEntry(FileTable):
    """``[stocking.limits_percent]``: least and greatest pressure over that at B."""

    B1: Share | None = None
    C: Share | None = None
    D: Share | None = None


class StockingEntry(FileTable):
    """``[stocking]``: a compression class, or the fabric's unstretched perimeter."""

    compression_class: Literal["1", "2", "3", "4"] | None = None
    stiffness_N_per_mm: Positive = 0.3
    unstretched_mm: Annotated[float, Field(ge=20.0, le=2000.0)] | None = None
    unstretched: Text | None = None
    intended_class: Literal["A", "1", "2", "3", "4"] | None = None
    """Whose limits the pressure at B is set beside; ``compression_class`` without it."""
    standard: Literal["RAL-GZ 387", "ENV 12718"] = "RAL-GZ 387"
    levels_mm: LevelsEntry = LevelsEntry()
    limits_percent: SharesEntry = SharesEntry()

    @model_validator(mode="after")
    def _one_size(self) -> StockingEntry:
        sizes = ("compression_class", "unstretched_mm", "unstretched")
        given = [name for name in sizes if getattr(self, name) is not None]
        if len(given) != 1:
            raise trouble(
                "compression_class",
                f"{len(given)} sizes of the stocking are given",
                f"give one of {', '.join(sizes)} (a CSV file with level_mm,perimeter_mm)",
            )
        return self


class OutlineAccuracyEntry(FileTable):
    """``[accuracy]`` of the outlines."""

    contour_sd_mm: Positive = 0.2
    correlation_mm: Positive = 8.0
    pressure_relative_sd: Positive = 0.01
    """Standard deviation of the stocking's pressure over an eighth of the girth."""
    tension_relative_sd: NotNegative = 0.0
    """Standard deviation of the fabric's tension, one value for the leg; 0 takes it as given."""


class TissueStiffness(FileTable):
    """``[tissues.deep]`` or ``[tissues.superficial]``: C10 is known, or identified."""

    C10_kPa: Positive | None = None
    D1_per_MPa: Positive = 2.0


class StockingTissues(FileTable):
    """``[tissues]``."""

    deep: TissueStiffness = TissueStiffness()
    superficial: TissueStiffness = TissueStiffness()


class SegmentEntry(FileTable):
    """``[segment]``: the part of the leg that is modelled (mm), and what its ends do."""

    from_mm: Finite | None = None
    to_mm: Finite | None = None
    ends: Literal["held", "free"] = "held"


class VeinEntry(FileTable):
    """One of ``[[veins]]``: a name, and its position in the bare leg (mm)."""

    name: Text
    position_mm: Annotated[list[Finite], Field(min_length=3, max_length=3)]


class PostureEntry(FileTable):
    """``[posture]``, optional: what the veins hold, to set beside the tissue's pressure."""

    heart_mm: Annotated[float, Field(gt=0, le=2500, allow_inf_nan=False)]
    """Height of the heart above z = 0 of the bare scan, standing."""
    lying_mmHg: Annotated[float, Field(gt=0, le=100, allow_inf_nan=False)] | None = None
    """Pressure in the leg's veins, lying."""


class SensorEntry(FileTable):
    """One of ``[[sensor]]``: a pressure measured between stocking and skin."""

    name: Text
    position_mm: Annotated[list[Finite], Field(min_length=3, max_length=3)]
    """Place on the bare leg's skin."""
    pressure_mmHg: Annotated[float, Field(gt=0, le=300, allow_inf_nan=False)]
    instrument: Literal["PicoPress", "Kikuhime"] | None = None
    sd_mmHg: Positive | None = None
    diameter_mm: Annotated[float, Field(ge=1, le=120, allow_inf_nan=False)] | None = None
    """Diameter of the face; the instrument's, or 30 mm, without it."""

    @model_validator(mode="after")
    def _one_error(self) -> SensorEntry:
        if (self.instrument is None) == (self.sd_mmHg is None):
            what = "missing" if self.sd_mmHg is None else "given beside instrument"
            raise trouble("sd_mmHg", what, f"give its standard deviation, or one of {', '.join(KINDS)}")
        return self


class LegFile(FileTable):
    """``leg.toml`` as it is written, in the file's units."""

    id: PlainName
    title: Title
    origin: Literal["measured", "simulated"]
    bare: ShapeEntry
    compressed: ShapeEntry | None = None
    stocking: StockingEntry
    labels: LabelsEntry = LabelsEntry()
    accuracy: OutlineAccuracyEntry = OutlineAccuracyEntry()
    tissues: StockingTissues = StockingTissues()
    segment: SegmentEntry = SegmentEntry()
    veins: list[VeinEntry] = Field(default_factory=list)
    posture: PostureEntry | None = None
    sensor: list[SensorEntry] = Field(default_factory=list)
    elastography: list[ElastographyEntry] = Field(default_factory=list)

    @model_validator(mode="after")
    def _stiffness_is_known_or_shown(self) -> LegFile:
        known = [t.C10_kPa for t in (self.tissues.deep, self.tissues.superficial)]
        if self.compressed is None and None in known:
            raise trouble(
                "compressed",
                "missing, and the tissues' C10_kPa aren't given either",
                "give the leg scanned in its stocking, or C10_kPa of both tissues",
            )
        if self.elastography and None not in known:
            raise trouble(
                "elastography",
                "is given beside C10_kPa of both tissues, which are taken as they are",
                "leave C10_kPa out, so that it is a prior of what is identified",
            )
        return self

    @model_validator(mode="after")
    def _waves_across(self) -> LegFile:
        for number, entry in enumerate(self.elastography):
            if entry.tissue == "deep" and entry.plane == "along":
                raise trouble(
                    f"elastography.{number}.plane",
                    "along the leg isn't used: muscle in a stocking is squeezed across it",
                    "leave it out, and give the modulus across the leg",
                )
        check_once(self.elastography, ratio_stated=False)
        return self


def parse_leg_file(path: Path) -> LegFile:
    """Read and check ``leg.toml``; see `legfem.common.input_files.parse_toml`."""
    return parse_toml(path, LegFile, "the folder of a leg in a stocking")
