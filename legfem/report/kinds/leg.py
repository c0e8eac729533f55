"""The page of a leg's fit: one or several sites, from a section in plane strain or from the leg in 3D."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import ClassVar

from matplotlib.figure import Figure

from legfem.common.numbers import fit_probability
from legfem.common.units import mpa_to_kpa
from legfem.data.ranges import REACHED_MM
from legfem.geometry.section import MUSCLE
from legfem.inverse.answer import Finding
from legfem.inverse.catalogue import DEEP_C10, symbol_of
from legfem.inverse.fit import preferred, value_of
from legfem.legs.details import SpatialEvidence, SpatialSites
from legfem.legs.site import curve_of
from legfem.legs.subject import Subject
from legfem.report import estimates
from legfem.report import page as web
from legfem.report.curves import Curves, Dash, Line, curves_figure, law_line
from legfem.report.folder import ReportFile
from legfem.report.further_channels import SHOWS, channel_lines, channels_figure, drawn, mapped_muscle
from legfem.report.kinds import ReportKind
from legfem.report.kinds.leg_numbers import LegFit, how_done, known_of
from legfem.report.leg_3d_view import pressed_leg
from legfem.report.leg_figure import SECTION_SHOWS, placement_figure
from legfem.report.plan import options_of
from legfem.report.pressed_section import still_section
from legfem.report.style import DATA_COLOUR, FAINT, picture
from legfem.report.words import BEYOND_A_FIT, LAW_NAMES, NOT_TESTED, TOLD, region_words

_DASHES: dict[str, Dash] = {"neo-hookean": "dashed", "reduced-polynomial": "solid"}
_LIKEWISE = "a stated length_mm that is 10 % too low has the same effect as forces that are 10 % too high"


class LegReport(ReportKind):
    """What is shown of a leg."""

    kind: ClassVar[str] = "leg"

    def question(self, chosen: LegFit) -> str:
        """Return the title."""
        leg, several = chosen.details.leg, len(chosen.tests) > 1
        where = f", from {len(leg.sites)} sites together" if several else ""
        tissue = region_words(leg.sites[0].section)["deep"]
        return f"How stiff is the {tissue} of {'leg' if several else 'subject'} {leg.id}{where}?"

    def answers(self, chosen: LegFit) -> list[tuple[str, str]]:
        """Return what is wrong, how sure it is, what C10 is and what to do."""
        answer, law = chosen.answer, LAW_NAMES[chosen.law]
        section = chosen.details.subject.section
        regions, has_muscle = region_words(section), MUSCLE not in section.lacks
        if answer.finding is Finding.TESTS_DISAGREE:
            wrong = _agreement(chosen)
        elif answer.finding is Finding.MISFIT:
            shown = fit_probability(chosen.goodness.p_value)
            wrong = f"The recordings show an effect that the {law} law leaves out ({shown})."
        else:
            wrong = "None in the recordings, of which all phases were checked."
            if chosen.weighting == "paper":
                wrong = "None in the loading part of the recordings, which is all that was checked."
            if _suspect(chosen).indenter.lies_along and has_muscle:
                wrong += f" {BEYOND_A_FIT}"
        no_number, found = answer.tone == "wrong", chosen.estimates.get(DEEP_C10)
        c10, beside_others = "", list[tuple[str, str]]()
        if found is None:
            c10 = estimates.held_text(DEEP_C10, answer.parameters["C10_given"])
        elif c10 := estimates.known_text(value_of(found)):
            known = found.one_number and not no_number and has_muscle
            beside_others = estimates.high_or_low("deep", found.shown.value, None, chosen.notices) if known else []
        values = "; ".join(
            f"{estimates.words_of(name, regions)} {estimates.known_text(value_of(one), '95 % ')}"
            + (f", {estimates.moduli_of(one)}" if name == DEEP_C10 and one.one_number else "")
            for name, one in chosen.asked.items()
        )
        outer = "the assumed stiffness of fat or fascia, " if has_muscle else ""
        effect = (
            f"{c10} is the best fit, but don't rely on it: its interval does not include the effect that is missing."
            if no_number and (found is None or found.one_number)
            else f"C10 was given as {c10}, and all that was found rests on it."
            if found is None
            else f"C10 is {c10}. If {outer}the units or the sizes are wrong, C10 "
            "changes: the table of numbers and “What could not be tested” say by how much."
        )
        return [
            ("Problems found", wrong),
            *([("How stiff", f"{values}.")] if len(chosen.tests) > 1 or no_number else []),
            ("How sure", estimates.how_sure(chosen.estimates, fits=not no_number)),
            ("Effect on C10", effect),
            ("What to do", _next(chosen)[0]),
            *beside_others,
        ]

    def known(self, fits: Sequence[LegFit]) -> Iterator[web.Known]:
        """Return what was found with each law, what was held, and what was measured at each site."""
        return known_of(fits)

    def chapters(self, fits: Sequence[LegFit], pressed: web.PressedSection | None, note: str) -> list[web.Chapter]:
        """Return recordings, the leg itself, what was tested and what not, what to do and how it was done."""
        chosen = preferred(fits)
        several = len(chosen.tests) > 1
        leg, mapped = [] if several else _leg_itself(fits, pressed, note), mapped_muscle(chosen)
        sites = [_site_table(chosen)] if several else []
        rests = estimates.rests_on(chosen.estimates, _LIKEWISE)
        untested = [*rests, *NOT_TESTED["leg"], *(NOT_TESTED["loading"] if chosen.weighting == "paper" else ())]
        return [
            web.Chapter("Recordings and model", [*sites, *_curves(fits, chosen), *drawn(fits)]),
            *([web.Chapter("Where the muscle is stiffer or softer", mapped)] if mapped else []),
            *([web.Chapter("The leg, pressed", leg)] if leg else []),
            web.Chapter(web.TESTED, [web.Bullets(list(_tested(fits)))]),
            web.Chapter(
                "What could not be tested", [web.Bullets([*untested, *(NOT_TESTED["sites"] if several else ())])]
            ),
            web.Chapter("What to do next", [web.Bullets(_next(chosen))]),
            web.Chapter("How it was done", how_done(fits)),
        ]

    def figure(self, fits: Sequence[LegFit]) -> Figure:
        """Return force and misfit of each law, site by site."""
        what = "Measured and simulated force" + " of all sites together" * (len(fits[0].tests) > 1)
        for fit in fits:
            values = ", ".join(
                f"{symbol_of(name)} {estimates.known_text(value_of(found))}" for name, found in fit.estimates.items()
            )
            what += f"\n{LAW_NAMES[fit.law]}: {values}, rms {fit.cost.rms:.3g} N"
        return curves_figure(_curves(fits, preferred(fits)), what, fits[0].subject.title, fits[0].subject.origin)

    def files(self, fits: Sequence[LegFit], folder: Path) -> list[ReportFile]:
        """Write fit, channels, and where each site was pressed."""
        shows = "measured and simulated force and their difference, each law (as the paper's Fig. 7)"
        entries = [picture(self.figure(fits), folder, "fit", shows, svg=True)]
        if drawn(fits):
            entries.append(picture(channels_figure(fits), folder, "channels", SHOWS, svg=True))
        sites = fits[0].details.leg.sites
        for site in sites:
            name, shows = "section", SECTION_SHOWS
            if len(sites) > 1:
                name, shows = f"section-{site.site}", f"{site.site}: {SECTION_SHOWS}"
            entries.append(picture(placement_figure(site), folder, name, shows))
        return entries


def _curves(fits: Sequence[LegFit], chosen: LegFit) -> list[Curves]:
    """Return recorded forces beside those of the laws, site by site; trials are compared with the chosen law."""
    several, blocks = len(chosen.tests) > 1, []
    for number, one in enumerate(chosen.tests):
        measured = curve_of(one)
        predicted = {fit.law: fit.tests[number].force.predicted for fit in fits}
        many = measured.n_trials > 1
        name = f"mean of {measured.n_trials} trials" if many else "the one trial"
        lines = [Line(name, measured.force, None, DATA_COLOUR, points=True)]
        if many:
            lines += [
                Line(f"trial {k + 1}", force, predicted[chosen.law] - force, FAINT, "dotted", faint=True, tabled=False)
                for k, force in enumerate(measured.trial_force)
            ]
        lines += [law_line(law, force, force - measured.force, _DASHES[law]) for law, force in predicted.items()]
        against = f" The trials in the lower panel are compared with the {LAW_NAMES[chosen.law]} law." if many else ""
        blocks.append(
            Curves(
                f"site{number}" if several else "fit",
                f"{f'{one.name}. ' if several else ''}Force over the cylinder's displacement after first contact",
                f": recorded, and of the model with each law; beneath, the model less the recording.{against}",
                measured.displacement,
                "displacement (mm)",
                "force (N)",
                lines,
                2 * measured.force_sd,
                "± 2 standard errors of the mean",
                below_label="model − recorded (N)",
            )
        )
    return blocks


def _leg_itself(fits: Sequence[LegFit], pressed: web.PressedSection | None, note: str) -> list[web.Block]:
    """Return the leg's last full solve in 3D, and the section to press."""
    chosen, blocks = preferred(fits), list[web.Block]()
    for one in (chosen, *reversed(fits)):
        found = one.details.spatial
        if isinstance(found, SpatialEvidence) and found.pressed is not None:
            what = "the section, extruded" if found.extruded else "the leg's own shape"
            solved = f" with the {LAW_NAMES[one.law]} law"
            if found.confirmations:
                solved += f" at C10 {mpa_to_kpa(found.confirmations[-1].c10):.3g} kPa"
            caption = f"The leg in 3D ({what}){solved}, while the cylinder is pressed in (model)."
            blocks.append(pressed_leg(found.pressed, caption))
            break
    subject = chosen.details.subject
    if chosen.details.plane or subject.indenter.lies_along:
        blocks.append(pressed or still_section(subject))
    return [*blocks, web.Prose(note)] if note else blocks


