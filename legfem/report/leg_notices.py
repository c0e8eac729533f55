"""Notices about a leg in words; see `legfem.report.notices`."""

from collections.abc import Mapping
from typing import Any

from legfem.inverse.catalogue import key_of
from legfem.legs.notices import LegNotice
from legfem.legs.subject import TYPICAL_FORCE_SD
from legfem.report.notices import Words

_LAW_MISSES = (
    " Each interval is widened to contain the values that each third of the depth gives by itself; the values "
    "still depend on the depth used."
)
_SQUARES = "chi-square {chi_square:.4g} for {degrees} degrees of freedom"
_FIBRES = "Muscle is taken to be {ratio} times as stiff in shear along the leg as across"
_FROM = " ({provenance}: {source})"


def _of_disagreement(given: Mapping[str, Any]) -> str:
    each = (
        f"{key_of(name)} departs most at {site}, by {departure:+.1f} standard errors"
        for name, site, departure in given["farthest"]
    )
    return (
        f": {'; '.join(each)}. That site differs, was stated wrongly, or has physics that the law leaves out: diagnose "
        "it alone. The intervals are widened until such a disagreement would be usual, and assume no particular cause."
    )


def _of_unused(given: Mapping[str, Any]) -> str:
    model = "in 3D" if given["model"] == "3d" else "of the section"
    return f": the model {model} has no such reading (--model {given['other']} has)."


def _of_uncorrected(given: Mapping[str, Any]) -> str:
    return f" There is none by default: {given['why_none']}." if given["why_none"] else ""


def _of_fibres_in_correction(given: Mapping[str, Any]) -> str:
    return "." if given["sd_stated"] else ", but none of the ratio, which is stated without (fibre_ratio_sd)."


LEG: Mapping[str, Words] = {
    LegNotice.MISFIT: Words(
        "The law does not describe these recordings",
        ": the fit misses by {rms:.2g} N rms where their mean is known to {noise:.2g} N "
        f"({_SQUARES}).{_LAW_MISSES}",
    ),
    LegNotice.MISFIT_OF_SITES: Words(
        "The law does not describe these sites together",
        f" ({_SQUARES}), {{worst}} least (misses by {{rms:.2g}} N rms).{_LAW_MISSES}",
    ),
    LegNotice.SITES_DISAGREE: Words(
        "The sites do not agree on the parameters",
        " (chi-square {chi_square:.3g} for {degrees} degrees of freedom)",
        _of_disagreement,
    ),
    LegNotice.BEGUN_IN_AIR: Words(
        "{count} of {trials} recordings seem to begin in air",
        ": first contact is put at {contacts:.2f} mm. Very soft tissue that stiffens looks the same; if displacement "
        "counts from first touch, say so in subject.toml: [recordings] starts_at_contact = true.",
    ),
    LegNotice.TYPICAL_SHAPE: Words(
        "The leg's outlines are a typical calf's of the measured girth and fat thickness",
        f": the intervals include {100 * TYPICAL_FORCE_SD:g} % of the force (one standard deviation) for its shape. "
        "Outlines of this leg from MRI, CT or ultrasound remove that error.",
    ),
    LegNotice.CHANNELS_UNUSED: Words("What was recorded of {channels!a} is not used", more=_of_unused),
    LegNotice.NEGATIVE_POISSON_RATIO: Words(
        "The {tissue}'s Poisson's ratio is {ratio:.2f} with its C10 and D1 as given",
        ": its bulk modulus lies below 2/3 of its shear modulus.",
    ),
    LegNotice.ENDS_SHARED: Words(
        "The error of the 3D correction is taken to be the same at all sites",
        ". It does not average out, so more sites do not narrow that part of the intervals.",
    ),
    LegNotice.UNCORRECTED_PLANE_STRAIN: Words(
        "No 3D correction is applied",
        ": these recordings were simulated in plane strain and so contain no end effects. Recordings of a real leg are "
        "corrected by default.",
    ),
    LegNotice.UNCORRECTED: Words(
        "No 3D correction is applied",
        ": a constant factor on the force cannot be distinguished from C10, so end effects are part of the stiffness "
        "given here.",
        _of_uncorrected,
    ),
    LegNotice.CORRECTION_UNSETTLED: Words(
        "The correction in 3D has not settled within {solves} solves",
        ": its interval carries what its last prediction missed.",
    ),
    LegNotice.EXTRUDED: Words(
        "The leg in 3D is the section, extruded",
        ": how the leg's girth changes along {under} is left out. Give a scan, surfaces or contours at several levels "
        "as [section].",
    ),
    LegNotice.NO_FIBRES_IN_CORRECTION: Words(
        "The 3D correction takes muscle to be equally stiff in all directions",
        ". Where its shear modulus along the leg is three times that across, a cylinder of 50 mm meets 13 to 27 % more "
        "force (studies/fibres), and C10 is about as much too high. State fibre_ratio under [tissues.deep], or "
        "[[elastography]] along and across.",
    ),
    LegNotice.FIBRES_IN_CORRECTION: Words(
        _FIBRES,
        f"{_FROM}: the 3D correction has what fibres do, and C10's interval has the error of that",
        _of_fibres_in_correction,
    ),
    LegNotice.FIBRES_NOT_IN_CORRECTION: Words(
        _FIBRES,
        f"{_FROM}, but the 3D correction has no fibres: ",
        lambda given: f"{given['why'] or 'it was given by itself'}. --model 3d has them.",
    ),
    LegNotice.FIBRES_UNDETERMINED: Words("The fibres' ratio cannot be distinguished from C10", whole="{text}"),
    LegNotice.FIBRES_ALONG: Words(
        "Fibres are taken to run along the leg, and to be as stiff in tension as their ratio in shear has it, to a "
        "factor of 2",
        ": the intervals have the error of that, at the optimum.",
    ),
    LegNotice.FIBRES_STATED: Words(_FIBRES, f"{_FROM}."),
    LegNotice.NO_FIBRES: Words(
        "Muscle is taken to be equally stiff in all directions",
        ". Give --identify deep.fibre_ratio where the leg is pressed in two ways, or state fibre_ratio under "
        "[tissues.deep].",
    ),
}
