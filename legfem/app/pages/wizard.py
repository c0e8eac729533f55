"""What a folder without a description is, asked on one page: what it is, its sizes, columns and instrument."""

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import tomlkit
from nicegui import run as background
from nicegui import ui
from nicegui.events import GenericEventArguments

from legfem.app.description import FASCIA_MM, Setting, Value, contours_in, describe, is_contours, known_tests, scans_in
from legfem.app.pages.forms import column_fields, first_readable, setting_field, typed_value
from legfem.app.pages.frame import ASK, WORDS, ask, dropdown, hinted, refused, tag, wanting
from legfem.app.workspace import Workspace, files_of, is_scan, text_of
from legfem.common.documents import write_atomically
from legfem.common.errors import MISSING, InputError
from legfem.data.formats import may_be_recording
from legfem.data.recording import PLAIN_COLUMNS, QUANTITIES, SourceColumns
from legfem.geometry.contours import read_contours
from legfem.geometry.motion import CuttingPlane
from legfem.geometry.section import CALF, LegSection, line_of_travel
from legfem.legs.schema import SectionEntry
from legfem.legs.typical import TYPICAL_LIMBS
from legfem.report.render import filled
from legfem.report.style import BONE_COLOUR, REGION_COLOURS, part_colour
from legfem.specimens.kinds import kinds
from legfem.specimens.sizes import sizes_of_heading

_COLOURS = {"fat": REGION_COLOURS["superficial"], "muscle": REGION_COLOURS["deep"], "bone": BONE_COLOUR}
_TESTS = {name: kind.done for name, kind in kinds().items()}
_PIXELS = 4.0
"""A millimetre of the section that is clicked."""
_ROOM, _DRAWN_RADIUS = 35.0, 15.0
"""About it, and of the cylinder that is drawn, mm."""

type Stated = dict[tuple[str, ...], Value]
"""Values of the description by tables and key."""
type Read = Callable[[], Stated]

_FILES = {"leg": "subject.toml", "stocking": "leg.toml", "specimens": "specimen.toml"}


def describe_page(workspace: Workspace, name: str, found: dict[str, Any]) -> None:
    """Put the questions about a folder, and the buttons that describe and run it."""
    folder = workspace.input(name)
    contours, scans = contours_in(folder), scans_in(folder)
    first = first_readable(found)
    tested = any(may_be_recording(path) and not is_contours(path) for path in files_of(folder))
    answers = {"leg": True, "stocking": scans, "specimens": tested and not contours}
    possible = [kind for kind, may_be in answers.items() if may_be]
    state = SimpleNamespace(kind=possible[0] if len(possible) == 1 else "")
    tag("h2", "What is it?")
    cards = dict[str, ui.element]()

    def choose(kind: str) -> None:
        state.kind = kind
        for one, card in cards.items():
            card.props(f"aria-pressed={'true' if one == kind else 'false'}")

    with ui.element("div").classes("inrow"):
        for kind in possible:
            cards[kind] = tag("button", "", "kind").props("type=button").on("click", partial(choose, kind))
            with cards[kind]:
                ui.html(filled("kind.svg", kind=kind, **_COLOURS), sanitize=False)
                tag("span", WORDS["kinds"][kind])
    choose(state.kind)
    lab = tomllib.loads(text_of(workspace.lab)) if workspace.lab.is_file() else {}
    with ui.element("div").bind_visibility_from(state, "kind", bool):
        forms: dict[str, Read] = {}
        for kind in possible:
            with ui.element("div").bind_visibility_from(state, "kind", value=kind):
                match kind:
                    case "leg":
                        forms[kind] = _pressed(folder, [*contours, *scans], lab)
                    case "stocking":
                        forms[kind] = _dressed(scans)
                    case _:
                        forms[kind] = _tested(first or {})
        with ui.element("div").bind_visibility_from(state, "kind", lambda kind: kind in ("leg", "specimens")):
            columns = _columns(first)
        with ui.element("div").bind_visibility_from(state, "kind", value="leg"):
            instrument, keep = _instrument(first, lab)

        def done(then: Callable[[], None]) -> None:
            file = _FILES[state.kind]
            try:
                channels = columns() if state.kind != "stocking" else None
                errors = instrument() if state.kind == "leg" else {}
                describe(folder, file, forms[state.kind]() | errors, channels)
            except InputError as error:
                wanted.text = _of_the_form(error, folder)
                wanted.set_visibility(True)
                return
            if errors and keep.value:
                _keep_for_others(workspace.lab, folder / file)
            then()

        wanted = wanting("").props("role=alert")
        wanted.set_visibility(False)
        with ui.element("div").classes("inrow"):
            ui.button(ASK, on_click=lambda: done(lambda: ask(workspace, name)))
            ui.button("Only save this", on_click=lambda: done(ui.navigate.reload)).props("outline")


