"""The numbers of a leg in its stocking, and where each comes from."""

from __future__ import annotations

import numpy as np

from legfem.common.units import mpa_to_kpa, mpa_to_mmhg
from legfem.report.estimates import modulus_rows
from legfem.report.page import Known, Provenance
from legfem.report.web.stocking_pressures import (
    both_units,
    low_in_fat,
    sensor_rows,
    stiffness_interval,
    tension_text,
    vein_interval,
)
from legfem.stockings.notices import TISSUES
from legfem.stockings.result import StockingResult


def known_of(result: StockingResult) -> list[Known]:
    """Return the stiffness, the pressures, and what they rest on."""
    leg = result.leg
    data: Provenance = leg.origin
    rows = []
    for known in result.estimates:
        bound = f"; at the {known.at_bound} bound of the search" if known.at_bound else ""
        rows.append(
            Known(
                f"C10 of the {TISSUES[known.name]}",
                f"{mpa_to_kpa(known.value):.3g} kPa",
                "estimated",
                "both scans",
                stiffness_interval(known.ci95),
                f"{known.identifiability}{bound}",
            )
        )
    if leg.known:
        rows += [
            Known(
                f"C10 of the {TISSUES[name]}, used for the pressures",
                f"{mpa_to_kpa(value):.3g} kPa",
                "assumed",
                "leg.toml",
            )
            for name, value in result.parameters.items()
        ]
    rows += [*_pressures(result), *_stocking(result)]
    rows += [
        Known(f"D1 of the {TISSUES[f'{name}.C10']}", f"{law.D1:g} 1/MPa", "assumed", "leg.toml")
        for name, law in leg.tissues.items()
    ]
    accuracy = leg.accuracy
    if leg.compressed is not None:
        rows.append(
            Known(
                "error of a scan's outline",
                f"{accuracy.sd:.2g} mm (sd)",
                "prior",
                "leg.toml, or legfem's usual",
                remark=f"alike over {accuracy.correlation:g} mm",
            )
        )
    rows.append(
        Known(
            "error of the stocking's pressure round the leg",
            f"{100 * accuracy.pressure_sd:g} % (sd)",
            "prior",
            "leg.toml, or legfem's usual",
        )
    )
    if (text := tension_text(result)) is not None:
        rows.append(
            Known(
                "tension of the fabric over what was given",
                text,
                "estimated",
                "both scans" + (" and the sensors" if result.sensors else ""),
            )
        )
    rows += [
        Known(f"pressure on the skin, sensor {name}", text, data, "leg.toml") for name, text in sensor_rows(result)
    ]
    rows += modulus_rows(leg.elastography, leg.origin)
    if leg.registration is not None:
        rows.append(
            Known(
                "bones of both scans, apart after registration",
                f"{leg.registration.residual:.2f} mm (rms)",
                data,
                "both scans",
            )
        )
    rows.append(Known("length of leg that was modelled", f"{leg.bare.length:.0f} mm", data, "scan of the bare leg"))
    return rows


def _pressures(result: StockingResult) -> list[Known]:
    found = result.pressures
    if found is None:
        return []
    rows = [
        Known(
            f"pressure at the {vein.name} vein",
            both_units(pressure),
            "computed",
            "the model in equilibrium with its stocking",
            f"{low:.1f} to {high:.1f} mmHg" if np.isfinite(high) else "",
            f"{100 * pressure / found.mean_interface:.0f} % of the mean on the skin",
        )
        for k, (vein, pressure) in enumerate(zip(result.leg.veins, found.at_veins, strict=True))
        if np.isfinite(pressure)
        for low, high in [vein_interval(result, k)]
    ]
    source = "the model in equilibrium with its stocking"
    return [
        Known(
            "pressure on the skin, mean",
            both_units(found.mean_interface),
            "computed",
            "Laplace's law on the dressed leg",
        ),
        *rows,
        Known(
            "pressure in the fat, greatest",
            both_units(found.greatest_in_fat),
            "computed",
            source,
            remark=low_in_fat(result),
        ),
        Known("pressure in the muscle, mean", both_units(found.mean_in_muscle), "computed", source),
    ]


def _stocking(result: StockingResult) -> list[Known]:
    stocking, load = result.leg.stocking, result.equilibrium.load
    low, high = stocking.unstretched.min(), stocking.unstretched.max()
    rows = [
        Known("stiffness of the fabric", f"{stocking.stiffness:g} N/mm per unit of strain", "assumed", "leg.toml"),
        Known(
            "girth of the unstretched stocking",
            f"{low:.0f} mm" if high - low < 0.5 else f"{low:.0f} to {high:.0f} mm",
            "assumed",
            "leg.toml, or its class",
        ),
        Known(
            "strain of the worn fabric",
            f"{100 * load.strain.min():.0f} to {100 * load.strain.max():.0f} %",
            "computed",
            "the dressed leg's girth",
        ),
    ]
    if result.scan_load is not None:
        rows.append(
            Known(
                "pressure on the skin by the scanned shape",
                f"{mpa_to_mmhg(result.scan_load.mean_pressure):.1f} mmHg (mean)",
                result.leg.origin,
                "scan in the stocking, Laplace's law",
            )
        )
    return rows
