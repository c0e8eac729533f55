r"""The 3D correction of the plane-strain force on the idealised leg (Eq. 3 of Frauziols et al.).

.. math:: P(d) = 1 - \frac{RF_{3D}(d) / L}{RF_{2D}(d)}, \qquad RF_{3D} = (1 - P)\, L\, RF_{2D},

with the cylinder's length :math:`L` and the plane-strain force per length :math:`RF_{2D}`. A
negative P says that plane strain gives too small a force.

**First contact.** At :math:`d = 0` the definition is 0/0, and as long as the contact is narrower
than an element its forces are those of single quadrature points. The ratio is therefore taken from
`FIRST_RATIO` on only, where a polynomial is fitted to it. Below, P goes on as
:math:`P_s + P_s' (d^2 - s^2) / 2 s` from the value and slope at :math:`s`: smooth, and level at
:math:`d = 0`.

**Stiffness.** P depends on the law only through :math:`D_1 C_{10}` and :math:`C_{20} / C_{10}`. The
table is over :math:`\ln C_{10}` and :math:`q = C_{20} / (C_{10} + C_{20})`, linear between its
points and constant beyond.

**Errors** are modes over d, each fully correlated and independent of the others: their outer
products add up to the covariance that an identification puts into its intervals.

**Of one leg**, from full solves of that leg in 3D at its own stiffness (`confirmed_correction`):

.. math:: P(d; m) = P_1(d; m_1) + P_0(d; m) - P_0(d; m_1)

with :math:`P_1` solved in full at the stiffness :math:`m_1`, and the trend of a table :math:`P_0`
of idealised legs between there and :math:`m`; without a table P is the same at any stiffness. The
trend is small where :math:`m_1` is near what is identified, and each further solve measures what is
wrong with it. Its error replaces that of the table.

**Fibres** along the muscle do no work in plane strain; under a cylinder that ends they bend and shear:

.. math:: RF_{3D}(d; r) = f(d; r)\, RF_{3D}(d; 1), \qquad r = \mu_L / \mu_T,

with the shear moduli along the leg and across, :math:`\mu_T = 2 C_{10}`. :math:`\ln f` comes from
3D solves of an idealised leg with fat and fascia (``python -m studies.fibres --table``), tabulated
over the depth and :math:`\ln r`, monotone between the points. What the table's leg isn't, nor its
mesh, changes :math:`\ln f` by a share of itself: its errors, the muscle's stiffness among them.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial
from scipy.interpolate import PchipInterpolator, RegularGridInterpolator

from legfem.common.documents import json_types, write_document
from legfem.common.errors import Argument, Command, InputError, Remedy
from legfem.common.resources import RESOURCES
from legfem.common.units import FloatArray, kpa_to_mpa, mpa_to_kpa
from legfem.inverse.catalogue import DEEP_C10, DEEP_C20, Values, deep_stiffness
from legfem.inverse.comparison import ErrorSource
from legfem.inverse.elastography import FibreRatio
from legfem.jobs.store import key_of
from legfem.solve.path import ForceCurve

SCHEMA = 2
"""Tables of schema 1 are read too: they have no digest of their content."""
KIND = "3d-correction"
DEFINITION = "P(d) = 1 - (RF3D(d) / L) / RF2D(d); RF3D = (1 - P) L RF2D"
FIRST_RATIO = 2.5
"""Displacement (mm) from which the ratio of the forces is used."""
_ORDER = 6
_STEP = 1e-4
"""Of a stiffness, for differences."""


def smooth_ratio(spatial: ForceCurve, plane: ForceCurve, displacement: FloatArray) -> FloatArray:
    """Return P at displacements (mm), smooth down to first contact.

    Parameters
    ----------
    spatial, plane
        Forces of the whole cylinder (N) in 3D and in plane strain.
    displacement
        mm, from 0 on.
    """
    first = FIRST_RATIO
    depth = min(spatial.depth, plane.depth)
    at = spatial.displacement[(spatial.displacement >= first) & (spatial.displacement <= depth)]
    order = min(_ORDER, len(at) - 1)
    fit = Polynomial.fit(at, 1 - spatial(at) / plane(at), order)
    value, slope = fit(first), fit.deriv()(first)
    below = value + slope * (displacement**2 - first**2) / (2 * first)
    return np.where(displacement < first, below, fit(np.maximum(displacement, first)))


def mesh_error(fine: FloatArray, rough: FloatArray, ratio: float) -> FloatArray:
    """Return the error of a fine mesh's P by Richardson's estimate, for second-order convergence.

    ``ratio`` is the size of the fine mesh's elements over that of the rough one's.
    """
    return np.asarray((fine - rough) / (ratio**-2 - 1))


def first_contact_error(
    spatial: ForceCurve, plane: ForceCurve, displacement: FloatArray, smooth: FloatArray
) -> FloatArray:
    """Return how far a smooth P is from the plain ratio of the forces, zero without force."""
    force = plane(displacement)
    with np.errstate(invalid="ignore", divide="ignore"):
        plain = 1 - spatial(displacement) / force
    return np.where(force > 0, plain - smooth, 0.0)


@dataclass(frozen=True, eq=False)
class TabulatedCorrection:
    """P(d) for a range of the deep tissue's stiffness.

    Parameters
    ----------
    name
        What reports call it.
    displacement
        (n,), mm.
    c10
        (m,), MPa.
    stiffening
        (k,), :math:`q = C_{20} / (C_{10} + C_{20})`.
    values
        P, (m, k, n).
    errors
        Modes of P's error, (n,) each, by what causes them.
    given
        Geometry, material, mesh and numbers of the calibration, for the file.
    sources
        Sources that errors count to, by name; of others that is the ends.
    beyond
        Girth and depth to the bone (mm) of a limb beyond the table that it is from; empty within it.
    """

    name: str
    displacement: FloatArray
    c10: FloatArray
    stiffening: FloatArray
    values: FloatArray
    errors: Mapping[str, FloatArray]
    given: Mapping[str, Any] = field(default_factory=dict)
    sources: Mapping[str, ErrorSource] = field(default_factory=dict)
    beyond: Mapping[str, float] = field(default_factory=dict)

    @cached_property
    def _table(self) -> RegularGridInterpolator:
        """Interpolation; a single point of an axis stands for all its values."""
        values, wide = self.values, []
        for number, axis in enumerate((np.log(self.c10), self.stiffening, self.displacement)):
            if len(axis) == 1:
                axis = np.array([axis[0], axis[0] + 1])
                values = np.repeat(values, 2, axis=number)
            wide.append(axis)
        return RegularGridInterpolator(tuple(wide), values)

    def correction(self, displacement: FloatArray, c10: FloatArray, c20: FloatArray) -> FloatArray:
        """Return P (..., n) at displacements (n,) in mm for stiffnesses (...) in MPa."""
        c10, c20 = (np.asarray(one, dtype=float)[..., None] for one in (c10, c20))
        at = np.stack(np.broadcast_arrays(np.log(c10), c20 / (c10 + c20), displacement), axis=-1)
        return np.asarray(self._table(np.clip(at, *np.array([(axis[0], axis[-1]) for axis in self._table.grid]).T)))

    def factor(self, displacement: FloatArray, c10: FloatArray, c20: FloatArray) -> FloatArray:
        """Return ``1 - P`` (..., n)."""
        return 1 - self.correction(displacement, c10, c20)

    def relative_errors(self, displacement: FloatArray, c10: float, c20: float) -> dict[str, FloatArray]:
        """Return the modes (n,) of P's error, relative to the corrected force.

        The force's relative error is that of P over the factor.
        """
        factor = self.factor(displacement, np.asarray(c10), np.asarray(c20))
        return {name: np.interp(displacement, self.displacement, mode) / factor for name, mode in self.errors.items()}

    def standard_deviation(self, displacement: FloatArray) -> FloatArray:
        """Return that of P's error at displacements (n,) in mm."""
        modes = [np.interp(displacement, self.displacement, m) for m in self.errors.values()]
        return np.sqrt(np.sum(np.square(modes), axis=0))

    def write(self, path: Path) -> Path:
        """Write the correction as JSON."""
        told = {"name": self.name, "definition": DEFINITION, "first_ratio_mm": FIRST_RATIO, **self.given}
        rounded = (
            np.round(column, 7) for column in (self.displacement, mpa_to_kpa(self.c10), self.stiffening, self.values)
        )
        columns = dict(zip(_COLUMNS, rounded, strict=True))
        return write_table(path, KIND, told, columns, {name: np.round(mode, 7) for name, mode in self.errors.items()})


