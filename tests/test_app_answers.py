"""What the app's server answers, to whom, and what it takes."""

from __future__ import annotations

import http.client
import http.server
import threading
from concurrent.futures import ThreadPoolExecutor
from hashlib import sha256
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

import browser
import pytest
from driving import Driven
from making_app import home

pytestmark = [pytest.mark.slow, pytest.mark.skipif(browser.browser() is None, reason="no Chromium here")]


class _Elsewhere(http.server.BaseHTTPRequestHandler):
    """A page of another origin on this machine, to which the browser sends the app's cookie."""

    def do_GET(self):
        self.send_response(200)
        self.send_header("Content-Type", "text/html")
        self.end_headers()
        self.wfile.write(b"<!DOCTYPE html><title>elsewhere</title><p>elsewhere</p>")

    def log_message(self, *args):
        pass


def test_a_page_of_another_origin_reads_nothing_and_changes_nothing(served):
    workspace, address = served
    before = set(workspace.inputs), set(workspace.runs)
    app = home(address).rstrip("/")
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), _Elsewhere) as elsewhere, Driven(browser.browser()) as page:
        threading.Thread(target=elsewhere.serve_forever, daemon=True).start()
        page.open(address)
        page.sees("Drop a folder here")
        page.open(f"http://127.0.0.1:{elsewhere.server_port}/")
        page.sees("elsewhere")
        told = page.value(f"""(async () => {{
            const app = {app!r}, tried = {{}};
            const read = (options) => fetch(app + '/', {{credentials: 'include', ...options}})
              .then((answer) => answer.text()).catch(() => 'not read');
            tried.read = await read({{}});
            tried.blind = await fetch(app + '/inputs', {{method: 'POST', mode: 'no-cors',
              credentials: 'include', headers: {{'Content-Type': 'text/plain'}},
              body: '{{"name": "evil"}}'}}).then((answer) => answer.type).catch(() => 'failed');
            tried.put = await fetch(app + '/inputs/evil/x', {{method: 'PUT', body: 'x',
              credentials: 'include'}}).then(() => 'sent').catch(() => 'not sent');
            tried.socket = await new Promise((done) => {{
              const socket = new WebSocket(app.replace('http', 'ws')
                + '/_nicegui_ws/socket.io/?EIO=4&transport=websocket');
              socket.onopen = () => done('opened');
              socket.onerror = () => done('refused');
            }});
            const form = Object.assign(document.createElement('form'),
              {{method: 'post', action: app + '/inputs', target: 'there'}});
            const frame = Object.assign(document.createElement('iframe'), {{name: 'there'}});
            document.body.append(frame, form);
            const loaded = new Promise((done) => {{ frame.onload = () => done(true); }});
            form.submit();
            await loaded;
            return tried;
        }})()""")
        elsewhere.shutdown()
    assert told == {"read": "not read", "blind": "opaque", "put": "not sent", "socket": "refused"}
    assert (set(workspace.inputs), set(workspace.runs)) == before


def asked(address, method, path, body=None, cookie=True, **headers):
    """Send a request as it stands: clients take the dots out of paths. Return status and body."""
    parts = urlsplit(address)
    if cookie:
        token = parse_qs(parts.query)["token"][0]
        headers["Cookie"] = f"legfem-{parts.port}={token}"
    connection = http.client.HTTPConnection("127.0.0.1", parts.port, timeout=60)
    connection.request(method, path, body, headers)
    answer = connection.getresponse()
    return answer.status, answer.read()


OUT = [
    "../token",
    "../../token",
    "%2e%2e/token",
    "%2e%2e%2ftoken",
    "..%5ctoken",
    "/etc/passwd",
    "....//token",
    "%00",
    "x" * 5000,
    "a/%2e%2e/%2e%2e/%2e%2e/token",
]


@pytest.mark.parametrize("path", OUT)
def test_paths_that_lead_out_of_the_workspace_are_refused_as_they_are_sent(served, path):
    workspace, address = served
    token = "what is here is for the user alone"
    (workspace.folder / "token").write_text(token)
    name = workspace.new_input("leg")
    for method, at in (
        ("GET", f"/files/runs/{path}"),
        ("GET", f"/files/previews/{path}"),
        ("GET", f"/files/{path}"),
        ("GET", f"/assets/app/{path}"),
        ("PUT", f"/inputs/{name}/{path}"),
        ("PUT", f"/inputs/{path}"),
    ):
        status, told = asked(address, method, at, b"evil" if method == "PUT" else None)
        assert status in (400, 404, 405), at
        assert token.encode() not in told and b"root:" not in told
    assert (workspace.folder / "token").read_text() == token
    assert list(workspace.input(name).iterdir()) == []


def test_nobody_is_answered_without_the_token_nor_from_another_machine(served):
    _, address = served
    for method, path in (
        ("GET", "/"),
        ("GET", "/compare"),
        ("POST", "/inputs"),
        ("PUT", "/inputs/leg/x"),
        ("GET", "/_nicegui/x"),
        ("GET", "/files/runs/x/results/report.html"),
    ):
        status, told = asked(address, method, path, b"{}", cookie=False)
        assert (status, told.split(b":")[0]) == (403, b"refused"), path
    assert asked(address, "GET", "/", Host="legfem.example")[0] == 403
    assert asked(address, "GET", "/")[0] == 200
    port, listening = f"{urlsplit(address).port:04X}", "0A"
    rows = [line.split() for name in ("tcp", "tcp6") for line in Path(f"/proc/net/{name}").read_text().splitlines()[1:]]
    bound = {row[1] for row in rows if row[3] == listening and row[1].endswith(f":{port}")}
    assert bound == {f"0100007F:{port}"}, "127.0.0.1 alone"


def test_a_large_file_arrives_whole_and_one_that_breaks_off_not_at_all(served):
    workspace, address = served
    name, piece, count = workspace.new_input("scans"), b"0123456789abcdef" * 65536, 256
    status, _ = asked(address, "PUT", f"/inputs/{name}/big.nii", (piece for _ in range(count)))
    assert status == 204
    with (workspace.input(name) / "big.nii").open("rb") as file:
        found = sha256()
        while some := file.read(1 << 24):
            found.update(some)
    assert found.digest() == sha256(piece * count).digest()

    def broken():
        yield piece
        raise ConnectionAbortedError

    with pytest.raises(ConnectionAbortedError):
        asked(address, "PUT", f"/inputs/{name}/half.nii", broken())
    with ThreadPoolExecutor(4) as several:
        sent = several.map(lambda k: asked(address, "PUT", f"/inputs/{name}/{k}.csv", piece)[0], range(8))
        assert set(sent) == {204}
    there = {path.name for path in workspace.input(name).iterdir() if path.name[0] != "."}
    assert there == {"big.nii", *(f"{k}.csv" for k in range(8))}
