"""The schema of ``subject.toml``, and its sites, each read as a subject of its own."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path, PurePath
from typing import Annotated, Any, ClassVar, Literal

from pydantic import AliasChoices, BaseModel, ConfigDict, Field, model_validator

from legfem.common import input_files
from legfem.common.errors import MISSING, Argument, Command, InputError, Remedy
from legfem.common.resources import RESOURCES
from legfem.data.channel_reader import ChannelsEntry
from legfem.data.folder import AccuracyEntry, Catalogue, InstrumentEntry, RecordingsEntry, with_lab
from legfem.geometry.indenter import IndenterShape
from legfem.geometry.section import CALF, LIMBS
from legfem.imaging.shape_schema import Labels, ShapeEntry
from legfem.inverse.elastography import ElastographyEntry, StatedRatio, elastography_troubles
from legfem.legs.typical import TYPICAL_LIMBS

FlatPoint = Annotated[list[input_files.Finite], Field(min_length=2, max_length=2)]
Vector = Annotated[list[input_files.Finite], Field(min_length=3, max_length=3)]


class IndenterEntry(input_files.FileTable):
    """``[indenter]``."""

    # Below 1 mm it is most likely metres or centimetres.
    diameter_mm: Annotated[float, Field(ge=1.0, le=300.0, allow_inf_nan=False)]
    """Diameter of the cylinder, ball or punch."""
    length_mm: Annotated[float, Field(ge=1.0, le=1000.0, allow_inf_nan=False)] | None = None
    """Length of the cylinder along its axis; a ball and a punch have none."""
    shape: IndenterShape = "cylinder"
    """A punch is a cylinder that is pressed with its flat end."""
    axis_deg: input_files.Finite | None = None
    """Angle by which the cylinder is turned about its travel: 0 lies along the leg, 90 across it."""
    aim_mm: FlatPoint | None = None
    """x and y of a point on the line of travel, in the section's plane."""
    direction_deg: Annotated[float, Field(ge=-360.0, le=360.0, allow_inf_nan=False)] | None = None
    """Direction of travel in the section's plane, counter-clockwise from +x: 90 is towards +y."""

    position_mm: Vector | None = None
    """A point on the line of travel in the scan, in place of ``aim_mm``."""
    direction: Vector | None = None
    """Direction of travel in the scan, in place of ``direction_deg``."""
    axis: Vector | None = None
    """Direction of the cylinder's axis in the scan; without it, square to the travel and as near to z as that
    allows."""
    landmarks: input_files.Text | None = None
    """CSV file of points in the coordinates of the indenter's pose and in the scan's, where the two differ."""

    @property
    def own_length(self) -> float:
        """Of a cylinder (mm); of a ball or punch, whose length has no effect, its diameter."""
        if self.shape != "cylinder" or self.length_mm is None:
            return self.diameter_mm
        return self.length_mm

    def troubles(self) -> Iterator[input_files.Trouble]:
        """Yield what doesn't suit the indenter's shape, and two places or none."""
        if self.shape == "cylinder" and self.length_mm is None:
            yield "length_mm", MISSING, "give the cylinder's length"
        for key in ("axis_deg", "axis"):
            if self.shape != "cylinder" and getattr(self, key) is not None:
                yield key, f"has no effect for a {self.shape}", "leave it out"
        if self.axis is not None and self.axis_deg is not None:
            yield "axis_deg", "is given beside axis", "give one of them"
        for flat, spatial in (("aim_mm", "position_mm"), ("direction_deg", "direction")):
            remedy = f"give {flat} in the section's plane, or {spatial} in the scan"
            yield from input_files.unless_one_of(self, flat, spatial, remedy)
        if (self.position_mm is None) != (self.direction is None):
            remedy = "give both in the scan, or aim_mm and direction_deg in the section's plane"
            yield "direction", "position_mm and direction belong together", remedy
        for key in ("axis", "landmarks"):
            if getattr(self, key) is not None and self.position_mm is None:
                yield key, "is of use with position_mm alone", "leave it out"
        for key in ("direction", "axis"):
            if getattr(self, key) is not None and not any(getattr(self, key)):
                yield key, "has no length", "give a vector"


