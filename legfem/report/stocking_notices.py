"""Notices about a leg in its stocking in words; see `legfem.report.notices`."""

from collections.abc import Mapping
from typing import Any

from legfem.common.units import mpa_to_kpa
from legfem.report.notices import Words
from legfem.stockings.assessment import StockingNotice


def _of_search(given: Mapping[str, Any]) -> str:
    name = "Nelder-Mead's search" if given["method"] == "nelder-mead" else "A search"
    start = " and ".join(f"{mpa_to_kpa(value):.3g} kPa in the {tissue}" for value, tissue in given["start"])
    return f"{name} from {start}"


STOCKING: Mapping[str, Words] = {
    StockingNotice.SENSOR_MISSED: Words(
        "The sensor {sensor} read {read!m:.1f} ± {sd!m:.1f} mmHg, where the model has {model!m:.1f} mmHg",
        " ({departure:.0f} standard deviations off): its place, its error or the fabric is otherwise than was given (a "
        "fabric that isn't known well: [accuracy] tension_relative_sd).",
    ),
    StockingNotice.NOT_COMPUTED: Words(
        "The leg in its stocking could not be computed", " ({reason}): there are no pressures inside the leg."
    ),
    StockingNotice.UNSETTLED: Words(
        "The stocking's pressure and the shape that it makes did not settle",
        ": in the last of {states} states the pressure still changed by {change:.2g} % of its greatest, not by less "
        "than {tolerance:g} %.",
    ),
    StockingNotice.SEARCH_NOT_COMPUTED: Words(
        "A search met a state that could not be computed",
        whole=lambda given: f"{_of_search(given)} met a state that could not be computed ({given['reason']}).",
    ),
    StockingNotice.SEARCH_UNSETTLED: Words(
        "A search ended before it had settled", whole=lambda given: f"{_of_search(given)} ended before it had settled."
    ),
    StockingNotice.STARTS_DISAGREE: Words(
        "The starts did not all lead to the same stiffness", ": the one that fits the scan best counts."
    ),
    StockingNotice.SCAN_MISSED: Words(
        "The model misses the scan",
        ": its contours are {rms:.2f} mm off (root mean square), more than {times:g} times the {expected:.2f} mm that "
        "errors of the contours cause. The intervals of the stiffness are then too narrow: check the contours.",
    ),
    StockingNotice.STIFFNESS_AT_BOUND: Words(
        "The stiffness of the {tissue} stands at the search's {bound} bound", ": it is not known."
    ),
    StockingNotice.REGISTRATION_UNSETTLED: Words(
        "The registration on the bones did not settle in {iterations} iterations", "."
    ),
    StockingNotice.BONES_APART: Words(
        "The bones of the two scans are {residual:.2f} mm apart after registration",
        ": their outlines differ, or the scans are not of one leg.",
    ),
    StockingNotice.SLACK: Words(
        "The stocking is slack, and presses on nothing, at {slack} of {levels} heights",
        ", between {low:g} and {high:g} mm.",
    ),
    StockingNotice.UNLOADED: Words(
        "The fabric spans hollows or flats of the leg",
        ": {share:.0f} % of the skin under it bears no pressure, most at z = {level:g} mm ({most:.0f} % of that "
        "contour).",
    ),
    StockingNotice.ENDS_HELD: Words(
        "The modelled part's end faces are held in their planes, as if the leg continued unchanged beyond them",
        ". Do not rely on pressures within about 10 mm of the ends.",
    ),
}
