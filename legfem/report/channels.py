"""What was recorded beside the force, beside the fit: figure, panels of the page, and what each channel says."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from legfem.channels.kind import ChannelKind
from legfem.channels.registry import CHANNELS
from legfem.common.units import FloatArray
from legfem.inverse.catalogue import symbol_of
from legfem.inverse.estimates import Estimate
from legfem.inverse.fit import ChannelFit, Fit
from legfem.report.curves import Curves, Line
from legfem.report.render.figure import curves_figure
from legfem.report.style import DATA_COLOUR, LAW_COLOURS, LAW_NAMES

SHOWS = "what was recorded beside the force and what the model makes of it, and their difference"


def beside_force(fit: Fit[Any]) -> list[tuple[int, int]]:
    """Return the numbers of test and channel of all that was recorded beside the force."""
    return [(number, k) for number, one in enumerate(fit.tests) for k in range(1, len(one.channels))]


def channel_name(one: ChannelFit) -> str:
    """Return a channel's name in words."""
    return CHANNELS[one.channel.name].title


def beside_curves(
    key: str,
    title: str,
    kind: ChannelKind,
    at: FloatArray,
    lines: list[Line],
    error: FloatArray,
    marked: Sequence[tuple[float, float]] = (),
) -> Curves:
    """Return the panels of a channel over displacement: readings and models above, models less readings beneath.

    Parameters
    ----------
    key
        Of the panels in the page.
    title
        What is shown.
    kind
        Of the channel.
    at
        Displacement of the readings, (k,), mm.
    lines
        The readings, then models.
    error
        Standard error of a reading, (k,).
    marked
        Displacements (mm) between which the base model is wrong.
    """
    return Curves(
        key,
        title,
        at,
        "displacement (mm)",
        f"{kind.name.replace('_', ' ')} ({kind.unit})",
        f"model − recorded ({kind.unit})",
        lines,
        2 * error,
        "± 2 standard errors of a reading",
        list(marked),
        "where the base model is wrong" if marked else "",
    )


def channel_curves(fits: Sequence[Fit[Any]], number: int, k: int) -> Curves:
    """Return the panels of one channel of a test: readings, the laws' predictions, and their differences."""
    test = fits[0].tests[number]
    first = test.channels[k].channel
    order = np.argsort(first.station, kind="stable")
    lines = [Line("recorded", first.values[order], None, DATA_COLOUR, points=True)]
    for fit in fits:
        model = fit.tests[number].channels[k]
        name, colour = f"model, {LAW_NAMES[fit.law]}", LAW_COLOURS[fit.law]
        lines.append(Line(name, model.predicted[order], model.residual[order], colour, points=True))
    kind = CHANNELS[first.name]
    where = f"{test.name}. " if len(fits[0].tests) > 1 else ""
    return beside_curves(
        f"channel{number}-{k}",
        f"{where}The {kind.words}, over the cylinder's displacement after first contact; beneath, the model less the "
        "recording. The band has the instrument's errors, which readings share in part, and those of the outlines.",
        kind,
        first.station[order],
        lines,
        first.sd[order],
    )


def channel_lines(fit: Fit[Any]) -> list[str]:
    """Return a sentence a channel of a law's fit: how far off it is, and its share in what is determined."""
    several = len(fit.tests) > 1
    found = []
    for number, k in beside_force(fit):
        test, one = fit.tests[number], fit.tests[number].channels[k]
        where = f"{test.name}, " if several else ""
        error = float(np.sqrt(np.mean(one.channel.sd**2)))
        count = len(one.channel)
        found.append(
            f"{where}{channel_name(one)}, {LAW_NAMES[fit.law]} law: {count} reading{'s' * (count > 1)}, rms "
            f"{one.rms:.2g} {one.channel.unit} where each is known to {error:.2g} {one.channel.unit}."
        )
    shares = _shares(fit.estimates)
    return [*found, *([f"What determines each parameter, {LAW_NAMES[fit.law]} law: {shares}."] if shares else [])]


def _shares(parameters: Mapping[str, Estimate]) -> str:
    told = []
    for name, found in parameters.items():
        parts = sorted(found.information_shares.items(), key=lambda one: -one[1])
        said = ", ".join(f"{channel.replace('_', ' ')} {100 * share:.0f} %" for channel, share in parts)
        if said:
            told.append(f"{symbol_of(name)} by {said}")
    return "; ".join(told)


def channels_figure(fits: Sequence[Fit[Any]]) -> Figure:
    """Draw every channel beside the force over displacement, and the laws' differences from it beneath."""
    blocks = [channel_curves(fits, number, k) for number, k in beside_force(fits[0])]
    return curves_figure(blocks, "Recorded beside the force", fits[0].subject.title, fits[0].subject.origin)