def _site_table(chosen: LegFit) -> web.WebTable:
    """Return what each of several sites says by itself."""
    caption = TOLD["own_values"].format(law=LAW_NAMES[chosen.law])
    rows = [
        {
            "site": one.name,
            "rms (N)": f"{one.force.rms:.3g}",
            "farthest at (mm)": f"{one.force.farthest_at:.3g}",
            "chi-square": estimates.chance(one.goodness),
            **{
                symbol_of(name): f"{estimates.own_value(one, name)} ({one.by_itself[name].departure:+.1f})"
                for name in chosen.estimates
            },
        }
        for one in chosen.tests
    ]
    return web.WebTable.of(caption, rows)


def _tested(fits: Sequence[LegFit]) -> Iterator[str]:
    yield from estimates.comparison(fits)
    for one in reversed(fits):
        if len(one.tests) > 1:
            yield f"All sites together, {LAW_NAMES[one.law]} law: chi-square {estimates.chance(one.goodness)}."
            yield _agreement(one)
            for test in one.tests:
                each = (f"{symbol_of(name)} {estimates.own_value(test, name)}" for name in test.by_itself)
                fits_by = f"rms {test.force.rms:.3g} N, chi-square {estimates.chance(test.goodness)}"
                yield f"{test.name}: {fits_by}; by itself {', '.join(each)}."
        yield from channel_lines(one)


