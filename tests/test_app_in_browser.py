"""The app in a browser without a network: from the first click to a verdict, and who is refused."""

import http.client
import http.server
import json
import shutil
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from hashlib import sha256
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

import browser
import pytest
from driving import Driven
from making_specimens import write_bars
from walking import Server, loose_files, walk

from legfem.app.runs import Run, RunState
from legfem.app.workspace import Workspace
from legfem.common.errors import InputError
from legfem.mechanics.materials import ReducedPolynomial
from legfem.specimens.schema import parse_specimen_file
from legfem.subjects.catalogue import RESOURCES
from legfem.subjects.loading import load_subject
from legfem.subjects.sites import subject_entry

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(browser.browser() is None, reason="no Chromium here"),
]
LEG = RESOURCES / "dubuis" / "subjects" / "1"
MINUTES = 60.0


def test_a_folder_is_dropped_previewed_mapped_identified_and_diagnosed(tmp_path):
    server = Server((sys.executable,), tmp_path / "workspace")
    seen = walk(server, browser.browser(), tmp_path)
    assert "neo-hookean, C10 0." in seen["identified"]
    assert seen["diagnosed"].startswith("reduced-polynomial, C10 0.")
    assert "diagnose-example-leg" in seen["compared"]
    assert "no plain name" in seen["led out"]
    with pytest.raises(InputError) as refused:
        load_subject(tmp_path / "workspace" / "inputs" / "bad")
    assert seen["bad"] == str(refused.value)
    assert seen["faults"] == []
    assert seen["inaccessible"] == []


@pytest.fixture(scope="module")
def served(tmp_path_factory):
    """Return the workspace of a server that runs, and its address with the token."""
    workspace = tmp_path_factory.mktemp("served") / "workspace"
    server = Server((sys.executable,), workspace)
    address = server.start()
    with server:
        yield Workspace(workspace), address
    for name in Workspace(workspace).runs:
        Run(workspace / "runs" / name).cancel(at_once=True)


@pytest.fixture
def page(served):
    _, address = served
    with Driven(browser.browser()) as page:
        page.resize(1280, 900)
        page.open(address)
        page.sees("Drop a folder here")
        yield page
        assert page.faults == []


def home(address):
    return address.split("?")[0]


def begun(page, text):
    """Begin with an example; return the name of its input."""
    page.click(text)
    page.until("location.pathname.startsWith('/input/')")
    page.sees("Is this what you measured?", 3 * MINUTES)
    return page.value("decodeURIComponent(location.pathname.split('/')[2])")


def accessible(page):
    return page.inaccessible(browser.axe()) == []


def test_two_tabs_change_one_file_and_nothing_is_lost(served, page):
    workspace, address = served
    name = begun(page, "a pressed leg")
    second = page.add_tab()
    page.open(f"{home(address)}input/{name}")
    for tab, key, value in ((0, "title *", "changed here"), (second, "aim_sd_mm", "1.75")):
        page.turn_to(tab)
        page.click("Assumed")
        page.type(key, value)
    path = workspace.input(name) / "subject.toml"
    for tab, seen in ((0, "changed here"), (second, "aim ± 1.75 mm")):
        page.turn_to(tab)
        page.click("Save")
        page.sees(seen, 3 * MINUTES)
    given = subject_entry(path).given
    assert (given.title, given.accuracy.aim_sd_mm) == ("changed here", 1.75)

    # The text of a file that another tab changed meanwhile isn't written over it.
    for tab in (0, second):
        page.turn_to(tab)
        page.open(f"{home(address)}input/{name}")
        page.click("Assumed")
        page.click("subject.toml as text")
    page.type("text of the file", path.read_text() + "# mine\n")
    page.click("Save the text")
    page.until("!document.body.innerText.includes('Save the text')")
    page.turn_to(0)
    page.type("text of the file", "nothing")
    page.click("Save the text")
    page.sees("the file was changed elsewhere")
    assert path.read_text().endswith("# mine\n")

    # Both begin the same command: these are two runs.
    for tab in (0, second):
        page.turn_to(tab)
        page.open(f"{home(address)}input/{name}")
        page.click("Run")
        page.sees("Find C10 and C20")
    for tab in (0, second):
        page.turn_to(tab)
        page.click("Run identify")
        page.until("location.pathname.startsWith('/run/')")
        page.click("End at once", "button")
        page.sees("goes on from what is finished", MINUTES)
    runs = [run for run in workspace.runs if run.startswith(f"identify-{name}")]
    assert len(runs) == 2
    assert {Run(workspace.run(run)).state for run in runs} == {RunState.LOST}


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
    with (
        http.server.ThreadingHTTPServer(("127.0.0.1", 0), _Elsewhere) as elsewhere,
        Driven(browser.browser()) as page,
    ):
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
    assert told == {
        "read": "not read", "blind": "opaque", "put": "not sent", "socket": "refused",
    }  # fmt: skip
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