def _keep_for_others(lab: Path, path: Path) -> None:
    """Write what a leg's description has alike with others to the lab's file."""
    given = tomllib.loads(path.read_text(encoding="utf-8"))
    rig = {key: value for key, value in given["indenter"].items() if key in ("diameter_mm", "length_mm", "shape")}
    before = tomllib.loads(text_of(lab)) if lab.is_file() else {}
    write_atomically(lab, tomlkit.dumps({**before, "indenter": rig, "instrument": given["instrument"]}))


_FORM = "form"
"""Where an error is that the form itself finds."""


def _of_the_form(error: InputError, folder: Path) -> str:
    """Say what is wrong as the form calls it: whoever fills it in knows of no file and key."""
    if error.field in WORDS["fields"]:
        return f"{WORDS['fields'][error.field]}: {error.problem}; {error.remedy}"
    if error.source == _FORM:
        return f"{error.field}: {error.problem}; {error.remedy}"
    return str(error).removeprefix(f"{folder}/")


def _numbers(boxes: Mapping[tuple[str, ...], ui.number]) -> Stated:
    """Numbers of a form's fields, all of which are needed."""
    if missing := [box.props["label"] for box in boxes.values() if box.value is None]:
        raise InputError(_FORM, ", ".join(missing), MISSING, "fill in every one")
    return {key: float(box.value) for key, box in boxes.items()}


def _number(label: str, help: str, value: float | None = None) -> ui.number:
    return hinted(ui.number(label, value=value), help)


def _pressed(folder: Path, sources: list[str], lab: Mapping[str, Any]) -> Read:
    place: Stated = {}
    boxes: dict[tuple[str, ...], ui.number] = {}

    def put(table: str, key: str, help: str, value: float | None = None) -> None:
        boxes[table, key] = _number(WORDS["fields"][f"{table}.{key}"], help, value)

    if sources:
        tag("h2", "Where was it pressed?")
        _aimed(folder, sources, place)
    else:
        tag("h2", "How large is the limb?")
        with ui.element("div").classes("fields"):
            pressed = ", ".join(f"{name} {usual.pressed}" for name, usual in TYPICAL_LIMBS.items())
            limb = dropdown(list(TYPICAL_LIMBS), CALF, "limb", f"and from where it was pressed: {pressed}")
            limb.on_value_change(lambda: place.update({("section", "limb"): limb.value}))
            put("section", "girth_mm", "with a tape, where it was pressed")
            put("section", "fat_mm", "by ultrasound, or half a skinfold; of a heel pad, down to the bone")
        tag("p", WORDS["told"]["no_contours"], "quiet")
    tag("h2", "What pressed it?")
    rig = lab.get("indenter", {})
    with ui.element("div").classes("fields"):
        shape = dropdown(
            WORDS["shapes"], rig.get("shape", "cylinder"), "what pressed it", "the part that touches the skin"
        )
        put("indenter", "diameter_mm", "of the cylinder, ball or punch", rig.get("diameter_mm"))
        put("indenter", "length_mm", "along its axis", rig.get("length_mm"))
        axis = _number("cylinder turned by (degrees)", "0 along the leg, 90 across", 0.0)
        shape.set_visibility(bool(sources))
        boxes["indenter", "length_mm"].bind_visibility_from(shape, "value", value="cylinder")
        axis.bind_visibility_from(shape, "value", lambda value: value == "cylinder" and bool(sources))

    def read() -> Stated:
        cylinder = shape.value == "cylinder"
        stated = _numbers({key: box for key, box in boxes.items() if cylinder or key[-1] != "length_mm"})
        if sources and ("indenter", "aim_mm") not in place:
            raise InputError(_FORM, "place", MISSING, "click the section where the skin was pressed")
        if not cylinder:
            stated["indenter", "shape"], stated["indenter", "length_mm"] = shape.value, None
        elif axis.value:
            stated["indenter", "axis_deg"] = float(axis.value)
        return place | stated

    return read


