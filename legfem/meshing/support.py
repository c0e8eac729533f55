"""Which displacements of a mesh's facets are held."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Support:
    """Displacement components that are zero on the facets of a tag."""

    tag: int
    components: tuple[int, ...]
