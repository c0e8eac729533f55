"""Who the app answers: the token, hosts and origins, and what its server gives away."""

import socket
import subprocess
import sys

import pytest
from starlette.responses import PlainTextResponse
from starlette.testclient import TestClient
from starlette.websockets import WebSocketDisconnect

from legfem.app.__main__ import app
from legfem.app.guard import Guard

PORT = 8765
HOST = {"host": f"127.0.0.1:{PORT}"}


async def _within(scope, receive, send):
    if scope["type"] == "websocket":
        await receive()
        await send({"type": "websocket.accept"})
        await send({"type": "websocket.close", "code": 1000})
        return
    await PlainTextResponse("within")(scope, receive, send)


ONCE = "another-secret-that-is-seen-by-all"


@pytest.fixture
def token():
    return "a-secret-of-24-characters"


@pytest.fixture
def visitor(token):
    return TestClient(Guard(_within, token, PORT, {ONCE}), f"http://127.0.0.1:{PORT}", follow_redirects=False)


def test_the_address_with_the_token_lets_a_browser_in_and_then_hides_it(visitor, token):
    answer = visitor.get(f"/run/x?token={token}&a=1")
    assert answer.status_code == 303 and answer.headers["location"] == "/run/x?a=1"
    cookie = answer.headers["set-cookie"].lower()
    assert "httponly" in cookie and "samesite=strict" in cookie
    assert visitor.get("/run/x").text == "within"
    assert "default-src 'self'" in visitor.get("/").headers["content-security-policy"]


def test_what_a_browser_is_begun_with_lets_it_in_once(visitor, token):
    """Whoever lists the machine's processes reads it, when it was used already."""
    answer = visitor.get(f"/?token={ONCE}")
    assert answer.status_code == 303 and token in answer.headers["set-cookie"]
    visitor.cookies.clear()
    assert visitor.get(f"/?token={ONCE}").status_code == 403


def test_the_browser_s_arguments_lack_the_token_and_each_start_has_another(tmp_path, monkeypatch, capsys):
    import uvicorn

    from legfem.commands import app as module

    opened, guards = [], []
    monkeypatch.setattr(module.webbrowser, "open", opened.append)
    monkeypatch.setattr(uvicorn, "run", lambda guard, **_: guards.append(guard))
    monkeypatch.setattr("legfem.app.server.application", lambda workspace: _within)
    for _ in range(2):
        module.serve(tmp_path / "w", port=8766, browser=True)
        (address,) = [line.split()[1] for line in capsys.readouterr().out.splitlines() if line.startswith("open:")]
        assert address.endswith(f"?token={guards[-1].token}") and guards[-1].token not in opened[-1]
        assert guards[-1].once == {opened[-1].partition("token=")[2]}
    first, second = guards
    assert first.token != second.token and len(second.token) >= 32
    assert [path for path in (tmp_path / "w").rglob("*") if path.is_file()] == []


@pytest.mark.parametrize("address", ["/", "/?token=", "/?token=wrong", "/?token=é"])
def test_without_the_token_nothing_is_shown(visitor, address):
    answer = visitor.get(address)
    assert answer.status_code == 403 and "no token" in answer.text
    assert "set-cookie" not in answer.headers


def test_the_token_in_an_address_changes_nothing(visitor, token):
    assert visitor.put(f"/inputs/x/y?token={token}").status_code == 403


def closed_with(visitor, headers):
    with pytest.raises(WebSocketDisconnect) as closed, visitor.websocket_connect("/socket", headers=headers) as socket:
        socket.receive()
    return closed.value.code


@pytest.mark.parametrize(
    "headers",
    [
        {"host": "evil.example"},
        {"host": f"evil.example:{PORT}"},
        {"host": "127.0.0.1:80"},
        {"origin": "http://evil.example"},
        {"origin": "null"},
        {"origin": "http://127.0.0.1:9999"},
        {"sec-fetch-site": "same-site"},
        {"sec-fetch-site": "cross-site"},
    ],
)
def test_other_hosts_and_origins_are_refused_even_with_the_token(visitor, token, headers):
    visitor.get(f"/?token={token}")
    assert visitor.get("/", headers=headers).status_code == 403
    assert visitor.get(f"/?token={token}", headers=headers).status_code == 403
    assert closed_with(visitor, {**HOST, "cookie": f"legfem-{PORT}={token}", **headers}) == 1008


