"""The page of a leg's fit: one or several sites, from a section in plane strain or from the leg in 3D."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import ClassVar

from matplotlib.figure import Figure

from legfem.common.units import FloatArray, mpa_to_kpa
from legfem.data import LoadingCurve
from legfem.inverse.answer import Finding
from legfem.inverse.catalogue import DEEP_C10, LawName, symbol_of
from legfem.inverse.chosen import preferred
from legfem.inverse.document import KindDocument
from legfem.inverse.fit import Fit
from legfem.legs.details import LegDetails, LegDocument, SpatialEvidence, SpatialSites
from legfem.legs.site import curve_of
from legfem.legs.subject import Subject
from legfem.report import estimates
from legfem.report import page as web
from legfem.report.answers import headline_of
from legfem.report.curves import Curves, Dash, Line, curves_figure
from legfem.report.folder import ReportFile
from legfem.report.further_channels import SHOWS, channel_lines, channels_figure, drawn
from legfem.report.kinds import ReportKind
from legfem.report.kinds.leg_numbers import how_done, known_of
from legfem.report.leg_3d_view import pressed_leg
from legfem.report.leg_figure import SECTION_SHOWS, placement_figure
from legfem.report.leg_options import options_of
from legfem.report.notices import sentences_of
from legfem.report.page import PressedSection
from legfem.report.pressed_section import still_section
from legfem.report.style import DATA_COLOUR, FAINT, LAW_COLOURS, LAW_NAMES, save
from legfem.report.words import BEYOND_A_FIT, fit_probability

type LegFit = Fit[LegDetails]

_DASHES: dict[str, Dash] = {"neo-hookean": "dashed", "reduced-polynomial": "solid"}
_LIKEWISE = "a stated length_mm that is 10 % too low has the same effect as forces that are 10 % too high"
_NOT_TESTED = (
    "A constant factor on the force (the load cell's gain, the cylinder's length, its ends in 3D) "
    "cannot be distinguished from a change of C10, so C10 may be wrong by that factor without any sign of it.",
    "How the tissues behave over time: unloading, holds and other speeds were not used.",
    "Which physics is missing if a law does not fit.",
)
_ALIKE = (
    "An error that is the same at all sites (in the load cell's calibration, the correction for the "
    "cylinder's ends, the assumed stiffness of the fascia) looks like a change of stiffness."
)


class LegReport(ReportKind):
    """What is shown of a leg."""

    kind: ClassVar[str] = "leg"
    document: ClassVar[KindDocument] = LegDocument()

    def page(
        self, fits: Sequence[LegFit], pressed: PressedSection | None = None, command: str = "", note: str = ""
    ) -> web.WebPage:
        """Return the page."""
        return leg_page(fits, pressed, command, note)

    def figure(self, fits: Sequence[LegFit]) -> Figure:
        """Return force and misfit of each law, site by site."""
        found = [f"{LAW_NAMES[fit.law]}: {_short_values(fit)}, rms {fit.cost.rms:.3g} N" for fit in fits]
        what = "\n".join(["Measured and simulated force" + " of all sites together" * _several(fits[0]), *found])
        blocks = _curves(fits, preferred(fits))
        return curves_figure(blocks, what, fits[0].subject.title, fits[0].subject.origin)

    def files(self, fits: Sequence[LegFit], folder: Path) -> list[ReportFile]:
        """Write fit, channels, and where each site was pressed."""
        entries = [
            ReportFile(
                save(self.figure(fits), folder, "fit", svg=True),
                "measured and simulated force and their difference, each law (as the paper's Fig. 7)",
            )
        ]
        if drawn(fits):
            entries.append(ReportFile(save(channels_figure(fits), folder, "channels", svg=True), SHOWS))
        leg = fits[0].details.leg
        for site in leg.sites:
            several = len(leg.sites) > 1
            name = f"section-{site.site}" if several else "section"
            shows = f"{site.site}: {SECTION_SHOWS}" if several else SECTION_SHOWS
            entries.append(ReportFile(save(placement_figure(site), folder, name), shows))
        return entries


def leg_page(
    fits: Sequence[LegFit], pressed: PressedSection | None = None, command: str = "", note: str = ""
) -> web.WebPage:
    """Page of a leg's fits.

    Parameters
    ----------
    fits
        One a law, of one leg.
    pressed
        The section of its only site, to be pressed; as it is unpressed without it.
    command
        That was given; empty where there was none.
    note
        On the solve that pressed it.
    """
    chosen = preferred(fits)
    leg, several = chosen.details.leg, _several(chosen)
    where = f", from {len(leg.sites)} sites together" if several else ""
    return web.WebPage(
        title=f"How stiff is the deep tissue (muscle) of {'leg' if several else 'subject'} {leg.id}{where}?",
        subject=leg.title,
        origin=leg.origin,
        headline=_headline(chosen),
        warnings=sentences_of((chosen, *fits)),
        known=known_of(fits),
        chapters=[
            web.Chapter("Recordings and model", [*_site_table(chosen), *_curves(fits, chosen), *drawn(fits)]),
            *_leg_itself(fits, chosen, pressed, note),
            web.Chapter(web.TESTED, [web.Bullets(_tested(fits))]),
            web.Chapter(
                "What could not be tested",
                [
                    web.Bullets(
                        [
                            *estimates.rests_on(chosen.estimates, _LIKEWISE),
                            *_NOT_TESTED,
                            *((_ALIKE,) if several else ()),
                        ]
                    )
                ],
            ),
            web.Chapter("What to do next", [web.Bullets(_next(chosen))]),
            web.Chapter("How it was done", how_done(fits)),
        ],
        repeat=web.Repeat(command, chosen.versions, {"seed": f"{chosen.log.seed}"}),
    )


def fit_curves(
    name: str, where: str, measured: LoadingCurve, predicted: Mapping[LawName, FloatArray], best: LawName
) -> Curves:
    """Recorded forces beside those that laws predict (n,), N.

    Parameters
    ----------
    name
        Of the panels.
    where
        Begins the caption; empty where there is one place.
    measured
        n forces.
    predicted
        By law.
    best
        Law from which trials are taken beneath.
    """
    many = measured.n_trials > 1
    lines = [
        Line(
            f"mean of {measured.n_trials} trials" if many else "the one trial",
            measured.force,
            None,
            DATA_COLOUR,
            points=True,
        )
    ]
    if many:
        lines += [
            Line(f"trial {k + 1}", force, predicted[best] - force, FAINT, "dotted", faint=True, tabled=False)
            for k, force in enumerate(measured.trial_force)
        ]
    lines += [
        Line(f"model, {LAW_NAMES[law]}", force, force - measured.force, LAW_COLOURS[law], _DASHES[law])
        for law, force in predicted.items()
    ]
    against = f" The trials in the lower panel are compared with the {LAW_NAMES[best]} law." if many else ""
    return Curves(
        name,
        f"{where}Force over the cylinder's displacement after first contact: recorded, and of the "
        f"model with each law; beneath, the model less the recording.{against}",
        measured.displacement,
        "displacement (mm)",
        "force (N)",
        "model − recorded (N)",
        lines,
        2 * measured.force_sd,
        "± 2 standard errors of the mean",
    )


def _several(fit: LegFit) -> bool:
    return len(fit.tests) > 1


def _headline(chosen: LegFit) -> web.Headline:
    answer, law = chosen.answer, LAW_NAMES[chosen.law]
    if answer.finding is Finding.TESTS_DISAGREE:
        wrong = _agreement(chosen)
    elif answer.finding is Finding.MISFIT:
        wrong = (
            f"The recordings show an effect that the {law} law leaves out ({fit_probability(chosen.goodness.p_value)})."
        )
    else:
        wrong = "None in the recordings, of which all phases were checked."
        if chosen.weighting == "paper":
            wrong = "None in the loading part of the recordings, which is all that was checked."
        if _suspect(chosen).indenter.lies_along:
            wrong += f" {BEYOND_A_FIT}"
    no_number = answer.tone == "wrong"
    c10 = _c10_value(chosen)
    return headline_of(
        answer,
        [
            ("Problems found", wrong),
            *([("How stiff", f"{_values(chosen)}.")] if _several(chosen) or no_number else []),
            ("How sure", estimates.how_sure(chosen.estimates)),
            (
                "Effect on C10",
                f"{c10} is the best fit, but don't rely on it: its interval does not include the effect that is "
                f"missing."
                if no_number
                else f"C10 is {c10}. If the assumed stiffness of fat or fascia, the "
                "units or the sizes are wrong, C10 changes: the table of numbers and “What could not be tested” "
                "say by how much.",
            ),
            ("What to do", _next(chosen)[0]),
            *(
                []
                if no_number or DEEP_C10 not in chosen.estimates
                else estimates.high_or_low("deep", chosen.estimates[DEEP_C10].shown.value)
            ),
        ],
    )


def _values(chosen: LegFit) -> str:
    return "; ".join(
        f"{estimates.words_of(name)} {estimates.value_text(found)} ({estimates.interval_text(found, '95 % ')})"
        + (f", {estimates.moduli_of(found)}" if name == DEEP_C10 else "")
        for name, found in chosen.estimates.items()
        if found.parameter.role == "identified"
    )


def _short_values(fit: LegFit) -> str:
    return ", ".join(
        f"{symbol_of(name)} {estimates.value_text(found)} ({estimates.interval_text(found)})"
        for name, found in fit.estimates.items()
    )


def _c10_value(chosen: LegFit) -> str:
    found = chosen.estimates.get(DEEP_C10)
    if found is not None:
        return estimates.value_text(found)
    return estimates.held_text(DEEP_C10, chosen.answer.parameters["C10_given"])


def _leg_itself(fits: Sequence[LegFit], chosen: LegFit, pressed: PressedSection | None, note: str) -> list[web.Chapter]:
    """The section to press and the leg's last full solve in 3D; nothing of several sites."""
    if _several(chosen):
        return []
    blocks: list[web.Block] = []
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
    if note:
        blocks.append(web.Prose(note))
    return [web.Chapter("The leg, pressed", blocks)] if blocks else []


