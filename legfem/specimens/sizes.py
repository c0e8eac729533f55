"""The tests of specimens that ``specimen.toml`` describes, with the sizes of each specimen."""

from __future__ import annotations

from dataclasses import asdict

from legfem.common.toml_file import FileTable
from legfem.experiments.axisymmetric import (
    BallIndentation,
    BallOnLayer,
    CylinderBetweenPlates,
    CylinderCompression,
)
from legfem.experiments.flat_punch import FlatPunchIndentation, PunchOnLayer
from legfem.experiments.lateral_cylinder import CylinderOnBlock, LateralCylinder
from legfem.experiments.uniaxial import Bar, UniaxialTest
from legfem.specimens.schema import (
    SIZES,
    BallEntry,
    BarEntry,
    CylinderEntry,
    PlatesEntry,
    PunchEntry,
    SpecimenEntry,
    SpecimenFile,
    TestEntry,
)

Sizes = BallOnLayer | PunchOnLayer | CylinderBetweenPlates | CylinderOnBlock | Bar
Test = BallIndentation | FlatPunchIndentation | CylinderCompression | LateralCylinder | UniaxialTest


_WORDS: dict[type[Sizes], str] = {
    BallOnLayer: "a ball on a layer",
    PunchOnLayer: "a flat punch on a layer",
    CylinderBetweenPlates: "between plates",
    CylinderOnBlock: "a cylinder across a block",
    Bar: "a bar",
}


class SizeError(Exception):
    """A size, what is wrong with it and how to mend that."""


def sizes_of(given: SpecimenFile, specimen: SpecimenEntry | None) -> Sizes:
    """Return a specimen's test, with the sizes of its own.

    Raises
    ------
    SizeError
        For a size that the test hasn't, or that isn't given.
    """
    own = {key: getattr(specimen, key) for key in SIZES if getattr(specimen, key, None)}
    for key in own:
        if key not in type(given.test).model_fields:
            raise SizeError(key, "is no size of this test", "remove it")
    return _sizes(given.test.model_copy(update=own))


def sizes_text(sizes: Sizes) -> str:
    """Return a specimen's test with its sizes, as people read them."""
    told = (
        f"{name.replace('_', ' ')} "
        + (value if isinstance(value, str) else f"{value:g} {'mm²' if name == 'area' else 'mm'}")
        for name, value in asdict(sizes).items()
    )
    return f"{_WORDS[type(sizes)]}: {', '.join(told)}"


def _sizes(test: TestEntry) -> Sizes:
    match test:
        case BallEntry():
            return BallOnLayer(
                _given(test, "thickness_mm"), test.ball_diameter_mm / 2,
                _given(test, "diameter_mm") / 2, test.ball, test.base,
            )  # fmt: skip
        case PunchEntry():
            radius = test.punch_diameter_mm / 2
            return PunchOnLayer(
                _given(test, "thickness_mm"), radius, test.edge_mm or 0.05 * radius,
                _given(test, "diameter_mm") / 2, test.punch, test.base,
            )  # fmt: skip
        case PlatesEntry():
            diameter, height = _given(test, "diameter_mm"), _given(test, "height_mm")
            return CylinderBetweenPlates(diameter / 2, height, test.ends)
        case CylinderEntry():
            thickness, width, length = (
                _given(test, key) for key in ("thickness_mm", "width_mm", "length_mm")
            )
            radius = test.cylinder_diameter_mm / 2
            return CylinderOnBlock(thickness, width, length, radius, test.cylinder, test.base)
        case BarEntry():
            return Bar(_given(test, "length_mm"), _given(test, "area_mm2"), test.direction)


def _given(entry: FileTable, key: str) -> float:
    value: float | None = getattr(entry, key)
    if value is None:
        raise SizeError(key, "missing", "give it with the test, or with every [[specimen]]")
    return value
