"""The kinds of tests on specimens, one a file, and those of other packages.

A module of this folder gives the subclass of `legfem.specimens.kind.SpecimenKind` that it defines. Another package
gives kinds under the entry point group "legfem.specimens".
"""

import sys
from functools import cache
from typing import Any

from legfem.common.registry import registered
from legfem.specimens.kind import SpecimenKind

GROUP = "legfem.specimens"


@cache
def kinds() -> dict[str, SpecimenKind[Any, Any]]:
    """Return all kinds by their table of ``specimen.toml``."""
    return {one.table: one for one in registered(sys.modules[__name__], SpecimenKind, GROUP)}


def kind_of(body: type) -> SpecimenKind[Any, Any]:
    """Return the kind whose sizes are of a type."""
    every = kinds().values()
    return next((one for one in every if one.body is body), None) or next(
        one for one in every if issubclass(body, one.body)
    )