def test_a_socket_needs_the_token_too(visitor, token):
    assert closed_with(visitor, HOST) == 1008
    own = {**HOST, "origin": f"http://127.0.0.1:{PORT}", "cookie": f"legfem-{PORT}={token}"}
    with visitor.websocket_connect("/socket", headers=own) as socket:
        assert socket.receive()["code"] == 1000


def test_files_that_are_sent_arrive_and_others_are_refused_with_a_line(visited):
    workspace, visitor = visited
    name = visitor.post("/inputs", json={"name": "leg"}).json()["name"]
    assert visitor.put(f"/inputs/{name}/recordings/a.csv", content=b"1,2").status_code == 204
    assert (workspace.input(name) / "recordings" / "a.csv").read_bytes() == b"1,2"
    for path in ("..%2f..%2ftoken", "%2e%2e/%2e%2e/token", "a/..%2f..%2f..%2ftoken", ".ssh"):
        answer = visitor.put(f"/inputs/{name}/{path}", content=b"x")
        assert answer.status_code == 400 and answer.text.count("\n") == 1, path
    assert visitor.put("/inputs/..%2fruns/x", content=b"x").status_code in (400, 404)
    assert visitor.put("/inputs/none/x", content=b"x").status_code == 400
    assert (workspace.folder / "token").read_text() == "for the user alone"


def test_only_files_of_runs_and_previews_are_shown(visited):
    workspace, visitor = visited
    folder = workspace.run(workspace.new_run("identify-leg"))
    (folder / "results").mkdir()
    (folder / "results" / "report.txt").write_text("found")
    (folder / "results" / "link").symlink_to("/etc/passwd")
    shown = f"/files/runs/{folder.name}/results"
    answer = visitor.get(f"{shown}/report.txt")
    assert answer.text == "found"
    assert answer.headers["content-security-policy"] == "sandbox allow-scripts"
    for path in (
        f"{shown}/link",
        f"{shown}/..%2f..%2f..%2ftoken",
        "/files/inputs/leg/x",
        "/files/..%2f/token",
        f"{shown}/none",
    ):
        assert visitor.get(path).status_code in (400, 404), path


def test_the_pages_show_what_stands_in_the_workspace(visited):
    workspace, visitor = visited
    name = workspace.new_input("a leg of mine")
    assert name in visitor.get("/").text
    assert "not a plain name" in visitor.get("/input/.hidden").text
    assert "there is none" in visitor.get("/run/nothing").text
    assert visitor.get("/compare").status_code == 200
    assert visitor.get("/assets/app/press.js").status_code == 404
    for kind, begins in (("csv", b"\xef\xbb\xbfrun,of,command"), ("xlsx", b"PK")):
        table = visitor.get(f"/table.{kind}")
        assert table.content.startswith(begins) and f"legfem-results.{kind}" in table.headers["content-disposition"]
    assert visitor.get("/table.html").status_code == 404


def test_a_port_that_is_taken_is_said_in_a_line(tmp_path, capsys):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = str(taken.getsockname()[1])
        with pytest.raises(SystemExit) as ended:
            app(["--workspace", str(tmp_path / "new"), "--port", port, "--no-browser"])
    assert ended.value.code == 2
    assert capsys.readouterr().err.startswith(f"--port: {port}: another program uses it")
    assert not (tmp_path / "new").exists()


def test_the_server_starts_neither_mpi_nor_a_mesher():
    # What MPI leaves in the environment of its process would be every run's.
    script = (
        "import sys, legfem.app.server as s; "
        "print([m for m in ('mpi4py', 'petsc4py', 'dolfinx', 'gmsh') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