OUT = ["../token", "../../token", "%2e%2e/token", "%2e%2e%2ftoken", "..%5ctoken", "/etc/passwd",
       "....//token", "%00", "x" * 5000, "a/%2e%2e/%2e%2e/%2e%2e/token"]  # fmt: skip


@pytest.mark.parametrize("path", OUT)
def test_paths_that_lead_out_of_the_workspace_are_refused_as_they_are_sent(served, path):
    workspace, address = served
    token = workspace.token()
    name = workspace.new_input("leg")
    for method, at in (("GET", f"/files/runs/{path}"), ("GET", f"/files/previews/{path}"),
                       ("GET", f"/files/{path}"), ("GET", f"/assets/app/{path}"),
                       ("PUT", f"/inputs/{name}/{path}"), ("PUT", f"/inputs/{path}")):  # fmt: skip
        status, told = asked(address, method, at, b"evil" if method == "PUT" else None)
        assert status in (400, 404, 405), at
        assert token.encode() not in told and b"root:" not in told
    assert workspace.token() == token
    assert list(workspace.input(name).iterdir()) == []


def test_nobody_is_answered_without_the_token_nor_from_another_machine(served):
    _, address = served
    for method, path in (("GET", "/"), ("GET", "/compare"), ("POST", "/inputs"),
                         ("PUT", "/inputs/leg/x"), ("GET", "/_nicegui/x"),
                         ("GET", "/files/runs/x/results/report.html")):  # fmt: skip
        status, told = asked(address, method, path, b"{}", cookie=False)
        assert (status, told.split(b":")[0]) == (403, b"refused"), path
    assert asked(address, "GET", "/", Host="legfem.example")[0] == 403
    assert asked(address, "GET", "/")[0] == 200
    port, listening = f"{urlsplit(address).port:04X}", "0A"
    rows = [
        line.split()
        for name in ("tcp", "tcp6")
        for line in Path(f"/proc/net/{name}").read_text().splitlines()[1:]
    ]
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
        sent = several.map(
            lambda k: asked(address, "PUT", f"/inputs/{name}/{k}.csv", piece)[0], range(8)
        )
        assert set(sent) == {204}
    there = {path.name for path in workspace.input(name).iterdir() if path.name[0] != "."}
    assert there == {"big.nii", *(f"{k}.csv" for k in range(8))}


def test_wrong_input_is_a_line_each_and_nothing_is_taken_for_a_leg(served, page, tmp_path):
    workspace, address = served
    before = set(workspace.inputs)
    empty, other, foreign = (tmp_path / name for name in ("empty", "other", "foreign"))
    for folder in (empty, other, foreign):
        folder.mkdir()
    page.drop([empty])
    page.sees("the folder is empty")
    assert set(workspace.inputs) == before
    (other / "photo.jpg").write_bytes(b"\xff\xd8\xff")
    page.drop([other])
    page.until("location.pathname === '/input/other'")
    page.sees("nor a recording that can be read", 3 * MINUTES)
    # Headers that no program could guess are chosen by hand.
    rows = "".join(f"{0.1 * k:.1f};{0.04 * k:.3f};{0.002 * k * k:.4f}\n" for k in range(200))
    (foreign / "essai.csv").write_text(f"foo;bar;baz\n{rows}")
    page.open(home(address))
    page.sees("Drop a folder here")
    page.drop([foreign])
    page.until("location.pathname === '/input/foreign'")
    page.sees("no column is named", 3 * MINUTES)
    page.click("Columns", ".q-tab")
    page.sees("essai.csv")
    for quantity, column, unit in (("time", "foo", "s"), ("displacement", "bar", "mm"),
                                   ("force", "baz", "N")):  # fmt: skip
        page.choose(f"{quantity}: column", column)
        page.type(f"{quantity}: unit", unit)
    assert accessible(page)


def test_a_run_that_is_refused_says_the_commands_line_and_leaves_its_input(served, page):
    workspace, _ = served
    name = begun(page, "a pressed leg")
    page.click("Run")
    page.type("more options", "--law nonsense")
    page.sees("--law nonsense")
    page.click("Run identify")
    page.sees("'nonsense' is not one of", MINUTES)
    page.sees("once what is said below is mended")
    run = workspace.runs[0]
    assert run.startswith(f"identify-{name}")
    assert Run(workspace.run(run)).state is RunState.REFUSED
    assert (workspace.input(name) / "subject.toml").is_file()


