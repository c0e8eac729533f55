"""``legfem data``."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from legfem.common.command_line import (
    BAD_INPUT,
    AsJson,
    CheckedCommand,
    Quiet,
    brief_output,
    command_context,
    results_folder,
)
from legfem.common.errors import InputError

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)


@app.callback()
def data() -> None:
    """Look at instruments' files before they are used.

    Example: legfem data look trial1.tdms trial2.tdms
    """


@app.command(cls=CheckedCommand)
def look(
    files: Annotated[list[Path] | None, typer.Argument()] = None,
    out: Path | None = None,
    time: str | None = None,
    displacement: str | None = None,
    force: str | None = None,
    sheet: str | None = None,
    specimens: Annotated[bool, typer.Option("--specimens")] = False,
    quiet: Quiet = False,
    as_json: AsJson = False,
) -> None:
    """Propose columns, units and directions of recordings, and grade them from A to D.

    Writes report.html, a picture a file, report.txt, look.json, and recordings.toml: the
    [recordings] block for subject.toml or specimen.toml. All that is inferred is said with its
    reason; what is ambiguous is refused.

    Example: legfem data look trial1.tdms trial2.tdms

    Parameters
    ----------
    files
        Recordings, one trial a file: CSV, text, xlsx, xls, ods, TDMS, LVM, MAT, HDF5, or a zip of one.
    out
        Folder for results; results/look by default.
    time
        Column of the time: NAME or NAME:UNIT.
    displacement
        Column of the displacement, likewise.
    force
        Column of the force, likewise.
    sheet
        Sheet or group, if several have recordings.
    specimens
        The recordings are of specimens, so any depth will do.
    """
    with command_context(quiet=quiet):
        import numpy as np

        from legfem.common.documents import write_atomically, write_document
        from legfem.common.errors import doubt_lines
        from legfem.common.input_files import check_distinct, check_printable
        from legfem.data import Scales, among_repeats, segment
        from legfem.data.channel_reader import frames_in
        from legfem.data.columns import Proposal, propose
        from legfem.data.contact import LEAST_OF_A_LEG_MM, LEG
        from legfem.data.formats import read_sheets
        from legfem.data.formats.labels import Quantity
        from legfem.data.formats.sheet import trial_of
        from legfem.data.plausibility import magnitude_doubts, trial_doubts
        from legfem.data.quality import quality_of
        from legfem.data.reader import trials_in
        from legfem.data.recording import PLAIN_COLUMNS, read_plain, recording_of
        from legfem.report import instrument_file
        from legfem.report.page import PAGE, command_line
        from legfem.report.render import rendered

        # A required argument's help would end in a backslash and [required].
        if not files:
            raise InputError("FILES", "missing", "there is nothing to look at", "give files")
        check_printable(*files)
        asked: dict[Quantity, str | None] = {"time": time, "displacement": displacement, "force": force}
        named = {quantity: column for quantity, column in asked.items() if column is not None}
        tables = [path for path in files if path.is_file() and frames_in(path)]
        files = [path for path in files if path not in tables]
        if not files:
            what = "is a table of points or readings beside a recording"
            raise InputError(tables[0], "time_s", what, "look at it together with its recording")
        files = files if sheet is not None else trials_in(files, named=named)
        check_distinct(files[-1], "name", map(trial_of, files), "give each trial a name of its own")
        read, tomls = [], {}
        for path in files:
            recording = read_plain(path)
            layout = ""
            if recording is not None:
                proposal = Proposal(PLAIN_COLUMNS, ("legfem's own columns",))
            else:
                sheets = [s for s in read_sheets(path) if sheet is None or s.name == sheet]
                if not sheets:
                    raise InputError(path, "--sheet", f"there is no '{sheet}'", "leave --sheet out to see all tables")
                proposal = propose(path, sheets, named, sheet)
                recording = recording_of(path, sheets, proposal.channels)
                layout = instrument_file.recordings_toml(proposal.channels)
            small = float(np.ptp(recording.displacement)) < LEAST_OF_A_LEG_MM
            if small and not specimens:
                why = f"displacement changes by {np.ptp(recording.displacement):.3g} mm in all: judged as a specimen's"
                proposal = Proposal(proposal.channels, (*proposal.reasons, why))
            specimens = specimens or small or bool(recording.sizes)
            scales = Scales.of_specimen(recording) if specimens else LEG
            read.append((proposal, segment(recording, scales=scales)))
            tomls[path] = layout + instrument_file.channels_toml(recording.channels)
        first = files[0]
        other = next((path for path in files if tomls[path] != tomls[first]), None)
        if other is not None:
            remedy = "look at files with the same columns together, and keep each kind in a folder of its own"
            raise InputError(other, "recordings", f"has other columns than {first.name}", remedy)
        trials = among_repeats([trial for _, trial in read])
        recordings = [one.recording for one in trials]
        toml = tomls[first] + instrument_file.frames_toml(tables, recordings, specimens)
        toml += instrument_file.specimens_toml(recordings)
        doubts = (*(doubt for one in trials for doubt in magnitude_doubts(one)), *trial_doubts(trials))
        seen = [
            instrument_file.Looked(one.recording, how, quality_of(one))
            for (how, _), one in zip(read, trials, strict=True)
        ]
        text = "\n".join([*doubt_lines(doubts), *(instrument_file.look_text(*parts) for parts in seen)])
        with results_folder(out, "look") as folder:
            pictures = [instrument_file.draw_look(recording, quality, folder) for recording, _, quality in seen]
            write_atomically(folder / PAGE, rendered(instrument_file.look_web_page(seen, toml, text, command_line())))
            write_atomically(folder / "report.txt", text)
            write_atomically(folder / "recordings.toml", toml)
            path = write_document(folder / instrument_file.LOOK, instrument_file.look_document(seen))
            with brief_output(quiet, as_json) as written:
                written.append(path)
                print(text)
                print(f"for {'specimen' if specimens else 'subject'}.toml:\n\n{toml}")
                print("\n".join(f"picture: {path}" for path in pictures))
                print(f"page: {folder / PAGE}\nreport: {folder / 'report.txt'}")
                print(f"toml: {folder / 'recordings.toml'}\nresult: {path}")


@app.command(cls=CheckedCommand)
def preview(folder: Path, out: Path | None = None, quiet: Quiet = False, as_json: AsJson = False) -> None:
    """Show what a folder is taken for, before anything is solved.

    Writes preview.json and pictures: the section with the indenter or the scans' outlines, the
    recordings with phases, first contact and grade, and what is unlikely. A folder that the
    commands refuse is looked at as far as it can be.

    Example: legfem data preview path/to/folder --out seen

    Parameters
    ----------
    folder
        Folder of a leg, of a leg in a stocking, or of specimens.
    out
        Folder for results; results/preview by default.
    """
    with command_context(quiet=quiet):
        from legfem.common.progress import progress_on
        from legfem.report.preview import PREVIEW, preview_of

        if not folder.is_dir():
            raise InputError(folder, "folder", "not found", "give the path of one")
        with results_folder(out, "preview") as target:
            with progress_on(quiet=quiet) as progress:
                seen = preview_of(folder, target, progress)
            seen.write(target)
            with brief_output(quiet, as_json) as written:
                written.append(target / PREVIEW)
                print(seen.text)
                print(f"preview: {target / PREVIEW}")
            if seen.trouble:
                print(seen.trouble, file=sys.stderr)
                raise typer.Exit(BAD_INPUT)


@app.command(cls=CheckedCommand)
def dicom(
    results: Path, of: Annotated[Path, typer.Option()], visit: str = "", quiet: Quiet = False, as_json: AsJson = False
) -> None:
    """Write a result into a patient's study as a DICOM structured report (TID 1500), report.dcm.

    report.dcm.json has the same in DICOM's JSON model.

    C10, C20 and other constants with units and 95 % intervals, how they were found, and whether
    the model fits; unverified until a person signs it in the hospital's archive.

    Example: legfem data dicom results/identify-3 --of image.dcm --visit "before surgery"

    Parameters
    ----------
    results
        Folder of results, of legfem identify, diagnose or stocking.
    of
        Any DICOM object of the study, such as an image of the leg: patient and study are taken from it.
    visit
        What the visit is called.
    """
    with command_context(quiet=quiet), brief_output(quiet, as_json) as written:
        from legfem.common.documents import write_atomically
        from legfem.inverse.stored import read_result
        from legfem.report.dicom_report import files_of, structured_report

        path, document = results / "report.dcm", results / "report.dcm.json"
        content, model = files_of(structured_report(read_result(results), of, visit))
        write_atomically(path, content)
        write_atomically(document, model)
        written.append(document)
        print(f"report: {path}")
