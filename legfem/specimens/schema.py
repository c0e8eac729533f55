"""The schema of ``specimen.toml``."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from pydantic import Field, create_model

from legfem.common import input_files
from legfem.data.channel_reader import SpecimenChannelsEntry
from legfem.data.folder import InstrumentEntry, with_lab
from legfem.data.stress_tables import StressTableEntry
from legfem.inverse.catalogue import LawName
from legfem.specimens.kind import Direction, SpecimenKind, SpecimenRecordingsEntry
from legfem.specimens.kinds import kinds

PoissonRatio = Annotated[float, Field(gt=-1, lt=0.5, allow_inf_nan=False)]
BaseLaw = Literal["neo-hookean", "reduced-polynomial"]
_TAKEN = ("instrument", "viscoelasticity", "friction", "contact")
FibreRatio = Annotated[float, Field(ge=1, le=20, allow_inf_nan=False)]


SIZES: tuple[str, ...] = tuple(dict.fromkeys(key for kind in kinds().values() for key in kind.own))
"""Keys of the body's sizes, of which specimens of one folder may have their own."""


if TYPE_CHECKING:
    _Sizes = input_files.FileTable
    _SizeErrors = input_files.FileTable
    _Tests = input_files.NamedFile
else:
    # Every kind of test gives its own keys.
    _Sizes = create_model(
        "_Sizes", __base__=input_files.FileTable, **{key: (input_files.Positive | None, None) for key in SIZES}
    )
    _errors = {key: Field(default=None, description=f"Standard deviation of {key}.") for key in SIZES}
    _SizeErrors = create_model(
        "_SizeErrors",
        __base__=input_files.FileTable,
        **{key: (input_files.NotNegative | None, field) for key, field in _errors.items()},
    )
    _tables = {name: (kind.entry | None, None) for name, kind in kinds().items()}
    _Tests = create_model("_Tests", __base__=input_files.NamedFile, **_tables)


class SpecimenEntry(_Sizes):
    """``[[specimen]]``: one of several, with its own sizes and recordings."""

    name: input_files.PlainName
    recordings: Annotated[list[input_files.Text], Field(min_length=1)]
    """Files in the folder; ``*`` stands for anything."""
    layers_mm: Annotated[list[input_files.Positive], Field(min_length=2)] | None = None
    """Thicknesses of the layers, in their order."""
    fibres: Direction | None = None
    """Its own direction of the fibres, in place of that of ``[fibres]``."""


class SizesAccuracy(_SizeErrors):
    """``[accuracy]``, optional: standard deviations of the specimens' sizes, each by its key or all alike."""

    sizes_percent: input_files.NotNegative | None = None
    """Standard deviation of all sizes that have none of their own; without it, 1 % of measured specimens and 0.1 % of
    others."""
    rig_sd_mm_per_N: input_files.RigError | None = None
    """Standard deviation of what the rig yields with the force, however it was taken off the displacement; without it,
    that of usual rigs (0.045 mm/N, at most 0.13 mm of the travel) for measured specimens."""
    contact_sd_mm: input_files.LengthError | None = None
    """Standard deviation of how far specimens were strained before the start, as by a preload that was tared; without
    it, 4 % of the travel of measured specimens that state ``starts_at_contact``."""


class LayerEntry(input_files.FileTable):
    """``[[layers]]``, from what presses to the base: tissues on each other, bonded."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z]\w*$")]
    """By which its numbers are called: ``fat.C10``."""
    thickness_mm: input_files.Positive | None = None
    """Specimens may have their own, as ``layers_mm``."""
    law: LawName | None = None
    """The one that is asked for without it."""
    C10_kPa: input_files.Positive | None = None
    """Stated; looked for without it."""
    C20_kPa: input_files.NotNegative | None = None
    """The same; none where only C10 is stated."""
    poisson_ratio: PoissonRatio | None = None
    """That of ``[tissue]`` without it."""

    def troubles(self) -> Iterator[input_files.Trouble]:
        """Yield a stiffness that the law hasn't."""
        if self.C20_kPa is not None and self.law not in (None, "reduced-polynomial"):
            yield "C20_kPa", f"the {self.law} law isn't held by it", "remove one of them"


class FibresEntry(input_files.FileTable):
    """``[fibres]``: the tissue is stiffer along its fibres than across, as muscle is."""

    direction: Direction | None = None
    """Direction of the fibres: along the load, across it, or along the cylinder; specimens may have their own."""
    ratio: FibreRatio | None = None
    """Shear modulus along the fibres over that across them; identified without it."""
    layer: input_files.Text | None = None
    """Name of the layer that has the fibres."""


class TissueOptions(input_files.FileTable):
    """``[tissue]``, optional: what isn't looked for."""

    poisson_ratio: PoissonRatio | None = None
    """Poisson's ratio at small strain; without it, the bulk modulus is 1000 shear moduli."""
    one_stiffness: bool = False
    """Whether all specimens are equally stiff; otherwise each has a stiffness of its own."""
    returns: bool = False
    """Whether unloading, and what follows it, is used too."""
    law: BaseLaw = "neo-hookean"
    """Law whose shortcomings `legfem diagnose` looks for; C10 is over both laws where one leaves something out."""
    relaxes: bool | None = None
    """Whether the stress relaxes; without it, that is so if a recording holds still."""