def ran(page, kind, options, minutes, **fields):
    """Run a command from the page of an input; return its sentence, its report's page seen."""
    page.click("Run")
    page.sees(f"Run {kind}")
    for label, number in fields.items():
        page.type(label, number)
    if options:
        page.type("more options", options)
        page.sees(options)
    assert accessible(page)
    page.click(f"Run {kind}")
    page.until("location.pathname.startsWith('/run/')")
    page.until("!!document.querySelector('iframe.report, .line.refused')", minutes * MINUTES)
    assert accessible(page)
    assert not page.value("document.querySelector('.line.refused')?.innerText")
    return page.value("document.querySelector('.sentence').innerText")


KNOWN = """
[tissues.deep]
C10_kPa = 3.0
[tissues.superficial]
C10_kPa = 4.0
[segment]
from_mm = 40.0
to_mm = 100.0
"""


def test_a_leg_is_dropped_and_its_stocking_run_from_the_app(served, page, tmp_path):
    workspace, _ = served
    leg = tmp_path / "known leg"
    leg.mkdir()
    for name in ("bare.nii.gz", "stocking.csv"):
        shutil.copy(LEG / name, leg)
    scanned = '[compressed]\nscan = "compressed.nii.gz"\n'
    (leg / "leg.toml").write_text((LEG / "leg.toml").read_text().replace(scanned, "") + KNOWN)
    page.drop([leg])
    page.until("location.pathname === '/input/known%20leg'")
    page.sees("Outlines of skin and muscle", 5 * MINUTES)
    page.click("Assumed")
    page.sees("Part that is modelled")
    assert accessible(page)
    told = ran(page, "stocking", "", 20, **{"about how many tetrahedra": "8000"})
    found = json.loads(
        (workspace.run("stocking-known leg") / "results" / "result.json").read_text()
    )
    mean = 7.50062 * found["pressures"]["mean_interface_kPa"]
    assert told == f"pressure on the skin {mean:.0f} mmHg on average"
    assert 10 < mean < 40


def test_a_plan_is_run_from_the_app(served, page):
    workspace, _ = served
    name = begun(page, "a pressed leg")
    fields = {"expected C10 (kPa)": "0.7", "to press to (mm)": "5"}
    told = ran(page, "plan", "--jobs 1", 40, **fields)
    assert told.startswith("most telling: ")
    assert (workspace.run(f"plan-{name}") / "results" / "report.html").is_file()


def test_a_leg_that_a_ball_pressed_is_dropped_and_described(served, page, tmp_path):
    workspace, _ = served
    page.drop([loose_files(tmp_path)])
    page.until("location.pathname === '/input/my%20leg'")
    page.click("Describe")
    page.sees("0 along the leg, 90 across")
    page.choose("what pressed it", "a ball")
    hidden = "document.querySelector('[aria-label=\"cylinder\\'s length (mm)\"]').offsetParent"
    page.until(f"{hidden} === null")
    assert accessible(page)
    for label, number in (("diameter (mm)", "30"), ("aim x (mm): a point on its way", "0"),
                          ("aim y (mm)", "0"),
                          ("direction of travel (degrees from +x)", "90")):  # fmt: skip
        page.type(label, number)
    page.click("It is a pressed leg")
    page.sees("columns are separated by ;", 3 * MINUTES)
    given = subject_entry(workspace.input("my leg") / "subject.toml").given
    assert (given.indenter.shape, given.indenter.length_mm) == ("ball", None)


def test_recordings_of_specimens_are_dropped_described_and_identified(served, page, tmp_path):
    workspace, _ = served
    bars = write_bars(tmp_path / "bars", ReducedPolynomial(5e-3, 1.0, 3e-3, float("inf")))
    (bars / "specimen.toml").unlink()
    page.drop([bars])
    page.until("location.pathname === '/input/bars'")
    page.sees("holds no subject.toml", 3 * MINUTES)
    page.click("Describe")
    page.sees("Specimens of one tissue")
    assert accessible(page)
    page.choose("what was done", "a bar pulled or pressed along its length")
    page.choose("direction *", "compression")
    page.type("length_mm *", "10")
    page.click("They are specimens")
    page.sees("area_mm2: is missing")
    page.type("area_mm2 *", "100")
    page.click("They are specimens")
    page.sees("measured data", 3 * MINUTES)
    given = parse_specimen_file(workspace.input("bars") / "specimen.toml")
    assert (given.uniaxial.length_mm, given.uniaxial.area_mm2) == (10.0, 100.0)
    page.click("Assumed")
    page.sees("Test: a bar")
    assert accessible(page)
    told = ran(page, "identify", "--law reduced-polynomial --jobs 1", 10)
    assert told.startswith("reduced-polynomial, C10 ")
    assert Path(workspace.run("identify-bars") / "results" / "report.html").is_file()
