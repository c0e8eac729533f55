"""The table of in vivo indentations: one person and site a row."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from legfem.common.errors import InputError
from legfem.common.units import FloatArray

FILE = "indentation.csv"
SITES = {
    "UA_A": "upper arm, front",
    "UA_P": "upper arm, back",
    "LA_A": "forearm, front",
    "LA_P": "forearm, back",
    "UL_A": "thigh, front",
    "UL_P": "thigh, back",
    "LL_A": "shin",
    "LL_P": "calf",
}
"""By the table's names."""
_NUMBERS = (
    "MaxForce",
    "maxForce_normArea",
    "Thickness",
    "Skin",
    "Fat",
    "Muscle",
    "SkinStrain",
    "fat_disp",
    "muscle_disp",
    "Total_Stiff",
)


@dataclass(frozen=True, eq=False)
class Indentations:
    """Presses of a flat probe on people's limbs, at the deepest image; arrays are (n,).

    Skin counts with fat as the superficial tissue: of the skin's 1.5 mm the images tell no change.
    """

    people: tuple[str, ...]
    """Names of the persons."""
    sites: tuple[str, ...]
    """Names of the sites."""
    person: NDArray[np.int64]
    """Place in ``people``."""
    site: NDArray[np.int64]
    """Place in ``sites``."""
    force: FloatArray
    """N."""
    area: FloatArray
    """Of the probe's face, mm2."""
    superficial: FloatArray
    """Thickness without load, mm."""
    deep: FloatArray
    """Thickness without load, mm."""
    superficial_loss: FloatArray
    """Of thickness under the force, mm."""
    deep_loss: FloatArray
    """Of thickness under the force, mm."""
    compliance: FloatArray
    """Thickness lost per pressure along the whole press, by a straight line, mm/MPa."""
    typical: FloatArray
    """Geometric mean of both thicknesses at every site (sites, 2), mm."""

    def __len__(self) -> int:
        return len(self.force)

    @property
    def relative_thickness(self) -> FloatArray:
        """Logarithms of both thicknesses over `typical` (n, 2)."""
        own = np.stack([self.superficial, self.deep], axis=1)
        return np.log(own / self.typical[self.site])

    @property
    def radius(self) -> FloatArray:
        """Of the circle of the probe's area (mm)."""
        return np.sqrt(self.area / np.pi)

    @property
    def secant_compliance(self) -> FloatArray:
        """Thickness lost at the deepest image over the pressure there, mm/MPa."""
        return (self.superficial_loss + self.deep_loss) * self.area / self.force

    def where(self, kept: NDArray[np.bool_]) -> Indentations:
        """Return some rows, with the names of all people and sites."""
        arrays = {
            entry.name: getattr(self, entry.name)[kept]
            for entry in fields(self)
            if entry.name not in ("people", "sites", "typical")
        }
        return replace(self, **arrays)


def read_indentations(folder: Path) -> Indentations:
    """Read the table; rows without a thickness or a change of it are left out.

    Raises
    ------
    InputError
        If the table isn't there, lacks a column, or has nothing to use.
    """
    path = folder / FILE
    try:
        table = pd.read_csv(path, dtype={"SubID": str, "Location": str})
    except (OSError, ValueError) as error:
        remedy = "give --data the folder of the MULTIS table (doi 10.18735/S5R97F)"
        raise InputError(str(path), "table", f"can't be read ({type(error).__name__})", remedy) from error
    missing = {"SubID", "Location", *_NUMBERS} - set(table.columns)
    if missing:
        remedy = "give the table as it is published, with all its columns"
        raise InputError(str(path), sorted(missing)[0], "no such column", remedy)
    numbers = table[list(_NUMBERS)].apply(pd.to_numeric, errors="coerce")
    positive = numbers[["MaxForce", "maxForce_normArea", "Thickness", "Fat", "Muscle", "Total_Stiff"]]
    good = np.isfinite(numbers).all(axis=1) & (positive > 0).all(axis=1)
    good &= table["Location"].isin(SITES) & table["SubID"].notna()
    table, numbers = table[good], numbers[good]
    if not len(table):
        remedy = "give forces in N, thicknesses in mm, pressures in MPa"
        raise InputError(str(path), "", "contains no person with all numbers", remedy)
    people = tuple(sorted(set(table["SubID"])))
    sites = tuple(site for site in SITES if site in set(table["Location"]))
    get = {name: numbers[name].to_numpy(dtype=float) for name in _NUMBERS}
    layers = np.stack([get["Skin"] + get["Fat"], get["Muscle"]], axis=1)
    site = np.array([sites.index(name) for name in table["Location"]])
    return Indentations(
        people,
        sites,
        np.array([people.index(name) for name in table["SubID"]]),
        site,
        get["MaxForce"],
        np.round(get["MaxForce"] / get["maxForce_normArea"], 1),
        layers[:, 0],
        layers[:, 1],
        get["SkinStrain"] * get["Skin"] + get["fat_disp"],
        get["muscle_disp"],
        1 / get["Total_Stiff"],
        geometric_means(layers, site, len(sites)),
    )


def geometric_means(layers: FloatArray, site: NDArray[np.int64], count: int) -> FloatArray:
    """Return the geometric mean (count, 2) of thicknesses (n, 2) by site."""
    return np.array([np.exp(np.log(layers[site == k]).mean(axis=0)) for k in range(count)])
