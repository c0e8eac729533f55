"""What is shown of specimens: one tissue's law from all their recordings."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import ClassVar

import numpy as np
from matplotlib.figure import Figure

from legfem.common.numbers import fit_probability, percent
from legfem.common.units import FloatArray
from legfem.inverse.catalogue import RATIO, is_ratio, symbol_of
from legfem.inverse.fit import Fit, least_akaike, value_of
from legfem.inverse.intervals import quantile
from legfem.inverse.readings import RELAXATION
from legfem.report import estimates
from legfem.report import page as web
from legfem.report.curves import Curves, Dash, Line, curves_figure, law_line
from legfem.report.folder import ReportFile
from legfem.report.further_channels import SHOWS, channel_lines, channels_figure, drawn
from legfem.report.kinds import ReportKind
from legfem.report.style import DATA_COLOUR, picture
from legfem.report.words import LAW_NAMES, NOT_TESTED, TOLD, WORDS, DataKind, capital
from legfem.specimens.comparison import SHAPE_SD_OF_LAYERS
from legfem.specimens.course import shows_quickening
from legfem.specimens.details import RecordingFit, SpecimenDetails, compared, rms_percent
from legfem.specimens.thickness import KNOW_THE_RIG

type SpecimenFit = Fit[SpecimenDetails]

_MOST_CURVES = 6
_SHALLOW = 0.03
"""Share of the depth below which a quotient of forces is noise."""
_DEPTHS = 0.25, 0.5, 0.75, 1.0
_DASHES: tuple[Dash, ...] = ("solid", "dashed", "dotdash", "dotted")


class SpecimenReport(ReportKind):
    """What is shown of specimens."""

    kind: ClassVar[str] = "specimens"
    simulated = DataKind("simulated data", "forces computed by a model; no specimen was measured")

    def question(self, chosen: SpecimenFit) -> str:
        """Return the title."""
        return f"How stiff is the tissue of specimen {chosen.subject.id}?"

    def answers(self, chosen: SpecimenFit) -> list[tuple[str, str]]:
        """Return what is wrong, how stiff the tissue is, how sure that is and what to do."""
        values = "; ".join(
            f"{_words(name)} {estimates.known_text(value_of(found), '95 % ')}" for name, found in chosen.asked.items()
        )
        agreement, unused = chosen.details.agreement, len(chosen.details.left_out)
        apart = agreement if agreement and agreement.differ else None
        if finding := chosen.details.thickness or chosen.details.rig or apart:
            wrong = finding.text
        elif chosen.goodness.fits:
            wrong = "None that these recordings can show."
            if unused:
                were = "s were" if unused > 1 else " was"
                wrong += f" {unused} recording{were} not used: the warnings say why."
        else:
            chance = fit_probability(chosen.goodness.p_value)
            wrong = f"The recordings show an effect that the law leaves out ({chance})."
        return [
            ("Problems found", wrong),
            ("How stiff", f"{capital(values)}."),
            ("How sure", estimates.how_sure(chosen.estimates, _words, chosen.goodness.fits)),
            ("What to do", _next(chosen)[0]),
        ]

    def known(self, fits: Sequence[SpecimenFit]) -> Iterator[web.Known]:
        """Yield what was found with each law, what was held, and the specimens' sizes."""
        for fit in fits:
            fitted, isotropic = sum(one.fitted for one in fit.tests), not any(map(is_ratio, fit.values))
            for name, found in fit.estimates.items():
                yield estimates.estimated(f"{_words(name)}, {LAW_NAMES[fit.law]} law", found, fitted, isotropic)
        source = "specimen.toml, the command, or the law's default"
        for name, value in estimates.held_of(fits).items():
            yield web.Known(_words(name), estimates.held_text(name, value), "assumed", source)
        # A law that misses all recordings alike makes more of how they differ.
        first = least_akaike(fits)
        factor, source = f"{100 * first.details.gain_sd:.3g} % (sd)", "the recordings' forces; the intervals include it"
        yield web.Known("factor by which recordings differ", factor, "estimated", source)
        for fit in fits:
            for one in fit.details.alternatives:
                name = f"{one.words}, {LAW_NAMES[fit.law]} law"
                yield web.Known(name, percent(one.probability), "estimated", "their curves")
        source = "specimen.toml; the intervals include their errors ([accuracy])"
        for sizes in dict.fromkeys(one.sizes for one in first.details.folder.recordings):
            yield web.Known("sizes", str(sizes), "assumed", source)

    def chapters(self, fits: Sequence[SpecimenFit], pressed: web.PressedSection | None, note: str) -> list[web.Chapter]:
        """Return recordings, what was tested and what not, what to do and how it was done."""
        chosen = least_akaike(fits)
        untested = [*estimates.rests_on(chosen.estimates, followed(chosen)), *NOT_TESTED["specimens"]]
        if not chosen.details.folder.returns:
            untested.append("Unloading, and everything after the first return, was not used.")
        return [
            web.Chapter("Recordings and model", list(_recordings(fits))),
            web.Chapter(web.TESTED, [web.Bullets(list(tested(fits)))]),
            web.Chapter("What could not be tested", [web.Bullets(untested)]),
            web.Chapter("What to do next", [web.Bullets(_next(chosen))]),
            web.Chapter("How it was done", [web.Prose(procedure(chosen)), *estimates.how_found(fits)]),
        ]

    def figure(self, fits: Sequence[SpecimenFit]) -> Figure:
        """Return recordings beside the laws, those with the poorest fit."""
        what = f"Measured and simulated {compared(fits[0])[0].recording.axes.load}"
        return curves_figure(list(curves_of(fits)), what, fits[0].subject.title, fits[0].subject.origin)

    def files(self, fits: Sequence[SpecimenFit], folder: Path) -> list[ReportFile]:
        """Write the figures."""
        shows = "recordings beside the model over displacement and time, and their differences"
        found = [picture(self.figure(fits), folder, "fit", shows, svg=True)]
        if drawn(fits):
            found.append(picture(channels_figure(fits), folder, "channels", SHOWS, svg=True))
        return found