def _aimed(folder: Path, sources: list[str], place: Stated) -> None:
    """Put a section that is clicked where it was pressed; ``place`` takes aim, direction, level and source."""
    with ui.element("div").classes("fields"):
        chosen = dropdown(sources, sources[0], "contours, or a scan", "the file with the outlines of the leg")
        level = _number("level to cut a scan at (mm)", "in the scan's coordinates; Enter cuts it")
        chosen.set_visibility(len(sources) > 1)
        level.bind_visibility_from(chosen, "value", lambda value: is_scan(folder / value))
    shown = ui.element("div")

    async def draw() -> None:
        scan = is_scan(folder / chosen.value)
        place.clear()
        place["section", "scan" if scan else "contours"] = chosen.value
        place["section", "level_mm"] = level.value if scan else None
        shown.clear()
        if scan and level.value is None:
            return
        try:
            section = await background.io_bound(_section, folder, chosen.value, level.value if scan else None)
            assert section is not None
        except InputError as error:
            with shown:
                refused(str(error))
            return
        with shown:
            _clicked(section, place)

    chosen.on_value_change(draw)
    level.on("change", draw)
    ui.timer(0.0, draw, once=True)


def _section(folder: Path, source: str, level: float | None) -> LegSection:
    """Contours of a file, or of a scan cut at a level (mm)."""
    if level is None:
        return read_contours(folder / source, FASCIA_MM)
    from legfem.imaging.leg_source import LegSource

    entry = SectionEntry(scan=source, level_mm=level, fascia_thickness_mm=FASCIA_MM)
    scan = LegSource.opened(folder, folder / "subject.toml", "section", entry, {})
    return scan.section(CuttingPlane.at_level(level), FASCIA_MM)


def _clicked(section: LegSection, place: Stated) -> None:
    low, high = section.skin.min(axis=0) - _ROOM, section.skin.max(axis=0) + _ROOM

    def pixels(points: Any) -> Any:
        return (np.asarray(points) - [low[0], high[1]]) * [_PIXELS, -_PIXELS]

    parts = [(part, part_colour(section, part), pixels(section.contour(part))) for part in section.parts]
    tag("p", "Click the section where the skin was pressed. The direction of travel is then square to the skin.")
    width, height = (high - low) * _PIXELS

    picture_of = partial(filled, "aim.svg", width=width, height=height, parts=parts, bone=BONE_COLOUR)
    picture = ui.html(picture_of(), sanitize=False).classes("aim")
    with ui.element("div").classes("fields"):
        boxes = [
            _number("aim x (mm)", "of a point on the line of travel"),
            _number("aim y (mm)", "of the same point; y is upwards in the picture"),
            _number("direction of travel (degrees)", "counter-clockwise from the right; 90 is upwards"),
        ]

    def show() -> None:
        if any(box.value is None for box in boxes):
            return
        x, y, direction = (float(box.value) for box in boxes)
        place["indenter", "aim_mm"], place["indenter", "direction_deg"] = [x, y], direction
        way = np.array([np.cos(np.radians(direction)), np.sin(np.radians(direction))])
        ends = pixels([np.array([x, y]) - _DRAWN_RADIUS * way, np.array([x, y]) + 12.0 * way])
        picture.content = picture_of(travel=ends.ravel().tolist(), radius=_DRAWN_RADIUS * _PIXELS)

    def clicked(event: GenericEventArguments) -> None:
        point = np.array(event.args) * [high[0] - low[0], low[1] - high[1]] + [low[0], high[1]]
        aim, direction = line_of_travel(section, point)
        for box, value in zip(boxes, (*aim, direction), strict=True):
            box.value = round(float(value), 1)

    for box in boxes:
        box.on_value_change(show)
    where = "(e) => {const b = e.currentTarget.getBoundingClientRect(); emit("
    picture.on("click", clicked, js_handler=f"{where}(e.clientX - b.x) / b.width, (e.clientY - b.y) / b.height)}}")


