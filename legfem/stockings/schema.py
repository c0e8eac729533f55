"""The schema of ``leg.toml``: a leg with and without its stocking."""

from collections.abc import Iterable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from legfem.common import input_files
from legfem.common.errors import MISSING
from legfem.imaging.shape_schema import Labels, ShapeEntry
from legfem.inverse.elastography import ElastographyEntry, elastography_troubles
from legfem.stockings.fabric import CompressionClass, Standard
from legfem.stockings.leg import KINDS
from legfem.stockings.levels import LEVELS, Level

Share = Annotated[list[Annotated[float, Field(ge=2, le=200)]], Field(min_length=2, max_length=2)]
"""In percent, not as parts of one."""


class StockingEntry(input_files.FileTable):
    """``[stocking]``: a compression class, or the fabric's unstretched perimeter."""

    compression_class: CompressionClass | None = None
    """Class whose mean pressure at the ankle the stocking is given; or its unstretched perimeter is stated below."""
    stiffness_N_per_mm: input_files.Positive = 0.3
    """Tension of the fabric per width over its strain."""
    unstretched_mm: Annotated[float, Field(ge=20.0, le=2000.0)] | None = None
    """Perimeter of the unstretched stocking, the same at all heights."""
    unstretched: input_files.Text | None = None
    """CSV file of level_mm,perimeter_mm: the unstretched perimeter at each height."""
    intended_class: Literal["A", "1", "2", "3", "4"] | None = None
    """Class whose limits the pressure at B is compared with; without it, compression_class."""
    standard: Standard = "RAL-GZ 387"
    """Standard that gives the classes' limits."""
    levels_mm: dict[Level, input_files.Finite] = Field(default_factory=dict)
    """Heights in the scan of B (the ankle at its least girth), B1 (where the Achilles tendon passes into the calf's
    muscle), C (the calf at its greatest girth) and D (just below the knee); B and C are looked for without them."""
    limits_percent: dict[Literal["B1", "C", "D"], Share] = Field(default_factory=dict)
    """Least and greatest pressure over that at B, in percent, by level."""

    def troubles(self) -> Iterator[input_files.Trouble]:
        """Yield a size that is missing, or given twice."""
        sizes = ("compression_class", "unstretched_mm", "unstretched")
        given = [name for name in sizes if getattr(self, name) is not None]
        if len(given) != 1:
            remedy = f"give one of {', '.join(sizes)} (a CSV file with level_mm,perimeter_mm)"
            yield "compression_class", f"{len(given)} sizes of the stocking are given", remedy
        for lower, upper in pairwise(name for name in LEVELS if name in self.levels_mm):
            low, high = self.levels_mm[lower], self.levels_mm[upper]
            if high <= low:
                problem = f"{high:g} mm is not above {lower}, which is at {low:g} mm"
                yield f"levels_mm.{upper}", problem, "give heights that increase from the ankle to the knee"
        for name, (least, most) in self.limits_percent.items():
            if least >= most:
                problem = f"{least:g} to {most:g} is no range"
                yield f"limits_percent.{name}", problem, "give the least first, then the greatest"


class BareEntry(ShapeEntry):
    """``[bare]``: the leg's shape, or its girths by tape."""

    girths_mm: Annotated[dict[Level, Annotated[float, Field(ge=100.0, le=800.0)]], Field(min_length=2)] | None = None
    """Girths at B, B1, C and D by tape, whose heights stand in ``[stocking.levels_mm]``."""

    sources: ClassVar[dict[str, str]] = ShapeEntry.sources | {"girths_mm": "girths_mm (by tape)"}


class OutlineAccuracyEntry(input_files.FileTable):
    """``[accuracy]`` of the outlines."""

    contour_sd_mm: Annotated[float, Field(ge=0.001, le=3)] = 0.2
    """Standard deviation of the scans' outlines."""
    correlation_mm: Annotated[float, Field(ge=0.5, le=60)] = 8.0
    """Distance along the skin over which errors of the outlines are alike."""
    pressure_relative_sd: Annotated[float, Field(gt=0, le=0.5)] = 0.01
    """Standard deviation of the stocking's pressure over an eighth of the girth, as a share of it."""
    tension_relative_sd: Annotated[float, Field(ge=0, le=0.5)] = 0.0
    """Standard deviation of the fabric's tension as a share of it, one value for the whole leg; 0 takes the tension
    as exact."""
    girth_relative_sd: Annotated[float, Field(gt=0, le=0.2)] = 0.012
    """Standard deviation of girths by tape: one observer's, by A. te Slaa et al., Phlebology 26 (2011) 14."""


class TissueStiffness(input_files.FileTable):
    """``[tissues.deep]`` or ``[tissues.superficial]``: C10 is known, or identified."""

    C10_kPa: input_files.Positive | None = None
    """Half the shear modulus, where it is known; identified without it."""
    D1_per_MPa: input_files.Positive = 2.0
    """Compressibility: the bulk modulus is 2 / D1."""


