"""How stiff fat and muscle of living people are: the prior where nothing is known of a person.

The table comes from ``python -m studies.people``, whose page says how it was found and what it
isn't good for.
"""

from __future__ import annotations

import json
from functools import cache
from typing import Literal

from pydantic import BaseModel

from legfem.common.units import kpa_to_mpa
from legfem.data.folder import RESOURCES
from legfem.inverse.parameter import Prior

TABLE = RESOURCES / "people" / "population.json"
CALF = "LL_P"
"""The site of a leg's indentation."""
SHIN = "LL_A"
"""The front of a lower leg."""
TISSUES: dict[str, Literal["superficial", "deep"]] = {"superficial.C10": "superficial", "deep.C10": "deep"}
"""Parameters that the table knows, by full name."""


class TissuePopulation(BaseModel):
    """C10 of one tissue at one site, over people: its logarithm is normal."""

    C10_median_kPa: float
    log_sd: float
    """Of a person not yet seen: how people differ, and how well the median is known."""
    log_sd_of_the_median: float


class SitePopulation(BaseModel):
    """Both tissues of one site."""

    superficial: TissuePopulation
    """Skin and fat."""
    deep: TissuePopulation
    """Muscle."""
    correlation: float
    """Of both logarithms."""


class Population(BaseModel):
    """The table as it is shipped."""

    schema_version: int
    source: str
    people: int
    poisson_ratio: float
    sites: dict[str, SitePopulation]
    """By the names of MULTIS; over all of them under ``all sites``."""


@cache
def population() -> Population:
    """Return the shipped table."""
    return Population.model_validate(json.loads(TABLE.read_text(encoding="utf-8")))


def population_prior(name: str, site: str = CALF) -> Prior:
    """Return the prior of a stiffness at a site (MPa).

    Parameters
    ----------
    name : str
        One of `TISSUES`.
    site : str
        One of the table's.

    Raises
    ------
    KeyError
        For a parameter or site that the table doesn't know.
    """
    table = population()
    tissue: TissuePopulation = getattr(table.sites[site], TISSUES[name])
    return Prior(kpa_to_mpa(tissue.C10_median_kPa), tissue.log_sd, "log", table.source)