_COLUMNS = ("displacement_mm", "c10_kPa", "c20_over_c10_plus_c20", "P")


def write_table(
    path: Path, kind: str, told: Mapping[str, Any], columns: Mapping[str, FloatArray], errors: Mapping[str, FloatArray]
) -> Path:
    """Write a table as JSON.

    Parameters
    ----------
    path
        Of the file.
    kind
        Of the table.
    told
        How it was made.
    columns
        Its arrays.
    errors
        Modes of its error, by what causes them.
    """
    content = json_types({"schema": SCHEMA, "kind": kind, **told, **columns, "errors": errors})
    return write_document(path, {**content, "digest": key_of(content)})


def read_table(
    path: Path, kind: str, columns: Sequence[str], command: Command
) -> tuple[list[FloatArray], dict[str, FloatArray], dict[str, Any]]:
    """Return a table's columns, the modes of its error, and what else is told of it.

    Parameters
    ----------
    path, kind, columns
        As they were written.
    command
        That writes such a file.

    Raises
    ------
    InputError
        If there is none, or it is not a whole table.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        remedy = Remedy("give a file that ", command, " wrote, or none")
        raise InputError(path, Argument("correction"), f"can't be read ({error})", remedy) from None
    if not isinstance(content, dict) or content.get("kind") != kind:
        raise InputError(path, "kind", f"is not {kind}", "give a file that legfem.study correction wrote")
    schema, digest = content.get("schema"), content.pop("digest", None)
    if schema not in (1, SCHEMA):
        raise InputError(path, "schema", f"is {schema}", f"this legfem reads schemas 1 and {SCHEMA}")
    if schema != 1 and digest != key_of(content):
        raise InputError(path, "digest", "isn't that of its content, which changed since", "calibrate it again")
    try:
        arrays = [np.array(content[name], dtype=float) for name in columns]
        errors = {name: np.array(mode, dtype=float) for name, mode in content["errors"].items()}
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(path, columns[-1], f"is not a whole correction ({error!r})", "calibrate it again") from None
    known = (*columns, "errors", "schema", "kind")
    return arrays, errors, {name: value for name, value in content.items() if name not in known}


def read_correction(path: Path) -> TabulatedCorrection:
    """Read a correction's file.

    Raises
    ------
    InputError
        If there is none, or it is not a whole correction.
    """
    (displacement, c10, stiffening, values), errors, told = read_table(
        path, KIND, _COLUMNS, Command("study correction")
    )
    shape = (len(c10), len(stiffening), len(displacement))
    fits = values.shape == shape and all(len(mode) == shape[2] for mode in errors.values())
    axes = (c10, stiffening, displacement)
    sound = all(len(axis) > 0 and np.all(np.diff(axis) > 0) for axis in axes) and np.all(c10 > 0)
    if not (fits and sound and np.all(np.isfinite(values)) and np.all(values < 1)):
        raise InputError(
            path, "P", f"has shape {values.shape} on axes of {shape}, or values that can't be", "calibrate it again"
        )
    given = {name: value for name, value in told.items() if name not in ("name", "definition", "first_ratio_mm")}
    name = str(told.get("name", path.stem))
    return TabulatedCorrection(name, displacement, kpa_to_mpa(c10), stiffening, values, errors, given)


def corrected(
    correction: TabulatedCorrection | None,
    displacement: FloatArray,
    force: FloatArray,
    by: Mapping[str, FloatArray],
    values: Values,
) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Return forces at displacements (n,), mm, and their derivatives, times a correction's factor.

    Parameters
    ----------
    correction
        There is a factor of one without it.
    displacement
        (n,), mm.
    force
        (n,), N, in plane strain.
    by
        Its derivatives (n,) by the model's parameters, by name.
    values
        Of the model: MPa.
    """
    if correction is None:
        return force, dict(by)
    c10, c20 = deep_stiffness(values)

    def factor_at(one: float, other: float) -> FloatArray:
        return np.asarray(correction.factor(displacement, np.asarray(one), np.asarray(other)))

    factor = factor_at(c10, c20)
    found: dict[str, FloatArray] = {name: factor * derivative for name, derivative in by.items()}
    further, stiffening = c10 * (1 + _STEP), c20 + _STEP * c10
    for name, ends in ((DEEP_C10, (further, c20)), (DEEP_C20, (c10, stiffening))):
        if name in found:
            step = (ends[0] - c10) + (ends[1] - c20)
            found[name] = found[name] + force * (factor_at(*ends) - factor) / step
    return np.asarray(factor * force), found


