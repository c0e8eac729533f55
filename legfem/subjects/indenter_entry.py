"""``[indenter]`` of ``subject.toml``: what presses a leg, and where it stands."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from legfem.common.toml_file import FileTable, Finite, Text, trouble
from legfem.subjects.subject import IndenterShape

Vector = Annotated[list[Finite], Field(min_length=3, max_length=3)]


class IndenterEntry(FileTable):
    """``[indenter]``."""

    # Below 1 mm it is most likely metres or centimetres.
    diameter_mm: Annotated[float, Field(ge=1.0, le=300.0, allow_inf_nan=False)]
    length_mm: Annotated[float, Field(ge=1.0, le=1000.0, allow_inf_nan=False)] | None = None
    """Of a cylinder, which has to have one."""
    shape: IndenterShape = "cylinder"
    """A punch is a cylinder that is pressed with its flat end."""
    axis_deg: Finite | None = None
    """By which a cylinder is turned about its travel: 0 lies along the leg, 90 across it."""
    aim_mm: Annotated[list[Finite], Field(min_length=2, max_length=2)] | None = None
    direction_deg: Finite | None = None

    position_mm: Vector | None = None
    """A point on the line of travel in the scan, in the place of ``aim_mm``."""
    direction: Vector | None = None
    """Of travel in the scan, in the place of ``direction_deg``."""
    axis: Vector | None = None
    """Of the cylinder in the scan; without it across the travel, as near to z as that is."""
    landmarks: Text | None = None
    """CSV of points in the coordinates of the pose and in the scan's, where they differ."""

    @model_validator(mode="after")
    def _one_kind(self) -> IndenterEntry:
        if self.shape == "cylinder" and self.length_mm is None:
            raise trouble("length_mm", "missing", "give the cylinder's length")
        for key in ("axis_deg", "axis"):
            if self.shape != "cylinder" and getattr(self, key) is not None:
                raise trouble(key, f"is of no use for a {self.shape}", "leave it out")
        if self.axis is not None and self.axis_deg is not None:
            raise trouble("axis_deg", "is given beside axis", "give one of them")
        return self

    @property
    def own_length(self) -> float:
        """Of a cylinder (mm); of a ball or punch, whose length has no effect, its diameter."""
        if self.shape != "cylinder" or self.length_mm is None:
            return self.diameter_mm
        return self.length_mm

    @model_validator(mode="after")
    def _one_place(self) -> IndenterEntry:
        for flat, spatial in (("aim_mm", "position_mm"), ("direction_deg", "direction")):
            if (getattr(self, flat) is None) == (getattr(self, spatial) is None):
                what = "missing" if getattr(self, flat) is None else f"given beside {spatial}"
                raise trouble(flat, what, f"give {flat} in the section's plane, or {spatial} in the scan")
        if (self.position_mm is None) != (self.direction is None):
            raise trouble(
                "direction",
                "position_mm and direction belong together",
                "give both in the scan, or aim_mm and direction_deg in the section's plane",
            )
        for key in ("axis", "landmarks"):
            if getattr(self, key) is not None and self.position_mm is None:
                raise trouble(key, "is of use with position_mm alone", "leave it out")
        for key in ("direction", "axis"):
            if getattr(self, key) is not None and not any(getattr(self, key)):
                raise trouble(key, "has no length", "give a vector")
        return self
