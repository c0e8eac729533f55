"""The server: uploads, files of runs, and the pages, behind the guard."""

from pathlib import Path
from typing import Annotated

from fastapi import Body, FastAPI, Request
from fastapi.responses import FileResponse, JSONResponse, PlainTextResponse, Response
from nicegui import ui
from starlette.requests import ClientDisconnect

from legfem.app.outcomes import answers_of, as_csv, as_xlsx
from legfem.app.pages.input import input_page
from legfem.app.pages.overview import compare_page, home_page
from legfem.app.pages.run import run_page
from legfem.app.pages.study import study_page
from legfem.app.pages.wizard import describe_page
from legfem.app.runs import runs_of
from legfem.app.workspace import Workspace
from legfem.common.errors import InputError

_ALONE = {"content-security-policy": "sandbox allow-scripts"}
"""A report's scripts run, but have nothing of the app's, in a window of its own either."""
_ASSETS = Path(__file__).resolve().parents[1] / "resources" / "web"
_TABLES = {
    "csv": (as_csv, "text/csv; charset=utf-8"),
    "xlsx": (as_xlsx, "application/vnd.openxmlformats-officedocument.spreadsheetml.sheet"),
}
_AWAY_S = 120.0
"""How long a window may be silent (asleep, or on a busy machine) until what was typed in it, and
not saved, is given up. By NiceGUI's own 3 s a page that was busy for as long came back empty."""


def application(workspace: Workspace) -> FastAPI:
    """Return the server's application, without its guard; one in a process."""
    server = FastAPI(openapi_url=None, docs_url=None, redoc_url=None)

    @server.exception_handler(InputError)
    async def refuse(request: Request, error: InputError) -> Response:
        return PlainTextResponse(f"{error}\n", 400)

    @server.post("/inputs")
    async def begin(name: Annotated[str, Body(embed=True)]) -> Response:
        return JSONResponse({"name": workspace.new_input(name)})

    @server.put("/inputs/{name}/{path:path}")
    async def receive(name: str, path: str, request: Request) -> Response:
        try:
            await workspace.receive(name, path, request.stream())
        except ClientDisconnect:
            return Response(status_code=400)
        return Response(status_code=204)

    @server.get("/files/{kind}/{path:path}")
    async def show(kind: str, path: str) -> Response:
        return FileResponse(_shown(workspace, kind, path), headers=_ALONE)

    @server.get("/assets/app/{name}")
    async def asset(name: str) -> Response:
        return FileResponse(_ASSETS / name) if name in ("app.js", "app.css") else Response(None, 404)

    @server.get("/table.{kind}")
    async def table(kind: str) -> Response:
        if kind not in _TABLES:
            return Response(None, 404)
        write, medium = _TABLES[kind]
        found = [one for run in runs_of(workspace) for one in answers_of(run)]
        name = f'attachment; filename="legfem-results.{kind}"'
        return Response(write(found), media_type=medium, headers={"content-disposition": name})

    _add_pages(workspace)
    ui.run_with(server, title="legfem", show_welcome_message=False, tailwind=False, reconnect_timeout=_AWAY_S)
    return server


def _shown(workspace: Workspace, kind: str, path: str) -> Path:
    """Return a file of a preview or a run that a page may show.

    Raises
    ------
    InputError
        If there is none, or it leads out of the workspace.
    """
    none = InputError("files", path, "there is no such file", "choose one that a page names")
    try:
        root = (workspace.folder / kind).resolve()
        found = (root / path).resolve()
        there = found.is_file()
    except (OSError, ValueError):  # names with a null character, or too long
        raise none from None
    if kind not in ("previews", "runs") or not found.is_relative_to(root) or not there:
        raise none
    return found


def _add_pages(workspace: Workspace) -> None:
    """Give NiceGUI the pages of a workspace."""
    for field in (ui.input, ui.number, ui.select):
        field.default_props("outlined dense stack-label hide-bottom-space")
    ui.button.default_props("unelevated no-caps")
    ui.page("/compare")(lambda: compare_page(workspace))

    @ui.page("/")
    def home(deleted: str = "") -> None:
        home_page(workspace, deleted)

    @ui.page("/study")
    def study(run: str = "") -> None:
        study_page(workspace, run)

    @ui.page("/input/{name}")
    def one_input(name: str) -> None:
        input_page(workspace, name, describe_page)

    @ui.page("/run/{name}")
    def one_run(name: str) -> None:
        run_page(workspace, name)