RegionName = Annotated[str, Field(pattern=r"^[A-Za-z]\w*$")]
HOLDER = "a subject folder"
"""That holds the file."""


class SectionEntry(ShapeEntry):
    """``[section]``: contours of one section, what a section is cut from, or a typical limb's size."""

    sources: ClassVar[dict[str, str]] = {
        **ShapeEntry.sources,
        "girth_mm": "girth_mm with fat_mm (a typical limb of that size)",
    }
    fascia_thickness_mm: input_files.NotNegative
    """Thickness of the fascia around the muscle; 0.6 mm is usual, 0 of a limb without muscle."""
    support_mm: Annotated[list[FlatPoint], Field(min_length=2, max_length=2)] | None = None
    """Two points of the face of a plate that the limb lies on: skin there is held."""
    girth_mm: Annotated[float, Field(ge=150.0, le=900.0, allow_inf_nan=False)] | None = None
    """Girth of the limb where it is pressed, by a tape; no outlines are needed then."""
    limb: Literal[*TYPICAL_LIMBS] = CALF  # type: ignore[valid-type]
    """Which limb is typical of that girth."""
    fat_mm: Annotated[float, Field(ge=2.0, le=60.0, allow_inf_nan=False)] | None = None
    """Thickness of skin and fat under the indenter, by ultrasound or half a skinfold; of a pad, to the bone."""
    level_mm: input_files.Finite | None = None
    """Height in the scan at which the section is cut, square to z; without it, the section goes through the
    indenter's position."""
    length_mm: Annotated[float, Field(gt=0, le=1000.0, allow_inf_nan=False)] | None = None
    """Length of the leg in a 3D model, with the cylinder at its middle; 120 mm without it."""

    def troubles(self) -> Iterator[input_files.Trouble]:
        """Yield one of a typical limb's sizes alone, and a plate of no length, beside a shape's troubles."""
        yield from super().troubles()
        if self.support_mm is not None and self.support_mm[0] == self.support_mm[1]:
            yield "support_mm", "is one point twice", "give two points of the plate's face"
        if (self.girth_mm is None) != (self.fat_mm is None):
            missing = "fat_mm" if self.fat_mm is None else "girth_mm"
            yield missing, MISSING, "a typical limb takes both girth_mm and fat_mm"
        if "limb" in self.model_fields_set and self.girth_mm is None:
            yield "limb", "is given without a girth", "give girth_mm and fat_mm, or leave it out"
        if self.girth_mm is not None and TYPICAL_LIMBS[self.limb].is_pad == (self.fascia_thickness_mm > 0):
            remedy = "give 0: it has no muscle" if self.fascia_thickness_mm else "give a thickness; 0.6 mm is usual"
            yield "fascia_thickness_mm", f"is {self.fascia_thickness_mm:g} of a {self.limb}", remedy


class RegionEntry(input_files.FileTable):
    """One of ``[regions.NAME]``: what the outline of that name is in the contours of one section."""

    kind: Literal["bone", "muscle"]
    """A muscle yields as the deep tissue does; named in what is identified, it has a stiffness of its own."""


class TissueEntry(input_files.FileTable):
    """What ``[tissues.deep]``, ``[tissues.superficial]`` and ``[tissues.fascia]`` share."""

    law: Literal["neo-hookean", "reduced-polynomial"]
    """A neo-Hookean tissue has C10 alone; a reduced polynomial has C20 too, and stiffens."""
    C10_kPa: input_files.Positive | None = None
    """Half the shear modulus; leave the muscle's empty, it is what is identified."""
    C20_kPa: input_files.NotNegative | None = None
    """How much the tissue stiffens as it is deformed; of the reduced polynomial only."""
    D1_per_MPa: input_files.Positive
    """Compressibility: the bulk modulus is 2 / D1."""
    D2_per_MPa: input_files.Positive | None = None
    """Compressibility at large changes of volume; of the reduced polynomial only."""

    def troubles(self) -> Iterator[input_files.Trouble]:
        """Yield parameters that the law hasn't."""
        for key in ("C20_kPa", "D2_per_MPa"):
            if self.law == "neo-hookean" and getattr(self, key) is not None:
                remedy = f'remove {key} or set law = "reduced-polynomial"'
                yield key, "the neo-Hookean law has no such parameter", remedy