class SpecimenFile(_Tests):
    """``specimen.toml`` as it is written, in the file's units."""

    alternatives: ClassVar = tuple(kinds())

    layers: list[LayerEntry] = Field(default_factory=list)
    fibres: FibresEntry | None = None
    specimen: list[SpecimenEntry] = Field(default_factory=list)
    tissue: TissueOptions = TissueOptions()
    accuracy: SizesAccuracy = SizesAccuracy()
    instrument: InstrumentEntry | None = None
    recordings: SpecimenRecordingsEntry = SpecimenRecordingsEntry()
    channels: SpecimenChannelsEntry = SpecimenChannelsEntry()  # type: ignore[valid-type]
    confirmed: list[input_files.Text] = Field(default_factory=list)
    """Fields whose unusual values are right: they aren't doubted."""

    def troubles(self) -> Iterator[input_files.Trouble]:
        """Yield other than one test, and what the test, the layers and the fibres don't go with."""
        given = [name for name in self.alternatives if getattr(self, name) is not None]
        if len(given) != 1:
            names = ", ".join(f"[{name}]" for name in self.alternatives)
            problem = "no test is given" if not given else f"{len(given)} tests are given"
            each = '; give each a folder of its own, and name these in one above: tests = ["tension", "shear"]'
            yield "test", problem, f"give one of the tables {names}{each if given else ''}"
        for key in SIZES:
            if getattr(self.accuracy, key) is not None and key not in self.kind.own:
                yield f"accuracy.{key}", f"is not a size of [{self.kind.table}]", f"give {', '.join(self.kind.own)}"
        if self.recordings.table is not None:
            yield from self._against_a_table(self.recordings.table)
        yield from self._wrong_layers([layer.name for layer in self.layers])

    def _against_a_table(self, table: StressTableEntry) -> Iterator[input_files.Trouble]:
        if not self.kind.cube:
            able = ", ".join(f"[{one.table}]" for one in kinds().values() if one.cube)
            yield "recordings.table", f"is for the tests {able}", "remove it, or the test"
        areas = [getattr(one, "area_mm2", None) for one in (self.test, *self.specimen)]
        if table.of_force and areas[0] is None and not (areas[1:] and all(areas[1:])):
            problem = f"a force in {table.unit} is one on an area"
            yield "recordings.table.unit", problem, "give area_mm2 with the test"
        for key in ("relaxes", "returns"):
            if getattr(self.tissue, key):
                problem = "a table has no time, without which a law has one curve"
                yield f"tissue.{key}", problem, "remove it, or give recordings"

    def _wrong_layers(self, names: list[str]) -> Iterator[input_files.Trouble]:
        if len(names) == 1:
            yield "layers", "there is one", "give several, or none and a thickness_mm"
        for name in names:
            if names.count(name) > 1 or name in _TAKEN:
                problem = "is the name of something else" if name in _TAKEN else "stands twice"
                yield "layers.name", f"{name!r} {problem}", "give another"
        if names and not self.kind.layered:
            able = ", ".join(f"[{one.table}]" for one in kinds().values() if one.layered)
            yield "layers", f"are for the tests {able}", "remove them, or the test"
        if self.fibres is None:
            if any(one.fibres is not None for one in self.specimen):
                yield "specimen.fibres", "are given without [fibres]", "add that table, or remove it"
        elif names and self.fibres.layer not in names:
            what = "is missing" if self.fibres.layer is None else f"{self.fibres.layer!r} is not a layer"
            yield "fibres.layer", what, f"give one of {', '.join(names)}"
        elif self.fibres.layer is not None and not names:
            yield "fibres.layer", "there are no layers", "remove it"

    @property
    def kind(self) -> SpecimenKind[Any, Any]:
        """Kind of the test that is given."""
        return next(kind for name, kind in kinds().items() if getattr(self, name) is not None)

    @property
    def test(self) -> input_files.FileTable:
        """Its table."""
        found: input_files.FileTable = getattr(self, self.kind.table)
        return found


class SeveralTests(input_files.NamedFile):
    """``specimen.toml`` of several tests of one material, each in a folder with a ``specimen.toml`` of its own."""

    tests: Annotated[list[input_files.PlainName], Field(min_length=2)]
    """Names of the folders, beside the file."""


def parse_specimen_file(path: Path) -> SpecimenFile | SeveralTests:
    """Read and check ``specimen.toml``; see `legfem.common.input_files.parse_toml`."""
    content = input_files.read_toml(path, "a specimen folder")
    if "tests" in content:
        return input_files.checked(path, content, SeveralTests)
    return input_files.checked(path, with_lab(path, content, ("instrument", "recordings")), SpecimenFile)
