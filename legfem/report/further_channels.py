"""Channels beside the force: figure and panels, what they say in a diagnosis, and where the misfit lies."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from legfem.channels.kind import ChannelKind
from legfem.channels.kinds import CHANNELS, FILE_OF
from legfem.common.numbers import fit_probability
from legfem.common.units import FloatArray
from legfem.geometry.indenter import Site
from legfem.inverse.catalogue import symbol_of
from legfem.inverse.channel_readings import StationChannel
from legfem.inverse.explanation import Explanation
from legfem.inverse.fit import LEAST_CHANCE, ChannelFit, Fit
from legfem.inverse.intervals import quantile
from legfem.inverse.predictor import values_of
from legfem.inverse.verdict import Diagnosis
from legfem.legs.details import LegDetails, StiffnessMap
from legfem.legs.site import site_test
from legfem.legs.subject import Subject
from legfem.report import page as web
from legfem.report.curves import Curves, Dash, Line, curves_figure, law_line
from legfem.report.diagnosis_curves import BASE_COLOUR, BASE_NAME, REPAIRED_COLOUR, matched, plain, shown_models
from legfem.report.pressed_section import still_section
from legfem.report.style import DATA_COLOUR, FAINT
from legfem.report.words import LAW_NAMES, TOLD

SHOWS = "what was recorded beside the force and what the model makes of it, and their difference"


def beside_force(fit: Fit[Any]) -> list[tuple[int, int]]:
    """Return the numbers of test and channel of all that was recorded beside the force."""
    return [(number, k) for number, one in enumerate(fit.tests) for k in range(1, len(one.channels))]


def drawn(fits: Sequence[Fit[Any]]) -> list[Curves]:
    """Return the panels of all channels that were read more than once: a single reading has no course."""
    each = ((at, fits[0].tests[at[0]].channels[at[1]]) for at in beside_force(fits[0]))
    return [channel_curves(fits, *at) for at, one in each if len(one.channel) > 1]


def channel_name(one: ChannelFit) -> str:
    """Return a channel's name in words."""
    return CHANNELS[one.channel.name].title


def beside_curves(
    key: str,
    caption: tuple[str, str],
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
    caption
        Title of the panels, and how the caption goes on.
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
        *caption,
        at,
        "displacement (mm)",
        f"{kind.name.replace('_', ' ')} ({kind.unit})",
        lines,
        2 * error,
        "± 2 standard errors of a reading",
        list(marked),
        "where the base model is wrong" if marked else "",
        f"model − recorded ({kind.unit})",
    )


def channel_curves(fits: Sequence[Fit[Any]], number: int, k: int) -> Curves:
    """Return the panels of one channel of a test: readings, the laws' predictions, and their differences."""
    test = fits[0].tests[number]
    first = test.channels[k].channel
    order = np.argsort(first.station, kind="stable")
    lines = [Line("recorded", first.values[order], None, DATA_COLOUR, points=True)]
    for fit in fits:
        model = fit.tests[number].channels[k]
        lines.append(law_line(fit.law, model.predicted[order], model.residual[order], points=True))
    kind = CHANNELS[first.name]
    where = f"{test.name}. " if len(fits[0].tests) > 1 else ""
    caption = f"{where}The {kind.words}", TOLD["channel"]
    return beside_curves(f"channel{number}-{k}", caption, kind, first.station[order], lines, first.sd[order])


def channel_lines(fit: Fit[Any]) -> Iterator[str]:
    """Return a sentence a channel of a law's fit: how far off it is, and its share in what is determined."""
    law = LAW_NAMES[fit.law]
    for number, k in beside_force(fit):
        test, one = fit.tests[number], fit.tests[number].channels[k]
        where = f"{test.name}, " if len(fit.tests) > 1 else ""
        count, unit = len(one.channel), one.channel.unit.strip("-")
        rms, known = (f"{size:.2g} {unit}".rstrip() for size in (one.rms, float(np.sqrt(np.mean(one.channel.sd**2)))))
        yield (
            f"{where}{channel_name(one)}, {law} law: {count} reading{'s' * (count > 1)}, rms {rms} where each is known "
            f"to {known}."
        )
    shares = []
    for name, estimate in fit.estimates.items():
        parts = sorted(estimate.information_shares.items(), key=lambda one: -one[1])
        if said := ", ".join(f"{channel.replace('_', ' ')} {100 * share:.0f} %" for channel, share in parts):
            shares.append(f"{symbol_of(name)} by {said}")
    if shares:
        yield f"What determines each parameter, {law} law: {'; '.join(shares)}."