class GivenTissueEntry(TissueEntry):
    """A tissue whose stiffness isn't identified and must be given."""

    def troubles(self) -> Iterator[input_files.Trouble]:
        """Yield a stiffness that is missing, beside a tissue's troubles."""
        yield from super().troubles()
        for key in ("C10_kPa", "C20_kPa") if self.law == "reduced-polynomial" else ("C10_kPa",):
            if getattr(self, key) is None:
                yield key, MISSING, "give it; only the deep tissue is identified"


class DeepTissueEntry(TissueEntry):
    """``[tissues.deep]``."""

    fibre_ratio: StatedRatio | None = None
    """Shear modulus along the leg over that across it; without it, the muscle is alike in all directions."""
    fibre_ratio_sd: input_files.Positive | None = None
    """Standard deviation of fibre_ratio."""

    def troubles(self) -> Iterator[input_files.Trouble]:
        """Yield an error of nothing, beside a tissue's troubles."""
        yield from super().troubles()
        if self.fibre_ratio_sd is not None and self.fibre_ratio is None:
            yield "fibre_ratio_sd", "is given without fibre_ratio", "give the ratio too"


class TissuesEntry(input_files.FileTable):
    """``[tissues]``."""

    deep: Annotated[DeepTissueEntry, Field(validation_alias=AliasChoices("deep", "pad"))]
    """What is identified; called ``pad`` where it is the only tissue, of a limb without muscle."""
    superficial: GivenTissueEntry | None = None
    fascia: GivenTissueEntry | None = None


class MeasuredEntry(input_files.FileTable):
    """One of ``[[measured]]``: how strong an effect is, by another instrument than the indenter."""

    effect: input_files.Text
    """Name of a mechanism, as diagnoses have it."""
    value: input_files.Finite
    """Its strength, in its own unit."""
    sd: input_files.Positive
    """Of that, likewise."""
    source: input_files.Text = "measured"


class WantedEntry(input_files.FileTable):
    """``wanted``, optional: how well what is measured is to be known, for `legfem live`."""

    C10_percent: Annotated[float, Field(gt=0, le=100.0, allow_inf_nan=False)]
    """Half of C10's 95 % interval over C10."""


