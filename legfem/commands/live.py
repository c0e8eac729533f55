"""``legfem live``."""

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from legfem.commands.options import Jobs, Site, print_outcome
from legfem.common.command_line import AsJson, CheckedCommand, Quiet, command_context, parallel_context, results_folder

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)


@app.command(cls=CheckedCommand)
def live(
    folder: Path,
    site: Site = None,
    out: Path | None = None,
    library: Path | None = None,
    within: Annotated[str, typer.Option("--for", "--within")] = "15s",
    once: Annotated[bool, typer.Option("--once")] = False,
    jobs: Jobs = None,
    quiet: Quiet = False,
    as_json: AsJson = False,
) -> None:
    """Watch a leg's folder while the leg is in the rig, and say what to do next while it is there.

    Says of each trial, as soon as its file is whole, whether it is usable; then what all trials so
    far give, and what to measure next. With wanted = { C10_percent = 10 } in subject.toml it says
    when C10 is known well enough. Ctrl-C ends it; what is solved is kept.

    Example: legfem live path/to/folder

    Parameters
    ----------
    folder
        A leg's folder, whose recordings/ an instrument fills.
    out
        Folder for results; results/live-ID by default.
    library
        Folder of the legs' responses, as of diagnose.
    within
        Time for an answer, after each trial.
    once
        End when what is there was answered.
    """
    with parallel_context(jobs, quiet=quiet) as processes:
        from legfem.api.diagnosis import diagnose
        from legfem.api.live import follow, visit_of
        from legfem.api.loading import check_folder, seconds_of
        from legfem.api.results import DIAGNOSIS, Diagnosed

        seconds = seconds_of("within", within)
        check_folder("library", library)
        visit, brief = visit_of(folder, site or ""), quiet or as_json
        answer = partial(diagnose, library=library, jobs=processes, progress=not brief)

        def tell(lines: list[str]) -> None:
            if lines and not brief:
                print("\n".join(lines), flush=True)

        def answered(found: Diagnosed) -> None:
            report = found.write(results)
            tell([f"report: {report}", ""])
            if brief:
                print_outcome("", results / DIAGNOSIS, report, quiet, as_json)

        with (
            results_folder(out, f"live-{visit.leg.id}") as results,
            command_context(f"the last answer is in {results}, and the same command goes on", quiet),
        ):
            follow(visit, answer, tell, answered, seconds or 0.0, once)