def _words(name: str) -> str:
    """Return a parameter's full name in words: the specimen is one tissue."""
    term, _, field = name.rpartition(".")
    if term == "deep":
        words = f"{symbol_of(name)} of the tissue"
    elif name in RELAXATION:
        words = WORDS["relaxation"][field]
    else:
        words = estimates.words_of(name)
    return words.replace(RATIO, "fibre ratio")


def _next(best: SpecimenFit) -> list[str]:
    details = best.details
    if details.thickness or details.rig:
        lines = [KNOW_THE_RIG]
    elif details.agreement and details.agreement.differ:
        lines = [details.agreement.remedy]
    elif not best.goodness.fits:
        lines = [TOLD["other_laws"]]
    elif details.ratio_undetermined:
        lines = [details.ratio_undetermined]
    else:
        courses = [one.course for one in compared(best)]
        timed = ["add a hold"] if not any(one.holds for one in courses) else []
        timed += ["add another rate"] if not shows_quickening([one.rate for one in courses]) else []
        ends = "how the test was done is not stated, so find out whether the ends stick, and state it ([plates] ends)"
        lines = estimates.how_to_narrow(best.asked, ["strain it further", *timed], ends) or [
            f"Use these numbers together with the {LAW_NAMES[best.law]} law and within the strains of the test."
        ]
    if all(one.fitted for one in best.tests):
        lines.append("Test the law on a recording that it has not seen: --leave-out NAME.")
    return lines


def _worst(result: SpecimenFit) -> list[RecordingFit]:
    """Return the recordings with the poorest fit, of each of several tests one at least."""
    worst = sorted(compared(result), key=lambda one: one.force.r_squared)
    first = {one.recording.test: one for one in reversed(worst)}.values()
    return sorted(worst, key=lambda one: one not in first)[: max(_MOST_CURVES, len(first))]


def curves_of(results: Sequence[SpecimenFit]) -> Iterator[Curves]:
    """Recordings beside the laws, over displacement and where one holds over time, those with the poorest fit first."""
    for number, one in enumerate(_worst(least_akaike(results))):
        axes = one.recording.axes
        yield _curves(results, one, number, axes.ways * one.course.displacement, axes.way, axes.way_unit)
        if one.course.holds:
            yield _curves(results, one, number, one.course.time, "time", "s")


def asked_by_depth(one: RecordingFit) -> FloatArray:
    """Return displacements of a loading, the stiffness that the force asks for there over the law's, and its error.

    The force on one tissue is in proportion to its stiffness, so this is the law whose form is free; (3, n).
    """
    moved, law, channel = one.course.displacement, one.force.predicted, one.force.channel
    kept = (np.arange(len(moved)) <= np.argmax(moved)) & (moved > _SHALLOW * moved.max()) & (law > 0)
    return np.array([moved[kept], channel.values[kept] / law[kept], channel.sd[kept] / law[kept]])


