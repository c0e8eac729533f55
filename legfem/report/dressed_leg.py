"""The leg in its stocking on a page, to be turned and dressed."""

from collections.abc import Mapping, Sequence

import numpy as np

from legfem.common.units import FloatArray, mpa_to_mmhg
from legfem.geometry.leg_shape import SKIN, LegShape
from legfem.geometry.motion import inward, stretch_round
from legfem.report.leg_3d_view import Marked, SkinField, from_none, turned_leg
from legfem.report.page import Slider, TurnedLeg, View
from legfem.report.words import Directions
from legfem.stockings.details import StockingDetails


def dressed_leg(details: StockingDetails, moved: Mapping[str, FloatArray]) -> TurnedLeg:
    """Return the leg with the stocking's pressure, its movement and the skin's stretch.

    Parameters
    ----------
    details
        Of a run whose worn state was found.
    moved
        Displacement (mm) of skin's and hull's points, (n_levels, n_points, 3) each.
    """
    bare, found = details.leg.bare, details.pressures
    assert found is not None
    dressed = {
        ("pressure on the skin", "mmHg"): mpa_to_mmhg(details.equilibrium.pressure),
        ("inward movement", "mm"): inward(bare, moved[SKIN]),
        ("stretch of the skin round the leg", "%"): stretch_round(bare, moved[SKIN]),
    }
    fields = [SkinField(*named, from_none([values])) for named, values in dressed.items()]
    each = [f"{name} ({unit}): {which}" for name, unit in dressed for which in ("mean", "least", "most")]
    directions = Directions.of(bare)
    marked = [
        Marked(f"{vein.name}: {mpa_to_mmhg(p):.1f} mmHg", vein.position)
        for vein, p in zip(details.leg.veins, found.at_veins, strict=True)
        if np.isfinite(p)
    ]
    return turned_leg(
        bare,
        {part: from_none([values]) for part, values in moved.items()},
        fields,
        Slider("Dress the leg", (0.0, 100.0), " % dressed"),
        # Coordinates are DICOM's: the front is at -y.
        View([directions.at(45.0 * k) for k in range(8)]),
        ["height z (mm)", "girth, bare (mm)", "girth, dressed (mm)", *each],
        by_height(bare, moved[SKIN], list(dressed.values())),
        "The leg's skin, coloured by what the stocking does to it; inside it muscle, bones and "
        "veins. Bare and dressed were computed; what lies between is drawn in proportion.",
        marked,
    )


def by_height(bare: LegShape, moved: FloatArray, fields: Sequence[FloatArray]) -> list[list[str]]:
    """Return a row a height: girths, and mean, least and most of fields (n_levels, n_points)."""

    def girths(points: FloatArray) -> FloatArray:
        return np.linalg.norm(np.diff(points, axis=1, append=points[:, :1]), axis=2).sum(axis=1)

    points = bare.points(SKIN)
    before, after = girths(points), girths(points + moved)
    return [
        [
            f"{level:.0f}",
            f"{before[k]:.1f}",
            f"{after[k]:.1f}",
            *(f"{value:.1f}" for f in fields for value in (f[k].mean(), f[k].min(), f[k].max())),
        ]
        for k, level in enumerate(bare.levels)
    ]