class StockingTissues(input_files.FileTable):
    """``[tissues]``."""

    deep: TissueStiffness = TissueStiffness()
    superficial: TissueStiffness = TissueStiffness()


class SegmentEntry(input_files.FileTable):
    """``[segment]``: the part of the leg that is modelled (mm), and what its ends do."""

    from_mm: input_files.Finite | None = None
    """Height in the scan from which on the leg is modelled."""
    to_mm: input_files.Finite | None = None
    """Height in the scan up to which the leg is modelled."""
    ends: Literal["held", "free"] = "held"
    """Whether the leg's cut ends are held in place, or free."""


class VeinEntry(input_files.FileTable):
    """One of ``[[veins]]``: a name, and its position in the bare leg (mm)."""

    name: input_files.Title
    position_mm: Annotated[list[input_files.Finite], Field(min_length=3, max_length=3)]


class PostureEntry(input_files.FileTable):
    """``[posture]``, optional: what the veins hold, to set beside the tissue's pressure."""

    heart_mm: Annotated[float, Field(gt=0, le=2500, allow_inf_nan=False)]
    """Height of the heart above z = 0 of the bare scan, standing."""
    lying_mmHg: Annotated[float, Field(gt=0, le=100, allow_inf_nan=False)] | None = None
    """Pressure in the leg's veins, lying."""


class SensorEntry(input_files.FileTable):
    """One of ``[[sensor]]``: a pressure measured between stocking and skin."""

    name: input_files.Title
    position_mm: Annotated[list[input_files.Finite], Field(min_length=3, max_length=3)]
    """Place on the bare leg's skin."""
    pressure_mmHg: Annotated[float, Field(gt=0, le=300, allow_inf_nan=False)]
    instrument: Literal["PicoPress", "Kikuhime"] | None = None
    sd_mmHg: input_files.Positive | None = None
    diameter_mm: Annotated[float, Field(ge=1, le=120, allow_inf_nan=False)] | None = None
    """Diameter of the face; the instrument's, or 30 mm, without it."""
    thickness_mm: Annotated[float, Field(ge=0, le=20, allow_inf_nan=False)] | None = None
    """Thickness as it lies under the fabric, by which it lifts that and reads too much; 0 of a corrected reading."""

    def troubles(self) -> Iterable[input_files.Trouble]:
        """Return an error that is missing, or given twice."""
        remedy = f"give its standard deviation, or one of {', '.join(KINDS)}"
        return input_files.unless_one_of(self, "sd_mmHg", "instrument", remedy)


class LegFile(input_files.NamedFile):
    """``leg.toml`` as it is written, in the file's units."""

    origin: Literal["measured", "simulated"]
    """Where the data come from; reports of simulated data say so."""
    bare: BareEntry
    compressed: ShapeEntry | None = None
    stocking: StockingEntry
    labels: dict[input_files.Text, Labels] = Field(default_factory=dict)
    accuracy: OutlineAccuracyEntry = OutlineAccuracyEntry()
    tissues: StockingTissues = StockingTissues()
    segment: SegmentEntry = SegmentEntry()
    veins: list[VeinEntry] = Field(default_factory=list)
    posture: PostureEntry | None = None
    sensor: list[SensorEntry] = Field(default_factory=list)
    elastography: list[ElastographyEntry] = Field(default_factory=list)

    def troubles(self) -> Iterator[input_files.Trouble]:
        """Yield a stiffness that nothing tells, and elastography that can't be used."""
        known = [t.C10_kPa for t in (self.tissues.deep, self.tissues.superficial)]
        girths = self.bare.girths_mm or {}
        for name in ("compressed", "segment", "veins", "posture", "sensor", "elastography", "tissues"):
            if girths and name in self.model_fields_set:
                yield name, "has no effect on a leg by tape", "leave it out, or give a scan of the leg"
        for name in girths:
            if name not in self.stocking.levels_mm:
                yield f"stocking.levels_mm.{name}", MISSING, "give the height of each girth"
        if self.compressed is None and None in known and not girths:
            remedy = "give the leg scanned in its stocking, or C10_kPa of both tissues"
            yield "compressed", "missing, and the tissues' C10_kPa aren't given either", remedy
        if self.elastography and None not in known:
            remedy = "leave C10_kPa out, so that it is a prior of what is identified"
            yield "elastography", "is given beside C10_kPa of both tissues, which are taken as they are", remedy
        for number, entry in enumerate(self.elastography):
            if entry.tissue == "deep" and entry.plane == "along":
                problem = "along the leg isn't used: muscle in a stocking is squeezed across it"
                yield f"elastography.{number}.plane", problem, "leave it out, and give the modulus across the leg"
        yield from elastography_troubles(self.elastography, ratio_stated=False)


def parse_leg_file(path: Path) -> LegFile:
    """Read and check ``leg.toml``; see `legfem.common.input_files.parse_toml`."""
    return input_files.parse_toml(path, LegFile, "the folder of a leg in a stocking")