def _curves(fits: Sequence[LegFit], chosen: LegFit) -> list[Curves]:
    several = _several(chosen)
    blocks = []
    for number, one in enumerate(chosen.tests):
        predicted = {fit.law: fit.tests[number].force.predicted for fit in fits}
        where = f"{one.name}. " if several else ""
        name = f"site{number}" if several else "fit"
        blocks.append(fit_curves(name, where, curve_of(one), predicted, chosen.law))
    return blocks


def _site_table(chosen: LegFit) -> list[web.WebTable]:
    """What each of several sites says by itself."""
    if not _several(chosen):
        return []
    names = list(chosen.estimates)
    return [
        web.WebTable(
            f"Values that each site gives by itself, {LAW_NAMES[chosen.law]} law (± one standard error; in "
            "brackets, the difference from the joint value in standard errors of that difference)",
            ["site", "rms (N)", "chi-square", *map(symbol_of, names)],
            [
                [
                    one.name,
                    f"{one.force.rms:.3g}",
                    estimates.chance(one.goodness),
                    *(f"{estimates.own_value(one, name)} ({one.by_itself[name].departure:+.1f})" for name in names),
                ]
                for one in chosen.tests
            ],
        )
    ]


def _tested(fits: Sequence[LegFit]) -> list[str]:
    lines = estimates.comparison(fits)
    for one in reversed(fits):
        if _several(one):
            law = LAW_NAMES[one.law]
            lines += [
                f"All sites together, {law} law: chi-square {estimates.chance(one.goodness)}.",
                _agreement(one),
                *(
                    f"{test.name}: rms {test.force.rms:.3g} N, chi-square {estimates.chance(test.goodness)}; by itself "
                    + ", ".join(f"{symbol_of(name)} {estimates.own_value(test, name)}" for name in test.by_itself)
                    + "."
                    for test in one.tests
                ),
            ]
        lines += channel_lines(one)
        lines += estimates.why_identifiable(one.estimates, one.law)
    return lines


