"""A walk through the app in a browser, from the first click to a verdict.

Needs Python and a browser only, so that it runs where legfem's environment has no browser:
``python3 tests/walking.py [--quick] [FOLDER FOR PICTURES]`` starts the server with
``scripts/in-env``; the quick walk leaves the diagnosis out. Where there is axe-core, it looks at
every page.
"""

from __future__ import annotations

import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from browser import axe, browser
from driving import Driven

ROOT = Path(__file__).resolve().parents[1]
SUBJECT = ROOT / "legfem" / "resources" / "frauziols" / "subjects" / "3"
_MINUTES = 60.0


@dataclass
class Server:
    """The app's server on a port of its own."""

    python: Sequence[str]
    workspace: Path
    port: int = 0
    process: subprocess.Popen[str] | None = field(default=None, init=False)

    def start(self) -> str:
        """Start it; return the address with its token."""
        if not self.port:
            with socket.socket() as free:
                free.bind(("127.0.0.1", 0))
                self.port = free.getsockname()[1]
        self.process = subprocess.Popen(
            [
                *self.python,
                "-m",
                "legfem.app",
                "--workspace",
                str(self.workspace),
                "--port",
                str(self.port),
                "--no-browser",
            ],
            stdout=subprocess.PIPE,
            text=True,
            cwd=ROOT,
            start_new_session=True,
        )
        assert self.process.stdout is not None
        address = ""
        for line in self.process.stdout:
            if found := re.match(r"open: +(\S+)", line):
                address = found[1]
                break
        end = time.monotonic() + 2 * _MINUTES
        while time.monotonic() < end:
            with socket.socket() as tried:
                if tried.connect_ex(("127.0.0.1", self.port)) == 0:
                    return address
            time.sleep(0.2)
        raise AssertionError("the server didn't start")

    def __enter__(self) -> Server:
        return self

    def __exit__(self, *error: object) -> None:
        self.kill()

    def kill(self) -> None:
        """Kill it with all that it runs in, as a crash would; runs are in sessions of their own."""
        assert self.process is not None
        os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()


def loose_files(folder: Path) -> Path:
    """Make a folder as labs have it: contours, and trials as an instrument of theirs wrote them."""
    loose = folder / "my leg"
    loose.mkdir()
    shutil.copy(SUBJECT / "contours.csv", loose / "outline.csv")
    for trial in sorted((SUBJECT / "recordings").iterdir()):
        rows = [line.split(",") for line in trial.read_text().splitlines()[1:]]
        # The drive counts upwards and compression is negative; commas in decimals.
        text = [";".join((t, f"{200 - float(d):.4f}", f"{-float(f):.4f}")) for t, d, f in rows]
        lines = ["Zeit [s];Traverse [mm];Kraft [N]", *text]
        (loose / trial.name).write_text("\n".join(lines).replace(".", ",") + "\n")
    return loose


