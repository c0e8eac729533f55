"""How stiff fat and muscle of living people are: the prior where nothing is known of a person.

The table comes from ``python -m studies.people``, whose page says how it was found and what it
isn't good for.
"""

import json
import math
from functools import cache
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, PositiveFloat, ValidationError

from legfem.common.errors import Argument, Command, InputError, Remedy
from legfem.common.input_files import read_text
from legfem.common.resources import RESOURCES
from legfem.common.units import kpa_to_mpa
from legfem.inverse.catalogue import key_of
from legfem.inverse.parameter import Prior

TABLE = RESOURCES / "people" / "population.json"
CALF = "LL_P"
"""The site of a leg's indentation."""
SHIN = "LL_A"
"""The front of a lower leg."""
ANYWHERE = "all sites"
"""Of arms and legs together."""
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


AGE = "age's exponent"
"""Effect of the logarithm of people's ages."""


class CohortParameter(BaseModel, allow_inf_nan=False):
    """A stiffness over the people of a cohort: in somebody new its logarithm is normal."""

    median: PositiveFloat
    """kPa."""
    log_sd: PositiveFloat
    people: int
    law: str
    source: str
    log_effects: dict[str, dict[str, Any]] = {}
    """Of groups and covariates."""
    log_ages: tuple[float, float, float, float] | None = None
    """Mean, standard deviation, least and greatest logarithm of the people's ages, where they were given."""

    def at(self, age: float) -> tuple[float, float]:
        """Return the median (kPa) and its logarithm's standard deviation in people of an age; NaN of ages not seen."""
        mean, sd, low, high = self.log_ages or (math.nan,) * 4
        if not low <= math.log(age) <= high:
            return math.nan, math.nan
        power = self.log_effects[AGE]["value"]
        own = math.sqrt(abs(self.log_sd**2 - (power * sd) ** 2))
        return self.median * math.exp(power * (math.log(age) - mean)), own


class CohortPopulation(BaseModel):
    """What ``legfem cohort --population`` writes."""

    schema_version: Literal[1]
    parameters: dict[str, CohortParameter]
    """By key: ``c10_deep``."""


def read_cohort_population(path: Path) -> CohortPopulation:
    """Read what a cohort found of its people; raises InputError if the file can't be read."""
    remedy = Remedy("give the population.json that ", Command("cohort", (Argument("population"),), "FOLDER"), " wrote")
    try:
        return CohortPopulation.model_validate_json(read_text(path, remedy, remedy))
    except ValidationError:
        raise InputError(path, "JSON", "contains no population", remedy) from None


def cohort_prior(name: str, path: Path) -> Prior:
    """Return the prior of a stiffness (MPa) that a cohort's file holds.

    Raises
    ------
    InputError
        If the file can't be read, or doesn't have it.
    """
    found = read_cohort_population(path)
    if key_of(name) not in found.parameters:
        raise InputError(path, key_of(name), "is not in it", f"there is {', '.join(found.parameters)}")
    one = found.parameters[key_of(name)]
    source = f"{one.people} people of {one.source}, {one.law}"
    return Prior(kpa_to_mpa(one.median), one.log_sd, "log", source)