class SubjectFile(input_files.NamedFile):
    """``subject.toml`` as it is written, in the file's units."""

    section: SectionEntry
    labels: dict[input_files.Text, Labels] = Field(default_factory=dict)
    """Labels that a scan has for each part, one or several; superficial = 1, deep = 2, bone = 3 without them."""
    regions: dict[RegionName, RegionEntry] = Field(default_factory=dict)
    """What outlines of other names than the usual bones' are."""
    groups: dict[RegionName, list[input_files.Text]] = Field(default_factory=dict)
    """Muscles that share one stiffness, by the name that it is asked for by."""
    indenter: IndenterEntry
    tissues: TissuesEntry
    instrument: InstrumentEntry | None = None
    recordings: RecordingsEntry = RecordingsEntry()
    accuracy: AccuracyEntry = AccuracyEntry()
    elastography: list[ElastographyEntry] = Field(default_factory=list)
    measured: list[MeasuredEntry] = Field(default_factory=list)
    channels: ChannelsEntry = ChannelsEntry()  # type: ignore[valid-type]
    confirmed: list[input_files.Text] = Field(default_factory=list)
    """Fields whose unusual values are right: they aren't doubted."""
    wanted: WantedEntry | None = None
    can: list[Literal["hold", "rates", *ChannelsEntry.model_fields]] | None = None  # type: ignore[valid-type]
    """What a visit allows beside pressing again, for `legfem live`: ways to press, and entries of ``[channels]``."""

    @property
    def is_cut(self) -> bool:
        """Whether the section is cut from something, and not given as contours of its own."""
        return self.section.level_mm is not None or self.indenter.position_mm is not None

    def troubles(self) -> Iterator[input_files.Trouble]:
        """Yield what is said twice, groups of what is no muscle, and other than one plane."""
        yield from elastography_troubles(self.elastography, self.tissues.deep.fibre_ratio is not None)
        without = "is given where fascia_thickness_mm = 0 says that there is no muscle", "leave it out"
        told = (MISSING, "give it") if self.section.fascia_thickness_mm else without
        for name in ("superficial", "fascia"):
            if bool(getattr(self.tissues, name)) == (told is without):
                yield f"tissues.{name}", *told
        effects = [entry.effect for entry in self.measured]
        for number, effect in enumerate(effects):
            if effect in effects[:number]:
                remedy = "give the mean of the measurements, with its standard deviation"
                yield f"measured.{number}.effect", f"{effect} is given twice", remedy
        yield from self._wrong_groups()
        yield from self._other_than_one_plane()

    def _wrong_groups(self) -> Iterator[input_files.Trouble]:
        kinds = dict.fromkeys(chain(*LIMBS.values()), "bone") | {n.lower(): one.kind for n, one in self.regions.items()}
        there = [name for name, kind in kinds.items() if kind == "muscle"]
        for group, own in self.groups.items():
            if kind := kinds.get(group.lower()):
                yield f"groups.{group}", f"is the name of a {kind}", "give the group a name of its own"
            if not own:
                yield f"groups.{group}", "has no muscle", "name its muscles, or leave the group out"
            for muscle in own:
                if muscle.lower() not in there:
                    problem = f"{muscle!r} is no muscle under [regions], or is in a group already"
                    yield f"groups.{group}", problem, f"left are {', '.join(there) or 'none'}"
                there.remove(muscle.lower())

    @model_validator(mode="before")
    @classmethod
    def _pressed_as_usual(cls, content: Any) -> Any:
        """Give a typical limb its line of travel, which is known from one side only."""
        if not isinstance(content, Mapping):
            return content
        section, indenter = content.get("section"), content.get("indenter")
        if not (isinstance(section, Mapping) and isinstance(indenter, Mapping) and "girth_mm" in section):
            return content
        limb = section.get("limb", CALF)
        usual = TYPICAL_LIMBS.get(str(limb), TYPICAL_LIMBS[CALF])
        for key in ("aim_mm", "direction_deg", "position_mm", "direction"):
            if key in indenter:
                remedy = f"leave it out: a typical {limb} is pressed {usual.pressed}, towards its middle"
                raise input_files.trouble(f"indenter.{key}", "is given beside section.girth_mm", remedy)
        return {**content, "indenter": {**indenter, "aim_mm": [0.0, 0.0], "direction_deg": usual.direction_deg}}

    def _other_than_one_plane(self) -> Iterator[input_files.Trouble]:
        level, position = self.section.level_mm, self.indenter.position_mm
        if level is not None and position is not None:
            remedy = "the position says where to cut: leave level_mm out"
            yield "section.level_mm", "is given beside indenter.position_mm", remedy
        if "labels" in self.model_fields_set and self.section.scan is None:
            yield "labels", "are given without a scan", "give the scan, or leave them out"
        drawn = not self.is_cut and self.section.contours is not None
        scanned = self.is_cut and self.section.contours is None
        if not drawn and any(one.kind == "bone" or not scanned for one in self.regions.values()):
            remedy = "give contours without level_mm, or leave them out"
            yield "regions", "are of use with outlines of one section, muscles with a scan or surfaces too", remedy
        if self.section.support_mm and not drawn:
            yield "section.support_mm", "is of use with outlines of one section alone", "give contours without level_mm"
        for table, name in (*(("regions", one) for one in self.regions), *(("groups", one) for one in self.groups)):
            if name.lower() in ("skin", "pad", *TissuesEntry.model_fields, "instrument"):
                yield f"{table}.{name}", "is what every leg has", "give it another name"
        if not self.is_cut and self.section.contours is None and self.section.girth_mm is None:
            remedy = "give it, or position_mm and direction of the indenter"
            yield "section.level_mm", "missing: nothing says where to cut the scan", remedy


RECORDINGS = "recordings"
"""Folder of a leg's recordings; of a site, in it the folder of its name."""
_OWN = ("section", "indenter")


class SiteEntry(input_files.FileTable):
    """One of ``[[site]]``: what it has in place of what the file gives for all."""

    name: input_files.PlainName
    recordings: input_files.Text | None = None
    """Folder within the leg's; ``recordings/NAME`` without it."""
    section: dict[str, Any] = Field(default_factory=dict)
    indenter: dict[str, Any] = Field(default_factory=dict)
    instrument: dict[str, Any] = Field(default_factory=dict)
    starts_at_contact: bool | None = None

    @property
    def folder(self) -> str:
        """Of its recordings, within the leg's."""
        return self.recordings or f"{RECORDINGS}/{self.name}"