def _agreement(fit: LegFit) -> str:
    """Whether the sites agree."""
    far = {name: fit.farthest(name) for name in fit.estimates}
    most = max(far, key=lambda name: abs(far[name].by_itself[name].departure))
    departure = far[most].by_itself[most].departure
    text = (
        f"The sites' own values differ by chi-square {estimates.chance(fit.agreement)}; {far[most].name} "
        f"differs most, by {departure:+.1f} standard errors in {symbol_of(most)}."
    )
    if (ratio := fit.agreement.birge_ratio) > 1:
        text += f" This widens the intervals by a factor of up to {ratio:.3g} (Birge's ratio)."
    return text


def _next(chosen: LegFit) -> list[str]:
    suspect = _suspect(chosen)
    diagnose = f"legfem diagnose {options_of(suspect)}"
    # A diagnosis is of a section in plane strain.
    along = suspect.indenter.lies_along
    if not (chosen.goodness.fits and chosen.agreement.fits):
        how = diagnose if along else "press there with a cylinder along the leg, and diagnose that"
        if _several(chosen):
            return [f"Find out what is different at {suspect.site or 'that site'}: {how}"]
        return [f"Don't use the stiffness. Find out which physics is missing: {how}"]
    lines = estimates.how_to_narrow(chosen.estimates, _remedies(chosen))
    if not lines:
        lines.append(
            f"Use C10 together with the law it belongs to ({LAW_NAMES[chosen.law]}) and with the depth that was used."
        )
    if along:
        by_site = ", site by site" if _several(chosen) else ""
        lines.append(f"Check unloading, holds and speeds as well{by_site}: {diagnose}")
    return lines


def _suspect(chosen: LegFit) -> Subject:
    """The site that fits least, or that departs most where sites disagree."""
    sites = dict(zip((one.name for one in chosen.tests), chosen.details.leg.sites, strict=True))
    if chosen.agreement.fits:
        return sites[min(chosen.tests, key=lambda one: one.goodness.p_value).name]
    far = max(chosen.tests, key=lambda one: max(abs(own.departure) for own in one.by_itself.values()))
    return sites[far.name]


def _remedies(chosen: LegFit) -> estimates.Remedies:
    ends_rule = "most of the uncertainty comes from the cylinder's ends, and pressing deeper will not reduce it"
    longer = "use a longer cylinder"
    ends = f"{longer}, or solve this leg in 3D (--model 3d)" if chosen.details.spatial is None else longer
    recordings = "press deeper, repeat the test"
    if isinstance(chosen.details.spatial, SpatialSites) or _several(chosen):
        recordings = "press deeper, or where the fat is thinner"
    return estimates.Remedies(recordings, f"{ends_rule}; {ends}")