def channels_figure(fits: Sequence[Fit[Any]]) -> Figure:
    """Draw every channel beside the force over displacement, and the laws' differences from it beneath."""
    return curves_figure(drawn(fits), "Recorded beside the force", fits[0].subject.title, fits[0].subject.origin)


_LEAST = 1.0
"""A misfit is stated where it is more than this share of a reading's error."""


@dataclass(frozen=True)
class ChannelMisfit:
    """How well a channel is met, all in its unit."""

    name: str
    unit: str
    readings: int
    rms_before: float
    """Left by the base model, with what isn't known of the leg and of the instruments as fitted."""
    rms_after: float | None
    """Left likewise by the first model that is shown beside it."""
    error: float
    """Standard deviation of one reading within its trial, in the mean."""


def channel_misfits(found: Diagnosis) -> list[ChannelMisfit]:
    """Return how well every channel is met, the force first."""
    models = shown_models(found)[:1]
    return [
        ChannelMisfit(
            channel.name,
            channel.unit,
            len(channel),
            _rms(found.weighted_base, span),
            _rms(models[0].model, span) if models else None,
            float(np.sqrt(np.mean(found.errors.trial_sd[span] ** 2))),
        )
        for channel, span in zip(found.observed.data.channels, found.observed.data.spans, strict=True)
    ]


def left_of(model: Explanation) -> FloatArray:
    """Return what a model leaves of the readings (N,): with outlines, boundaries, gains and the like as fitted."""
    return np.asarray(model.fit.residual - model.problem.errors.known @ model.posterior.effects)


def _rms(model: Explanation, span: slice) -> float:
    return float(np.sqrt(np.mean(left_of(model)[span] ** 2)))


def channel_sentences(found: Diagnosis) -> Iterator[str]:
    """Yield where a channel departs from the base model, beyond what isn't known of the leg and the instruments."""
    left = left_of(found.weighted_base)
    words = {one.name: one.kind for one in found.observed.channels}
    for window in found.assessment.windows:
        if window.channel not in words:
            continue
        size = float(left[list(window.stations)].mean())
        error = float(np.mean(found.errors.trial_sd[list(window.stations)]))
        if abs(size) < _LEAST * error / np.sqrt(len(window.stations)):
            continue
        kind, (low, high) = words[window.channel], window.displacement
        at = f"at {low:.0f} mm" if high - low < 1.0 else f"from {low:.0f} to {high:.0f} mm"
        phase = "" if window.phase == "loading" else f" in {window.phase}"
        yield (
            f"The {kind.quantity} is {abs(size):.2g} {kind.unit} {'more' if size > 0 else 'less'} than "
            f"the model's {at}{phase} (p = {window.p_value:.2g} over all intervals)."
        )


def channel_chapter(found: Diagnosis) -> list[web.Chapter]:
    """Return the chapter on channels beside the force; none where nothing else was recorded."""
    if not found.observed.channels:
        return []
    models = shown_models(found)[:1]
    after = f"left by {models[0].name}" if models else "left by a repaired model"
    rows = [
        {
            "channel": one.name.replace("_", " "),
            "readings": f"{one.readings}",
            f"left by the {BASE_NAME}": f"{one.rms_before:.3f} {one.unit}",
            after: "-" if one.rms_after is None else f"{one.rms_after:.3f} {one.unit}",
            "error of a reading": f"{one.error:.3f} {one.unit}",
        }
        for one in channel_misfits(found)
    ]
    said = list(channel_sentences(found))
    blocks: list[web.Block] = [
        web.Bullets(said) if said else web.Prose("No interval of these channels stands out from their errors."),
        web.WebTable.of("How well every channel is met (root mean square)", rows),
    ]
    for k in range(len(found.observed.protocols)):
        blocks += _channel_curves(found, k)
    return [web.Chapter("Beside the force", blocks)]


