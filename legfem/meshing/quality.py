"""Quality of a mesh's elements, as gmsh measures it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gmsh
import numpy as np

from legfem.meshing.gmsh_mesh import gmsh_model


@dataclass(frozen=True)
class MeshQuality:
    """Signed inverse condition number (1 ideal, 0 degenerate, below 0 inverted) by region."""

    minimum: Mapping[str, float]
    mean: Mapping[str, float]
    elements: Mapping[str, int]

    @property
    def worst(self) -> float:
        """The worst element's quality."""
        return min(self.minimum.values())

    @property
    def worst_region(self) -> str:
        """The region that holds the worst element."""
        return min(self.minimum, key=self.minimum.__getitem__)


def element_quality(model: Any, regions: Mapping[str, int], dimension: int = 2) -> MeshQuality:
    """Measure every region (name to physical tag) of a meshed gmsh model."""
    minimum, mean, count = {}, {}, {}
    for name, tag in regions.items():
        elements = [
            tags
            for entity in model.getEntitiesForPhysicalGroup(dimension, tag)
            for tags in model.mesh.getElements(dimension, entity)[1]
        ]
        quality = np.asarray(model.mesh.getElementQualities(np.concatenate(elements), "minSICN"))
        minimum[name], mean[name] = float(quality.min()), float(quality.mean())
        count[name] = quality.size
    return MeshQuality(minimum, mean, count)


def quality_of_file(path: Path) -> MeshQuality:
    """Measure the regions of a mesh that gmsh can read: its physical groups of full dimension."""
    with gmsh_model("file") as model:
        gmsh.open(str(path))
        dimension = model.getDimension()
        groups = model.getPhysicalGroups(dimension)
        regions = {model.getPhysicalName(dimension, tag): tag for _, tag in groups}
        return element_quality(model, regions, dimension)