def _recordings(results: Sequence[SpecimenFit]) -> Iterator[web.Block]:
    first = least_akaike(results)
    every = compared(first)
    if len(every) > _MOST_CURVES:
        yield web.Prose(f"The {_MOST_CURVES} of {len(every)} recordings with the poorest fit are drawn.")
    bars = [
        web.LabelledBar(
            f"{one.name}{'' if one.fitted else ' (left out, predicted)'}",
            max(one.force.r_squared, 0.0),
            f"{one.force.r_squared:.4f}, {one.recording.axes.load_text(one.force.rms)}",
        )
        for one in every
    ]
    explains = f"How much of each recording the {LAW_NAMES[first.law]} law explains (R²)"
    yield from curves_of(results)
    for number, one in enumerate([] if first.goodness.fits else _worst(first)):
        axes, (moved, asked, error) = one.recording.axes, asked_by_depth(one)
        yield Curves(
            f"asked{number}",
            f"{one.name}: the stiffness that each depth asks for, over that of the law that was fitted",
            ", with 95 % intervals: the form that a law would need. One that fits is 1 throughout.",
            axes.ways * moved,
            _label(axes.way, axes.way_unit),
            "times the law's stiffness",
            [Line("asked for", asked, None), law_line(first.law, np.ones_like(asked), None)],
            quantile(0) * error,
            "95 %",
        )
    yield web.Bars(explains, ("recording", "R², error"), bars, greatest=1.0)
    yield from drawn(results)
    yield from _face_profile(results)
    for result in results:
        samples, law = compared(result), LAW_NAMES[result.law]
        for test in dict.fromkeys(one.recording.test for one in samples):
            yield _test_in_numbers([one for one in samples if one.recording.test == test], law, test)
        if result.details.stiffness:
            rows = [{"specimen": name, "times as stiff": f"{x:.3f}"} for name, x in result.details.stiffness.items()]
            caption = f"Stiffness of each specimen relative to a typical one, {law} law"
            yield web.WebTable.of(caption, rows, folded=True)


def _face_profile(fits: Sequence[SpecimenFit]) -> list[Curves]:
    """Return how the face is strained across along its height: the barrel of a pressed one."""
    faces = [(fit.law, fit.details.face.profile) for fit in fits if fit.details.face is not None]
    if not faces:
        return []
    heights, seen, _ = faces[0][1]
    lines = [Line("recorded", seen, None, DATA_COLOUR, points=True)]
    for law, (_, recorded, model) in faces:
        lines.append(law_line(law, model, model - recorded))
    title = TOLD["face_profile"]
    more = "; beneath, the model less the recording. Ends that stick make a barrel of it."
    labels = "height from the middle, over half the specimen's", "strain across (-)"
    return [Curves("face-profile", title, more, heights, *labels, lines, below_label="model − recorded (-)")]


def _test_in_numbers(samples: Sequence[RecordingFit], law: str, test: str) -> web.WebTable:
    axes = samples[0].recording.axes
    rows = [
        {
            "recording": one.name,
            f"{axes.way_unit}/s": f"{axes.ways * one.course.rate:.3g}" if one.course.samples.timed else "no time",
            axes.way_unit: f"{axes.ways * one.course.depth:.3g}",
            f"peak {axes.load_unit}": f"{axes.loads * one.course.peak:.4g}",
            f"rmse {axes.load_unit}": f"{axes.loads * one.force.rms:.3g}",
            "R²": f"{one.force.r_squared:.4f}",
            "own/joint": f"{one.scale:.3f}",
            "": "" if one.fitted else "left out",
        }
        for one in samples
    ]
    caption = TOLD["recordings_of_law"].format(of=f" of {test}" if test else "", law=law)
    return web.WebTable.of(caption, rows, folded=True)


def _curves(
    results: Sequence[SpecimenFit], one: RecordingFit, number: int, x: FloatArray, along: str, unit: str
) -> Curves:
    axes, when = one.recording.axes, one.course.begun + one.course.time
    lines = [Line("recorded", axes.loads * one.course.force, None, DATA_COLOUR, points=True)]
    for k, result in enumerate(results):
        same = next((r for r in compared(result) if r.name == one.name), None)
        if same is not None:
            # Each law has first contact, and so stations, of its own.
            own, met = same.course.begun + same.course.time, same.force
            above, below = (axes.loads * np.interp(when, own, of) for of in (met.predicted, met.residual))
            lines.append(law_line(result.law, above, below, _DASHES[k % 4]))
    after = " after first contact" if one.course.samples.timed else ""
    return Curves(
        f"{along.split()[0]}{number}",
        f"{one.name}{'' if one.fitted else ' (left out, predicted)'}",
        f": {axes.load} over {along}{after}, recorded and of the model; beneath, the model less the recording.",
        x,
        _label(along, unit),
        f"{axes.load} ({axes.load_unit})",
        lines,
        below_label=f"model − recorded ({axes.load_unit})",
    )


def _label(name: str, unit: str) -> str:
    return f"{name} ({unit})" if unit != "-" else name


