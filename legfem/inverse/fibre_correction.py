r"""What fibres along the muscle do to the force of a short cylinder, tabulated.

.. math:: RF_{3D}(d; r) = f(d; r)\, RF_{3D}(d; 1), \qquad r = \mu_L / \mu_T,

with the shear moduli along the leg and across, :math:`\mu_T = 2 C_{10}`. In plane strain fibres
along the leg do no work; under a cylinder that ends they bend and shear. :math:`\ln f` comes from
3D solves of an idealised leg with fat and fascia (``python -m studies.fibres --table``), tabulated
over the depth and :math:`\ln r`, monotone between the points. What the table's leg isn't, nor its
mesh, changes :math:`\ln f` by a share of itself: its errors, the muscle's stiffness among them.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator

from legfem.common.errors import Command
from legfem.common.resources import RESOURCES
from legfem.common.units import FloatArray
from legfem.inverse.comparison import ErrorSource
from legfem.inverse.correction import TabulatedCorrection, read_table, write_table
from legfem.inverse.elastography import FibreRatio

FIBRES = "fibres: "
"""Beginning of the names of a correction's errors by muscle fibres."""
TABLE = RESOURCES / "frauziols" / "correction-fibres.json"
FIBRES_KIND = "fibres-of-legs"


@dataclass(frozen=True, eq=False)
class FibreTable:
    """The logarithm of the factor on a leg's force.

    Parameters
    ----------
    ratio
        Of the shear moduli along the leg and across, over 1; (r,).
    displacement
        (n,), mm.
    log_factor
        (r, n).
    errors
        By what causes them: standard deviations as shares of the logarithm, (n,) each.
    given
        How it was made, for the file.
    """

    ratio: FloatArray
    displacement: FloatArray
    log_factor: FloatArray
    errors: Mapping[str, FloatArray]
    given: Mapping[str, Any]

    def log_at(self, ratio: float, displacement: FloatArray) -> FloatArray:
        """Return the factor's logarithm (n,) at displacements (n,) in mm, level beyond the last."""
        return np.interp(displacement, self.displacement, self._by_ratio(np.log(ratio)))

    def slope_at(self, ratio: float, displacement: FloatArray) -> FloatArray:
        """Return its derivative (n,) by the ratio's logarithm."""
        return np.interp(displacement, self.displacement, self._by_ratio(np.log(ratio), 1))

    def errors_at(self, displacement: FloatArray) -> dict[str, FloatArray]:
        """Return its errors (n,) by cause, as shares of itself."""
        return {name: np.interp(displacement, self.displacement, share) for name, share in self.errors.items()}

    @cached_property
    def _by_ratio(self) -> PchipInterpolator:
        nodes = np.log([1.0, *self.ratio])
        return PchipInterpolator(nodes, [np.zeros(len(self.displacement)), *self.log_factor])

    def write(self, path: Path) -> Path:
        """Write the table as JSON."""
        columns = dict(zip(_COLUMNS, (self.ratio, self.displacement, np.round(self.log_factor, 5)), strict=True))
        errors = {name: np.round(share, 4) for name, share in self.errors.items()}
        return write_table(path, FIBRES_KIND, self.given, columns, errors)


_COLUMNS = ("ratio", "displacement_mm", "log_factor")


@cache
def read_fibres(path: Path = TABLE) -> FibreTable:
    """Read a table that ``python -m studies.fibres --table`` wrote."""
    (ratio, displacement, log), errors, given = read_table(path, FIBRES_KIND, _COLUMNS, Command("study correction"))
    return FibreTable(ratio, displacement, log, errors, given)


def with_fibres(correction: TabulatedCorrection, table: FibreTable, fibres: FibreRatio) -> TabulatedCorrection:
    """Return a correction of muscle with fibres, given that of muscle alike in all directions.

    Its errors stay what they are of the force, and those of the ratio and of the table join them.
    """
    d = correction.displacement
    log, slope = table.log_at(fibres.value, d), table.slope_at(fibres.value, d)
    factor = np.exp(log)
    force = (1 - correction.values) * factor
    usual = np.mean(force, axis=(0, 1))
    of_fibres = {
        f"{FIBRES}ratio": -usual * slope * fibres.sd / fibres.value,
        **{f"{FIBRES}{name}": -usual * log * share for name, share in table.errors_at(d).items()},
    }
    name = f"{correction.name}, muscle {fibres} times as stiff in shear along the leg as across"
    errors = {**{name: mode * factor for name, mode in correction.errors.items()}, **of_fibres}
    source: ErrorSource = "fibres"
    sources = {**correction.sources, **dict.fromkeys(of_fibres, source)}
    return replace(correction, name=name, values=1 - force, errors=errors, sources=sources)
