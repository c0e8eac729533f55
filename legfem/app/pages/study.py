"""The page on which legs are chosen for a study, with what is known of each."""

from nicegui import ui

from legfem.app.pages.frame import WORDS, attempt, dropdown, framed, hinted, page_of, refused, tag, warned, wide_table
from legfem.app.study import begin_study, members_of, table_of
from legfem.app.workspace import Workspace
from legfem.cohort.members import Members
from legfem.common.errors import InputError


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
            .props("autogrow debounce=400 input-style=font-family:monospace")
        )
        hinted(table, "folder is the leg's name here; subject the person, whose two legs or visits belong together")
        seen = ui.element("div")
        with ui.element("div").classes("fields"):
            task = dropdown(WORDS["tasks"], "identify", "what to do", "with each leg")
            law = dropdown(WORDS["laws"], "", "law", "of the muscle, where it is identified")

        def draw() -> None:
            seen.clear()
            with seen:
                try:
                    _shown(members_of(workspace, table.value or ""))
                except InputError as error:
                    refused(str(error))

        table.on_value_change(draw)
        draw()

        def start() -> str:
            return page_of("run", begin_study(workspace, table.value or "", task.value, law.value, run))

        ui.button("Go on with this table" if run else "Run the study", on_click=lambda: attempt(start))
        tag("p", "Legs that are done are kept: a changed table, or one more leg, does only what is new.", "quiet")


def _shown(found: Members) -> None:
    """Put who is in the study as it was understood, and what may be meant otherwise."""
    people = {one.person for one in found.every}
    columns = list(dict.fromkeys(name for one in found.every for name in one.given))
    legs = f"{len(found.every)} leg{'s' * (len(found.every) != 1)} or visits"
    tag("p", f"{legs} of {len(people)} {'person' if len(people) == 1 else 'people'}", "sentence")
    warned(found.notes)
    rows = ([one.name, *(_text(one.given.get(name, "–")) for name in columns)] for one in found.every)
    wide_table("The study", ["leg", *columns], rows)


def _text(value: str | float) -> str:
    return f"{value:g}" if isinstance(value, float) else value