def procedure(result: SpecimenFit) -> str:
    """Return what was done with the recordings, as a paragraph."""
    every = result.details.folder.recordings
    note, axes = " ".join(dict.fromkeys(filter(None, (one.sizes.kind.note for one in every)))), every[0].axes
    timed = [one.recording.timed for one in every]
    fitted, together = sum(one.fitted for one in result.tests), "1 recording was fitted"
    if fitted > 1:
        together = f"{fitted} recordings were fitted together by one law, weighted equally relative to their greatest "
        together += f"{axes.load},"
    said = "to the first return; recordings after that were not used. "
    if result.details.folder.returns:
        said = "until hardly any force was left, with the returns as they were driven. "
    if not all(timed):
        said += f"{'Some' if any(timed) else 'They'} are tables of stretch and stress without a time, so nothing is "
        said += "known of rates; forces are those on a body of the stated size, or on a cube of 10 mm. The errors of "
        said += "the tables are their differences from a smooth curve. "
    if result.details.folder.relaxes:
        said += f"{TOLD['relaxation']} "
    if result.details.stiffness:
        said += f"{TOLD['typical_specimen']} "
    said += f"{_of_layers(result)}{_of_fibres(result)}{f'{note} ' if note else ''}"
    return TOLD["specimens_fitted"].format(together=together, said=said, gain=100 * result.details.gain_sd)


def _of_layers(result: SpecimenFit) -> str:
    tissues = result.details.folder.tissues
    if len(tissues) == 1:
        return ""
    stated = [one.name for one in tissues if "C10" in one.stated]
    held = f"the stiffness of {', '.join(stated)} is as stated, and " if stated else ""
    if result.details.folder.relaxes:
        after = " (so a stated stiffness is that after all relaxation)" if stated else ""
        held = f"they are taken to relax alike{after}; {held}"
    return TOLD["of_layers"].format(held=held, shape=100 * SHAPE_SD_OF_LAYERS)


def _of_fibres(result: SpecimenFit) -> str:
    (ratio,) = [name for name in result.values if is_ratio(name)] or [""]
    if not ratio:
        return ""
    sought = ratio in result.estimates
    shape, typical = f"the shape of a curve is taken to be known to {100 * SHAPE_SD_OF_LAYERS:.0f} %", ""
    if result.details.ratio_undetermined:
        shape = "the bend of a curve was not used, because fibres that are slack at first can change it by tens of "
        shape += "percent"
    elif sought and result.details.stiffness:
        typical = "Typical specimens of both directions are taken to be equally stiff, and a specimen that was turned "
        typical += "to be the same. "
    known = "estimated" if sought else f"taken to be {result.values[ratio]:.3g}"
    return TOLD["of_fibres"].format(known=known, shape=shape, typical=typical)


def followed(result: SpecimenFit) -> str:
    """Return how stiffness follows the size of what presses or is pressed, as a clause."""
    tables = "a stress of twice the true value, by its unit or measure, doubles the stiffness"
    every = result.details.folder.recordings
    return "; ".join(dict.fromkeys(one.sizes.kind.followed if one.recording.timed else tables for one in every))


def tested(results: Sequence[SpecimenFit]) -> Iterator[str]:
    """Yield how each law fared, how specimens differ, and how well what was left out is predicted."""
    for result in results:
        details, goodness = result.details, result.goodness
        law, chance = LAW_NAMES[result.law], fit_probability(goodness.p_value)
        yield TOLD["law_differs"].format(law=law, rms=rms_percent(result), good=goodness, chance=chance)
        yield from channel_lines(result)
        if not goodness.fits:
            one = _worst(result)[0]
            moved, asked, _ = asked_by_depth(one)
            at = np.interp(_DEPTHS, moved / one.course.depth, asked)
            there = ", ".join(f"{x:.2f} at {100 * share:g} %" for x, share in zip(at, _DEPTHS, strict=True))
            yield f"{one.name} asks for another form of the law: {there} of the depth, times its stiffness."
        if details.agreement is not None and not details.agreement.disagree:
            yield details.agreement.text
        if each := details.stiffness.values():
            spread = {"low": min(each), "high": max(each), "sd": details.stiffness_spread}
            yield TOLD["typical_range"].format(count=len(each), **spread)
        for one in (one for one in compared(result) if not one.fitted):
            load, stiff = one.recording.axes.load_text, ""
            if one.recording.specimen in details.stiffness:
                stiff = ", with the stiffness of its specimen in the other recordings"
            elif details.stiffness:
                stiff = f"; with {one.scale:.2f} times the stiffness of a typical specimen, {one.shape_r_squared:.3f}"
            yield (
                f"left out, {one.name}: predicted with R² {one.force.r_squared:.3f}, rmse {load(one.force.rms)} "
                f"({100 * one.force.rms / one.course.peak:.2g} % of {load(one.course.peak)}){stiff}."
            )