def _dressed(scans: list[str]) -> Read:
    with ui.element("div").classes("fields"):
        bare = dropdown(scans, scans[0], "scan of the bare leg", "the file of the scan without the stocking")
        second, said = scans[1] if len(scans) > 1 else "", "leave it empty to predict pressures only"
        other = dropdown(["", *scans], second, "in its stocking", said)
        strength = dropdown(["1", "2", "3", "4"], "2", "class (RAL-GZ 387/1)", "the compression class on the package")
    return lambda: {
        ("bare", "scan"): bare.value,
        ("compressed", "scan"): other.value or None,
        ("stocking", "compression_class"): strength.value,
    }


def _tested(looked: Mapping[str, Any]) -> Read:
    """Put the tests and their sizes, begun with those that the heading of the recording seen first states."""
    heading = looked.get("sizes") or {}
    tag("h2", "What was done to them?")
    with ui.element("div").classes("fields"):
        first, said = next(iter(_TESTS)), "the kind of test; its sizes are asked for below"
        chosen = dropdown(_TESTS, first, "what was done", said)
    fields: dict[str, list[tuple[Setting, Callable[[], str]]]] = {}
    for test, settings in known_tests().items():
        with ui.element("div").classes("fields") as shown:
            shown.bind_visibility_from(chosen, "value", value=test)
            sizes = sizes_of_heading(kinds()[test].own, heading)
            settings = [replace(one, value=sizes.get(one.key[-1])) for one in settings]
            fields[test] = [(one, setting_field(one)) for one in settings]
    if heading:
        tag("p", f"Sizes are those that the heading of {looked['file']} states, where it does: check them.", "quiet")
    tag("p", WORDS["told"]["one_size"], "quiet")

    def read() -> Stated:
        stated: Stated = {}
        for one, get in fields[chosen.value]:
            value = stated[one.key] = typed_value(one, get())
            if one.needed and value is None:
                raise InputError(_FORM, one.key[-1], "is missing", "fill it in")
        return stated

    return read


def _columns(first: dict[str, Any] | None) -> Callable[[], SourceColumns | None]:
    """Put which columns are read as what, and a form for other ones; return what gives them."""
    if first is None:
        return lambda: None
    tag("h2", "Which columns?")
    known = first["channels"]
    if known:
        parts = (
            f"{quantity} from '{known[quantity]['column']}' ({known[quantity]['unit']}"
            f"{', reversed' if known[quantity].get('sign', 1) < 0 else ''})"
            for quantity in QUANTITIES
        )
        tag("p", f"In {first['file']}: {', '.join(parts)}.")
    other = ui.checkbox("choose columns, units and directions", value=not known)
    with ui.element("div").bind_visibility_from(other, "value"):
        chosen = column_fields(first)

    def read() -> SourceColumns | None:
        columns = chosen()
        return None if columns == PLAIN_COLUMNS else columns

    return read


def _instrument(first: dict[str, Any] | None, lab: Mapping[str, Any]) -> tuple[Read, ui.checkbox]:
    """Put the instrument's errors, as the lab states them or the recording shows; return what reads them."""
    shown = (first or {}).get("noise")
    known = lab.get("instrument", {})
    tag("h2", "How exact is the instrument?")
    if known:
        tag("p", "As lab.toml states it.")
    elif shown:
        tag("p", "These errors are estimated from the recording's noise. If you know the instrument's, give those.")
    by_sample = tuple(float(f"{value:.2g}") for value in shown or ()) or (None, None)
    with ui.element("div").classes("fields") as fields:
        named = {"force_sd_N": "error of force (N)", "displacement_sd_mm": "error of displacement (mm)"}
        boxes: dict[tuple[str, ...], ui.number] = {
            ("instrument", key): _number(label, "standard deviation of a reading", value)
            for (key, label), value in zip(named.items(), by_sample, strict=True)
        }
    fields.set_visibility(not known)
    keep = ui.checkbox("keep indenter and instrument for further legs (lab.toml)")
    keep.set_visibility(not known)

    return (lambda: {} if known else _numbers(boxes)), keep