def _agreement(fit: LegFit) -> str:
    """Whether the sites agree."""
    far = {name: fit.farthest(name) for name in fit.estimates}
    most = max(far, key=lambda name: abs(far[name].by_itself[name].departure))
    departure = far[most].by_itself[most].departure
    worst = {"most": far[most].name, "departure": departure, "symbol": symbol_of(most)}
    text = TOLD["sites_differ"].format(chance=estimates.chance(fit.agreement), **worst)
    if (ratio := fit.agreement.birge_ratio) > 1:
        text += f" This widens the intervals by a factor of up to {ratio:.3g} (Birge's ratio)."
    return text


def _next(chosen: LegFit) -> list[str]:
    suspect, several, spatial = _suspect(chosen), len(chosen.tests) > 1, chosen.details.spatial
    diagnose = f"legfem diagnose {options_of(suspect)}"
    # A diagnosis is of a section in plane strain.
    along = suspect.indenter.lies_along
    if not (chosen.goodness.fits and chosen.agreement.fits):
        how = diagnose if along else "press there with a cylinder along the leg, and diagnose that"
        if several:
            return [f"Find out what is different at {suspect.site or 'that site'}: {how}"]
        return [f"Don't use the stiffness. Find out which physics is missing: {how}"]
    by_ends = "most of the uncertainty comes from the cylinder's ends, and pressing deeper will not reduce it"
    solid = ", or solve this leg in 3D (--model 3d)" if spatial is None else ""
    by_ends += f"; use a longer cylinder{solid}"
    lines = estimates.how_to_narrow(chosen.asked, _steps_left(chosen), by_ends) or [
        f"Use C10 together with the law it belongs to ({LAW_NAMES[chosen.law]}) and with the depth that was used."
    ]
    if along:
        by_site = ", site by site" if several else ""
        lines.append(f"Find out which effects may be hidden{by_site}: {diagnose}")
    return lines


def _steps_left(chosen: LegFit) -> list[str]:
    """Return which recordings would narrow a leg's stiffness, but those that are there."""
    steps, curves = list[str](), [curve_of(one) for one in chosen.tests]
    for site in chosen.details.leg.sites:
        depths = {trial.name: trial.loading.depth for trial in site.trials}
        deepest = max(depths.values(), default=0.0)
        short = [(name, depth) for name, depth in depths.items() if depth < _CUT_SHORT * deepest]
        steps += [
            f"leave {name} out, which ends at {at:.0f} mm where others reach {deepest:.0f} mm" for name, at in short
        ]
    if not steps and min(curve.displacement[-1] for curve in curves) < REACHED_MM:
        steps.append("press deeper")
    if len(curves) > 1 or isinstance(chosen.details.spatial, SpatialSites):
        steps.append("press where the fat is thinner")
    return [*steps, "repeat the test"] if min(curve.n_trials for curve in curves) < _REPEATS else steps


_CUT_SHORT = 0.8
"""Of the deepest trial's depth, below which another cuts all of them short."""
_REPEATS = 3
"""Of a test, as labs make them."""


def _suspect(chosen: LegFit) -> Subject:
    """The site that fits least, or that departs most where sites disagree."""
    sites = dict(zip((one.name for one in chosen.tests), chosen.details.leg.sites, strict=True))
    if chosen.agreement.fits:
        return sites[min(chosen.tests, key=lambda one: one.goodness.p_value).name]
    far = max(chosen.tests, key=lambda one: max(abs(own.departure) for own in one.by_itself.values()))
    return sites[far.name]
