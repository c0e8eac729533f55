"""The page on which legs are chosen for a study, with what is known of each."""

from nicegui import ui

from legfem.app.pages.frame import attempt, dropdown, framed, hinted, page_of, refused, tag, warned
from legfem.app.study import TASKS, begin_study, members_of, table_of
from legfem.app.workspace import Workspace
from legfem.cohort.members import Member, Members
from legfem.common.errors import InputError

_LAWS = {"": "both", "neo-hookean": "neo-Hookean", "reduced-polynomial": "reduced polynomial"}
_DOES = {"identify": "identify: how stiff?", "diagnose": "diagnose: which can be trusted?"}


def study_page(workspace: Workspace, run: str = "") -> None:
    """Put the page; with a run, of the study that is to go on with another table."""
    with framed("A study of several legs"):
        try:
            given = table_of(workspace, run)
        except (InputError, OSError) as error:
            refused(str(error))
            return
        tag(
            "p",
            "One row per leg and visit. Delete the rows of legs that are not in the study, and fill in what you know.",
        )
        tag("p", "You may paste a table from a spreadsheet: headings as below, and any others (age, sex, rater, rig).")
        table = (
            ui.textarea("table of the study", value=given)
            .classes("full")
            .props("autogrow input-style=font-family:monospace")
        )
        hinted(table, "folder is the leg's name here; subject the person, whose two legs or visits belong together")
        seen = ui.element("div")
        with ui.element("div").classes("fields"):
            task = dropdown({one: _DOES[one] for one in TASKS}, TASKS[0], "what to do", "with each leg")
            law = dropdown(_LAWS, "", "law", "of the muscle, where it is identified")

        def draw() -> None:
            seen.clear()
            with seen:
                try:
                    _shown(members_of(workspace, table.value or ""))
                except InputError as error:
                    refused(str(error))

        table.on_value_change(draw)
        draw()
        start = lambda: page_of("run", begin_study(workspace, table.value or "", task.value, law.value, run))  # noqa: E731
        ui.button("Go on with this table" if run else "Run the study", on_click=lambda: attempt(start))
        tag("p", "Legs that are done are kept: a changed table, or one more leg, does only what is new.", "quiet")


def _shown(found: Members) -> None:
    """Put who is in the study as it was understood, and what may be meant otherwise."""
    people = {one.person for one in found.every}
    columns = list(dict.fromkeys(name for one in found.every for name in one.given))
    legs = f"{len(found.every)} leg{'s' * (len(found.every) != 1)} or visits"
    tag("p", f"{legs} of {len(people)} {'person' if len(people) == 1 else 'people'}", "sentence")
    warned(found.notes)
    wide = ui.element("div").classes("wide").props('tabindex=0 role=region aria-label="The study"')
    with wide, ui.element("table"):
        with ui.element("thead"), ui.element("tr"):
            for name in ("leg", *columns):
                tag("th", name).props("scope=col")
        with ui.element("tbody"):
            for one in found.every:
                _row(one, columns)


def _row(one: Member, columns: list[str]) -> None:
    with ui.element("tr"):
        tag("th", one.name).props("scope=row")
        for name in columns:
            value = one.given.get(name, "–")
            tag("td", f"{value:g}" if isinstance(value, float) else value).props(f'data-label="{name}"')