def confirmed_correction(
    name: str,
    trend: TabulatedCorrection | None,
    stiffness: tuple[float, float],
    displacement: FloatArray,
    P: FloatArray,
    errors: Mapping[str, FloatArray],
    sources: Mapping[str, ErrorSource],
) -> TabulatedCorrection:
    """Return the correction of a leg that was solved in 3D.

    Parameters
    ----------
    name
        What reports call it.
    trend
        How P changes with the stiffness; not at all without one.
    stiffness
        C10 and C20 of the deep tissue (MPa) that it was solved with.
    displacement, P
        (n,), mm and what was found there.
    errors, sources
        Modes of P's error, (n,) each, by what causes them, and what these count to.
    """
    c10, c20 = stiffness
    if trend is None:
        at = np.array([c10]), np.array([c20 / (c10 + c20)])
        return TabulatedCorrection(name, displacement, *at, P[None, None, :], errors, sources=sources)
    across, q = trend.c10[:, None], trend.stiffening[None, :]
    table = trend.correction(displacement, across + 0 * q, across * q / (1 - q))
    there = trend.correction(displacement, np.asarray(c10), np.asarray(c20))
    of_leg = replace(trend, name=name, displacement=displacement, values=P + table - there, given={}, beyond={})
    return replace(of_leg, errors=errors, sources=sources)


FIBRES = "fibres: "
"""Beginning of the names of a correction's errors by muscle fibres."""
FIBRES_TABLE = RESOURCES / "frauziols" / "correction-fibres.json"
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
        columns = dict(zip(_OF_FIBRES, (self.ratio, self.displacement, np.round(self.log_factor, 5)), strict=True))
        errors = {name: np.round(share, 4) for name, share in self.errors.items()}
        return write_table(path, FIBRES_KIND, self.given, columns, errors)


_OF_FIBRES = ("ratio", "displacement_mm", "log_factor")


@cache
def read_fibres(path: Path = FIBRES_TABLE) -> FibreTable:
    """Read a table that ``python -m studies.fibres --table`` wrote."""
    (ratio, displacement, log), errors, given = read_table(path, FIBRES_KIND, _OF_FIBRES, Command("study correction"))
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
