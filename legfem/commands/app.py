"""``legfem app``."""

import secrets
import socket
import webbrowser
from pathlib import Path
from typing import Annotated

import typer

from legfem.common.command_line import CheckedCommand, command_context
from legfem.common.errors import InputError

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)


@app.command(cls=CheckedCommand)
def serve(
    workspace: Path = Path("legfem-workspace"),
    port: Annotated[int, typer.Option(min=1024, max=65535)] = 8765,
    browser: Annotated[bool, typer.Option("--browser/--no-browser")] = True,
) -> None:
    """Use legfem in a browser window: drop a folder, look at it, run the commands, read reports.

    Serves this machine alone, and only who has the address with its token. What is done stands in
    the workspace: runs go on when the server is stopped, and it finds them again.

    Example: legfem app --workspace my-legs

    Parameters
    ----------
    workspace
        Folder that holds everything that the app does.
    port
        On 127.0.0.1.
    browser
        Whether to open a browser's window.
    """
    with command_context("start it again; runs went on meanwhile"):
        _check_free(port)
        from legfem.app.workspace import Workspace

        opened = Workspace.opened(workspace)
        token, once = secrets.token_urlsafe(32), secrets.token_urlsafe(32)
        import uvicorn

        from legfem.app.guard import ADDRESS, Guard
        from legfem.app.server import application

        guarded = Guard(application(opened), token, port, {once})
        address = f"http://{ADDRESS}:{port}/?token="
        print(f"workspace: {opened.folder}\nopen:      {address}{token}", flush=True)
        print("Ctrl-C ends the server; runs go on.", flush=True)
        if browser:
            webbrowser.open(f"{address}{once}")
        uvicorn.run(
            guarded, host=ADDRESS, port=port, log_level="warning", access_log=False, timeout_graceful_shutdown=2
        )


def _check_free(port: int) -> None:
    with socket.socket() as tried:
        tried.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            tried.bind(("127.0.0.1", port))
        except OSError:
            problem = "another program uses it (is legfem's app running already?)"
            remedy = "give another port, or use the window that is open"
            raise InputError("--port", f"{port}", problem, remedy) from None