def _channel_curves(found: Diagnosis, protocol: int) -> Iterator[Curves]:
    """Yield every channel of a protocol's trials over displacement, in the order of time, as the trials' mean."""
    observed, models = found.observed, shown_models(found)[:1]
    for one, span in zip(observed.channels, observed.data.spans[1:], strict=True):
        mine = np.flatnonzero(observed.protocol[one.nearest] == protocol)
        if not len(mine):
            continue
        # A row a trial; one row where trials have different numbers of readings.
        by_trial = [mine[one.trial[mine] == k] for k in np.unique(one.trial[mine])]
        rows = np.array(by_trial) if len(set(map(len, by_trial))) == 1 else np.concatenate(by_trial)[None]
        at = span.start + rows
        lines = [
            Line("recorded" if len(at) == 1 else "recorded, mean", observed.values[at].mean(axis=0), None, points=True),
            _line(BASE_NAME, found.weighted_base, at, BASE_COLOUR, bool(one.places)),
            *(_line(shown.name, shown.model, at, REPAIRED_COLOUR, bool(one.places)) for shown in models),
        ]
        here = set(at.ravel().tolist())
        yield beside_curves(
            f"channel{protocol}-{one.name}",
            (f"{one.kind.words.capitalize()}, {observed.protocols[protocol].label}", TOLD["channel_of_models"]),
            one.kind,
            one.displacement[rows].mean(axis=0),
            lines,
            np.sqrt(np.mean(found.errors.trial_sd[at] ** 2, axis=0)),
            [w.displacement for w in found.assessment.windows if w.channel == one.name and set(w.stations) & here],
        )


def _line(name: str, model: Explanation, at: NDArray[np.int_], colour: str, points: bool) -> Line:
    """Return what a model makes of readings in rows; as points where they are of many places."""
    left = left_of(model)
    met = model.fit.prediction + model.fit.residual - left
    dash: Dash = "dashed" if name == BASE_NAME else "solid"
    return Line(name, met[at].mean(axis=0), -left[at].mean(axis=0), colour, dash, points)


_SHARE = 0.3
"""Of the misfit: a place that would explain less isn't marked."""
_CHANNEL_MM, _ARROW_MM = 3.0, 14.0
"""Of a circle's radius, and of the longest arrow."""
_DEEP = 0.7
"""Of the loading's depth: readings from there on make an arrow."""


def misfit_in_section(found: Diagnosis, subject: Subject) -> list[web.StillSection]:
    """Return the section with marks where the misfit lies; nothing without channels, or where none stands out."""
    observed, fitted = found.observed, found.weighted_base.fit
    site, left = Site(subject.section, subject.indenter), left_of(found.weighted_base)
    spans = dict(zip((one.name for one in observed.channels), observed.data.spans[1:], strict=True))
    marks: list[web.Mark] = []
    arrows: list[web.Arrow] = []
    for one in observed.channels:
        if not any(window.channel == one.name for window in found.assessment.windows):
            continue
        if one.places:
            arrows += channel_arrows(one, left[spans[one.name]], site)
        else:
            x, y = FILE_OF[one.name].place(one.kind, site)
            marks.append(web.Mark(f"departs: {one.kind.title}", x, -y, _CHANNEL_MM, BASE_COLOUR))
    for sign in found.assessment.signatures if observed.channels else ():
        region, share = sign.mechanism.acts_in(sign.shape, site), matched(found, sign)[1]
        if region is not None and share is not None and share >= _SHARE:
            (x, y), radius = region
            how = "stiffer" if float(sign.direction @ fitted.augmented_residual) > 0 else "softer"
            words = f"a {how} region here matches {100 * share:.0f} %"
            marks.append(web.Mark(words, float(x), -float(y), radius, REPAIRED_COLOUR))
    for model in found.models[:1]:
        for m in model.fit.mechanisms:
            if (region := m.acts_in(values_of(model.fit.values, m), site)) is not None:
                (x, y), radius = region
                marks.append(web.Mark(f"named: {plain(m.name)}", float(x), -float(y), radius, REPAIRED_COLOUR))
    if not (marks or arrows):
        return []
    return [replace(still_section(subject), caption=TOLD["misfit_in_section"], marks=marks, arrows=arrows)]