class _SitesFile(BaseModel):
    """The sites of a file; the rest is checked with each of them."""

    model_config: ClassVar[ConfigDict] = ConfigDict(extra="ignore", strict=True, frozen=True)
    site: Annotated[list[SiteEntry], Field(min_length=1)]


@dataclass(frozen=True, eq=False)
class SubjectEntry:
    """What ``subject.toml`` gives of one section, pressed at one place."""

    given: SubjectFile
    recordings: str
    """Folder within the subject's."""
    site: str = ""
    """Name; empty of a leg that was pressed at one place alone."""


def site_names(toml: Path) -> tuple[str, ...]:
    """Return the names of a leg's sites; none of a leg that was pressed at one place alone.

    Raises
    ------
    InputError
        If the file can't be read, or its sites are wrong.
    """
    return tuple(site.name for site in _sites(toml, input_files.read_toml(toml, HOLDER)))


def subject_entry(toml: Path, site: str = "") -> SubjectEntry:
    """Read and check ``subject.toml``, of a leg with several sites for one of them.

    Raises
    ------
    InputError
        For what `legfem.common.input_files.parse_toml` raises one; if the leg has sites and none is
        named, or none of that name.
    """
    content = with_lab(toml, input_files.read_toml(toml, HOLDER), ("indenter", "instrument", "accuracy", "recordings"))
    sites = {entry.name: entry for entry in _sites(toml, content)}
    if not sites:
        if site:
            raise InputError(Argument("site"), site, f"{toml} has no [[site]]", "leave it out")
        return SubjectEntry(input_files.checked(toml, content, SubjectFile), RECORDINGS)
    names = ", ".join(sites)
    if not site:
        remedy = Remedy("give ", Argument("site", next(iter(sites))), "; ", Command("identify"), " fits them together")
        raise InputError(toml, "site", f"the leg has {len(sites)} ({names}), and here one is taken by itself", remedy)
    if site not in sites:
        raise InputError(Argument("site"), site, "is not a site of the leg", f"give one of {names}")
    return _entry(toml, content, sites[site])


def _sites(toml: Path, content: Mapping[str, Any]) -> Sequence[SiteEntry]:
    if "site" not in content:
        return ()
    if not isinstance(content["site"], list):
        raise InputError(toml, "site", "is one table", "write [[site]] above each of the sites")
    sites = input_files.checked(toml, content, _SitesFile).site
    folders = (PurePath(site.folder).as_posix() for site in sites)
    input_files.check_distinct(toml, "site.name", (site.name for site in sites), "give every site its own")
    input_files.check_distinct(toml, "site.recordings", folders, "keep every site's recordings apart")
    for site in sites:
        path = PurePath(site.folder)
        if path.is_absolute() or ".." in path.parts:
            raise InputError(toml, "site.recordings", f"{site.folder!r} leaves the folder", "name one within it")
    return sites


def _entry(toml: Path, content: Mapping[str, Any], site: SiteEntry) -> SubjectEntry:
    """Return the file as it would be for one site alone."""
    own = {key: value for key, value in content.items() if key != "site"}
    for key in _OWN:
        shared = content.get(key, {})
        # What isn't a table is wrong, and told as such.
        own[key] = {**shared, **getattr(site, key)} if isinstance(shared, dict) else shared
    if site.instrument:
        own["instrument"] = site.instrument
    if site.starts_at_contact is not None:
        own["recordings"] = {**content.get("recordings", {}), "starts_at_contact": site.starts_at_contact}
    for key, joint in (("id", "-"), ("title", ", ")):
        if isinstance(content.get(key), str):
            own[key] = f"{content[key]}{joint}{site.name}"
    try:
        given = input_files.checked(toml, own, SubjectFile)
    except InputError as error:
        raise error.at(field=f"site {site.name}, {error.field}") from None
    return SubjectEntry(given, site.folder, site.name)


SUBJECTS = Catalogue(RESOURCES / "frauziols" / "subjects", "subject.toml")