@dataclass
class Walk:
    """One who goes through the app."""

    server: Server
    page: Driven
    folder: Path
    pictures: Path | None
    address: str = ""
    seen: dict[str, Any] = field(default_factory=dict)

    @property
    def home(self) -> str:
        return self.address.split("?")[0]

    def look(self, name: str) -> None:
        """Look for what keeps people from reading the page; take a picture, where one is wanted."""
        script = axe()
        if script:
            found = [f"{name}: {fault}" for fault in self.page.inaccessible(script)]
            self.seen.setdefault("inaccessible", []).extend(found)
        if self.pictures is not None:
            time.sleep(2.0)
            self.page.picture(self.pictures / f"{name}.png")

    def enter(self) -> None:
        """Without the token, then with it."""
        self.page.open(self.home)
        self.page.sees("refused: no token")
        self.page.faults.clear()  # the 403 that was just asked for
        self.page.open(self.address)
        self.page.sees("Drop a folder here")
        self.look("home")

    def drop(self) -> None:
        """Loose files are dropped, described and mapped, and their instrument is stated."""
        page = self.page
        page.drop([loose_files(self.folder)])
        page.until("location.pathname === '/input/my%20leg'")
        page.sees("grade B", 3 * _MINUTES)
        self.look("loose")
        page.click_at(".aim", 0.5, 0.95)
        page.until("document.querySelector('[aria-label=\"direction of travel (degrees)\"]').value !== ''")
        for label, number in (
            ("diameter (mm)", "30"),
            ("cylinder's length (mm)", "50"),
            ("error of force (N)", "0.14"),
            ("error of displacement (mm)", "0.14"),
        ):
            page.type(label, number)
        page.click("choose columns, units and directions", ".q-checkbox")
        page.sees("reversed (-1)")
        self.look("describe")
        page.click("Only save this")
        page.sees("Is this what you measured?", 3 * _MINUTES)
        page.click("Assumed")
        page.type("aim_sd_mm", "1.5")
        self.look("assumed")
        page.click("Save")
        page.sees("girth", 3 * _MINUTES)
        page.sees("aim ± 1.5 mm", 3 * _MINUTES)
        self.look("preview")

    def identify(self) -> None:
        """A run is stopped and goes on; the server is killed meanwhile, and another finds it."""
        page = self.page
        page.click("Run")
        page.type("use recordings down to (mm)", "8")
        page.type("more options", "--law neo-hookean --jobs 1")
        page.sees("--depth 8 --law neo-hookean --jobs 1")
        self.look("actions")
        page.click("Run identify")
        page.until("location.pathname === '/run/identify-my%20leg'")
        page.sees("identifying the", 3 * _MINUTES)
        self.look("running")
        page.click("Stop")
        page.sees("goes on from the finished part", 3 * _MINUTES)
        page.click("Go on")
        page.sees("running")
        self.server.kill()
        self.address = self.server.start()  # with another token
        page.faults.clear()  # of the socket that was cut
        page.open(self.address)
        page.sees("Drop a folder here")
        page.open(f"{self.home}run/identify-my%20leg")
        page.until("!!document.querySelector('iframe.report')", 8 * _MINUTES)
        self.look("report")
        self.seen["identified"] = page.value("document.querySelector('.sentence').innerText")

    def be_refused(self) -> None:
        """A bad folder gives the command's own line; names that lead out are refused."""
        bad, page = self.folder / "bad", self.page
        shutil.copytree(SUBJECT, bad)
        toml = bad / "subject.toml"
        toml.write_text(toml.read_text().replace("diameter_mm = 30.0", "diameter_mm = -1.0"))
        page.open(self.home)
        page.drop([bad])
        page.sees("diameter_mm", 3 * _MINUTES)
        self.seen["bad"] = page.value("document.querySelector('.line.refused').innerText")
        self.look("bad")
        self.seen["led out"] = page.value(
            "fetch('/inputs/bad/..%2f..%2fevil', {method: 'PUT', body: 'x'}).then((a) => a.text())"
        )
        page.faults.clear()  # the 400 that was just asked for

    def diagnose(self) -> None:
        """The example is diagnosed to its verdict, and compared with what was identified."""
        page = self.page
        page.open(self.home)
        page.click("a pressed leg")
        page.until("location.pathname === '/input/example-leg'")
        page.sees("girth", 3 * _MINUTES)
        page.click("Run")
        page.click("Run diagnose")
        page.until("location.pathname === '/run/diagnose-example-leg'")
        page.until("!!document.querySelector('iframe.report')", 40 * _MINUTES)
        self.look("diagnosed")
        self.seen["diagnosed"] = page.value("document.querySelector('.sentence').innerText")
        page.open(f"{self.home}compare")
        page.sees("diagnose-example-leg")
        page.sees("Two reports")
        self.look("compare")
        self.seen["compared"] = page.text

    def see_on_a_phone(self) -> None:
        """At a phone's width."""
        self.page.resize(390, 844)
        for at in ("", "input/my%20leg", "run/identify-my%20leg", "compare"):
            self.page.open(f"{self.home}{at}")
            self.page.sees("on this machine only")
            self.look(f"{at.partition('/')[0] or 'home'}-phone")


def walk(
    server: Server, program: str, folder: Path, pictures: Path | None = None, whole: bool = True
) -> dict[str, Any]:
    """Go through the app, without the diagnosis if it isn't to be whole; return what was seen."""
    address = server.start()
    with server, Driven(program) as page:
        page.resize(1280, 900)
        here = Walk(server, page, folder, pictures, address)
        here.enter()
        here.drop()
        here.identify()
        here.be_refused()
        if whole:
            here.diagnose()
        here.see_on_a_phone()
        return {**here.seen, "faults": page.faults}


if __name__ == "__main__":
    found = browser()
    if found is None:
        sys.exit("no Chromium here")
    arguments = [one for one in sys.argv[1:] if one != "--quick"]
    shots = Path(arguments[0]) if arguments else None
    with tempfile.TemporaryDirectory() as here:
        inside = (str(ROOT / "scripts" / "in-env"), "python")
        server = Server(inside, Path(here) / "workspace")
        told = walk(server, found, Path(here), shots, "--quick" not in sys.argv)
        for what, text in told.items():
            print(f"{what}: {text}\n")