_FACTORS = (0.33, 0.5, 0.71, 1.4, 2.0, 3.0)
"""Of the whole muscle's C10: between them a colour stands."""
_COLOURS = ("#440154", "#443983", "#31688E", "#21918C", "#35B779", "#90D743", "#FDE725", FAINT)
"""Viridis', which the colour-blind can tell apart, and what isn't told."""
_DOT_MM = 1.2


def mapped_muscle(fit: Fit[LegDetails]) -> list[web.Block]:
    """Return the section with the map of C10, and with what a muscle alike leaves; nothing without a map."""
    found, subject = fit.details.field, fit.details.subject
    if found is None:
        return []
    ends = [f"{one * found.whole_kPa:.2g}" for one in _FACTORS]
    between = (f"C10 {low} to {high} kPa" for low, high in pairwise(ends))
    names = [f"C10 below {ends[0]} kPa", *between, f"C10 above {ends[-1]} kPa", "not determined by the recordings"]
    level = np.where(found.told, np.digitize(found.C10_kPa / found.whole_kPa, _FACTORS), len(_FACTORS) + 1)
    dots = sorted(zip(level, *found.points_mm.T, strict=True))
    marks = [web.Mark(names[k], float(x), -float(y), _DOT_MM, _COLOURS[k]) for k, x, y in dots]
    section, site = still_section(subject), Site(subject.section, subject.indenter)
    predicted, read = fit.details.stations[0].predicted, site_test(subject, None).observed.channels
    placed = (one for one in read if one.places)
    arrows = [arrow for one in placed for arrow in channel_arrows(one, one.values - predicted[one.name], site)]
    caption = TOLD["muscle_map"].format(sd=found.prior_log_sd, finest=found.finest_mm)
    more = replace(section, caption="What a uniform muscle leaves of the readings inside.", arrows=arrows, key="left")
    mapped = replace(section, caption=caption, marks=marks, key="map")
    return [mapped, *([more] if arrows else []), web.Bullets(list(_mapped(found)))]


def _mapped(found: StiffnessMap) -> Iterator[str]:
    def shown(value: float, sd: float) -> str:
        low, high = value * np.exp(np.array([-1.0, 1.0]) * quantile(0) * sd)
        return f"C10 {value:.2g} kPa ({low:.2g} to {high:.2g})"

    for k in found.stands_out:
        x, y = found.points_mm[k]
        yield f"Stands out: {shown(found.C10_kPa[k], found.log_sd[k])} about x {x:.0f} mm, y {y:.0f} mm."
    for name, mean in found.muscles.items():
        yield f"Mean over the {name.replace('_', ' ')}: {shown(*mean)}."
    if not len(found.stands_out):
        told = "No place stands out from the whole muscle by two standard deviations."
        yield told if found.told.any() else "The recordings do not determine where the muscle is stiffer or softer."
    does = "fit" if found.p_value >= LEAST_CHANCE else "do not fit even"
    ended = "" if found.converged else "; its search ended before it had converged"
    yield f"The recordings {does} a muscle with this map ({fit_probability(found.p_value)}){ended}."


def channel_arrows(one: StationChannel, left: FloatArray, site: Site) -> list[web.Arrow]:
    """Return what is left of a channel's readings at its places, at the deepest of the loading, as arrows.

    Parameters
    ----------
    one
        The channel.
    left
        Recorded less predicted of its readings, (k,), in its unit.
    site
        Where it was read.
    """
    points, ways = FILE_OF[one.name].arrows(np.array(one.places), site)
    loading = one.speed > 0
    if not len(points) or one.course is None or not loading.any():
        return []
    deep = loading & (one.displacement > _DEEP * one.displacement[loading].max())
    by_point: dict[tuple[float, ...], FloatArray] = {}
    for number, (point, way) in enumerate(zip(points, ways, strict=True)):
        mine = deep & (one.course == number)
        if mine.any():
            key = tuple(point.tolist())
            by_point[key] = by_point.get(key, np.zeros(2)) + float(left[mine].mean()) * way
    most = max((float(np.linalg.norm(away)) for away in by_point.values()), default=0.0)
    if most == 0.0:
        return []
    name = f"{one.kind.title}: recorded less the base model's, {most:.2g} {one.kind.unit} at most"
    scale = _ARROW_MM / most
    return [
        web.Arrow(name, x, -y, scale * float(away[0]), -scale * float(away[1]), BASE_COLOUR)
        for (x, y), away in by_point.items()
    ]
