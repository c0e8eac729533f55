"""A headless Chromium that is driven through its pipe: Python's own library alone."""

from __future__ import annotations

import base64
import fcntl
import json
import os
import subprocess
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from browser import FLAGS

_AXE = """axe.run(document, {resultTypes: ["violations"], iframes: false}).then((found) =>
  found.violations.map((one) => `${one.impact}: ${one.id}: `
    + one.nodes.slice(0, 3).map((node) => node.target.join(" ")).join("; ")))"""
PATIENCE_S = 900.0
"""Until what is waited for is called missing: an event is waited for, however busy the machine is."""
DRAWN = """document.readyState === "complete"
  && new Promise((done) => requestAnimationFrame(() => setTimeout(() => done(true))))"""


class Driven:
    """A browser with a page that is driven; a context manager. It reaches this machine alone."""

    def __init__(self, program: str) -> None:
        self._folder = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        there, ours = os.pipe(), os.pipe()
        # The browser reads from descriptor 3 and writes to 4; these must not be in the way.
        read, write = (fcntl.fcntl(fd, fcntl.F_DUPFD, 10) for fd in (there[0], ours[1]))
        os.close(there[0])
        os.close(ours[1])
        profile = f"--user-data-dir={self._folder.name}"
        command = [program, *FLAGS, "--remote-debugging-pipe", profile, "about:blank"]

        def place() -> None:
            os.dup2(read, 3)
            os.dup2(write, 4)

        self._process = subprocess.Popen(
            command, close_fds=False, preexec_fn=place, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        os.close(read)
        os.close(write)
        self._out, self._in = os.fdopen(there[1], "wb"), os.fdopen(ours[0], "rb")
        self._rest, self._number, self._session = b"", 0, None
        self._sessions: list[str] = []
        self._opened = ""
        self.faults: list[str] = []
        """What went wrong in pages' scripts and requests."""
        self.add_tab()

    def add_tab(self) -> int:
        """Open another page beside those that are there, and drive it; return its number."""
        self._session = None  # of the browser itself
        target = self._call("Target.createTarget", url="about:blank")["targetId"]
        attached = self._call("Target.attachToTarget", targetId=target, flatten=True)
        self._sessions.append(attached["sessionId"])
        self.turn_to(len(self._sessions) - 1)
        for domain in ("Page", "Runtime", "Network", "Log", "DOM"):
            self._call(f"{domain}.enable")
        return len(self._sessions) - 1

    def turn_to(self, tab: int) -> None:
        """Drive the page of a number."""
        self._session = self._sessions[tab]

    def __enter__(self) -> Driven:
        return self

    def __exit__(self, *error: object) -> None:
        self._process.terminate()
        self._process.wait(timeout=20)
        self._folder.cleanup()

    def resize(self, width: int, height: int) -> None:
        self._call(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=width < 600
        )

    def open(self, address: str) -> None:
        self._opened = address
        self._call("Page.navigate", url=address)

    def seconds_to_open(self, address: str) -> float:
        """Open a page; return the seconds until it is drawn whole.

        Where others wait for the processors too, the seconds are those that the browser's processes
        were given: what the wall's clock shows is then the others'.
        """
        crowded = os.getloadavg()[0] > (os.cpu_count() or 1)
        clock = self._processor_seconds if crowded else time.monotonic
        began = clock()
        self.open(address)
        self.until(DRAWN, every=0.02)
        return clock() - began

    def _processor_seconds(self) -> float:
        """Return the processors' time of the browser and of all that it started."""
        stats = {}
        for path in Path("/proc").glob("[0-9]*/stat"):
            try:
                fields = path.read_text().rpartition(")")[2].split()
            except (FileNotFoundError, ProcessLookupError):
                continue  # it has just ended
            stats[int(path.parent.name)] = int(fields[1]), int(fields[11]) + int(fields[12])
        own = {self._process.pid}
        while more := {pid for pid, (parent, _) in stats.items() if parent in own} - own:
            own |= more
        return sum(stats[pid][1] for pid in own if pid in stats) / os.sysconf("SC_CLK_TCK")

    def inaccessible(self, axe: str) -> list[str]:
        """Return what axe-core, whose script is given, finds critical or serious in the page."""
        self.value(f"{axe}; true")
        found = self.value(_AXE)
        assert found is not None, "axe-core didn't come to its end"
        return [one for one in found if one.startswith(("critical", "serious"))]

    def value(self, script: str) -> Any:
        """Return the value of an expression in the page; None while it can't be had."""
        found = self._call(
            "Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True, userGesture=True
        )
        return found.get("result", {}).get("value")

    def until(self, script: str, seconds: float = PATIENCE_S, every: float = 0.2) -> Any:
        """Wait until an expression is true; return it."""
        end = time.monotonic() + seconds
        while True:
            if found := self.value(script):
                return found
            if time.monotonic() > end:
                raise AssertionError(f"not in {seconds:g} s: {script}\n{self.text[-2000:]}")
            time.sleep(every)

    def sees(self, text: str, seconds: float = PATIENCE_S) -> None:
        """Wait until the page shows a text."""
        self.until(f"document.body && document.body.innerText.includes({json.dumps(text)})", seconds)

    @property
    def text(self) -> str:
        return str(self.value("document.body ? document.body.innerText : ''") or "")

    def click(self, text: str, kind: str = "button, a, summary, .q-tab") -> None:
        """Click what is labelled with a text, as soon as it is there."""
        self.until(
            f"(() => {{const one = [...document.querySelectorAll({json.dumps(kind)})].find((e) =>"
            f"e.innerText.trim().toLowerCase() === {json.dumps(text.lower())});"
            "if (!one) return false; one.scrollIntoView(); one.click(); return true;})()"
        )

    def click_at(self, selector: str, across: float, down: float) -> None:
        """Click an element at a share of its width and height."""
        one = f"document.querySelector({json.dumps(selector)})"
        self.until(f"!!{one}")
        self.value(f"{one}.scrollIntoView({{block: 'center'}})")
        x, y, width, height = self.value(
            f"(() => {{const b = {one}.getBoundingClientRect();return [b.x, b.y, b.width, b.height];}})()"
        )
        at = {"x": x + across * width, "y": y + down * height, "button": "left", "clickCount": 1}
        for kind in ("mousePressed", "mouseReleased"):
            self._call("Input.dispatchMouseEvent", type=kind, **at)

    def type(self, label: str, text: str) -> None:
        """Type into the field of a label."""
        self.until(
            "(() => {const one = [...document.querySelectorAll('input, textarea')].find((e) =>"
            f"e.getAttribute('aria-label') === {json.dumps(label)} && e.offsetParent !== null);"
            "if (!one) return false;"
            "one.focus(); one.select(); return true;})()"
        )
        self._call("Input.insertText", text=text)
        time.sleep(0.4)

    def choose(self, label: str, option: str) -> None:
        """Choose an option in the list of a label."""
        self.until(
            "(() => {const one = [...document.querySelectorAll('[role=combobox]')].find((e) =>"
            f"e.getAttribute('aria-label') === {json.dumps(label)} && e.offsetParent !== null);"
            "if (!one) return false;"
            "one.closest('.q-field').querySelector('.q-field__control').click(); return true;})()"
        )
        self.click(option, ".q-menu .q-item")
        self.until("!document.querySelector('.q-menu')")

    def drop(self, files: Sequence[Path], selector: str = "[data-drop]") -> None:
        """Drop files or folders on an element, as a person does from a file manager."""
        self.until(f"!!document.querySelector({json.dumps(selector)})")
        box = self.value(
            f"(() => {{const b = document.querySelector({json.dumps(selector)})"
            ".getBoundingClientRect(); return [b.x + b.width / 2, b.y + 10];})()"
        )
        data = {"items": [], "files": [str(one) for one in files], "dragOperationsMask": 1}
        for kind in ("dragEnter", "dragOver", "drop"):
            self._call("Input.dispatchDragEvent", type=kind, x=box[0], y=box[1], data=data)

    def picture(self, path: Path) -> None:
        """Write a picture of the whole page."""
        size = self._call("Page.getLayoutMetrics")["cssContentSize"]
        clip = {"x": 0, "y": 0, "width": size["width"], "height": min(size["height"], 6000), "scale": 1}
        found = self._call("Page.captureScreenshot", captureBeyondViewport=True, clip=clip)
        path.write_bytes(base64.b64decode(found["data"]))

    def _call(self, method: str, **parameters: Any) -> dict[str, Any]:
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters}
        if self._session is not None:
            message["sessionId"] = self._session
        self._out.write(json.dumps(message).encode() + b"\0")
        self._out.flush()
        while True:
            answer = self._next()
            if answer.get("id") == self._number:
                # A page that is just being left answers with an error: the next look finds it.
                return answer.get("result", {})
            self._note(answer)

    def _next(self) -> dict[str, Any]:
        while b"\0" not in self._rest:
            piece = os.read(self._in.fileno(), 1 << 16)
            assert piece, "the browser has ended"
            self._rest += piece
        first, _, self._rest = self._rest.partition(b"\0")
        return json.loads(first)

    def _note(self, event: dict[str, Any]) -> None:
        told = event.get("params", {})
        if event.get("method") == "Runtime.exceptionThrown":
            self.faults.append(str(told["exceptionDetails"].get("exception", {}).get("description")))
        if event.get("method") == "Runtime.consoleAPICalled" and told["type"] == "error":
            self.faults.append(" ".join(str(one.get("value")) for one in told["args"]))
        if event.get("method") == "Log.entryAdded" and told["entry"]["level"] == "error":
            self.faults.append(f"{told['entry']['text']} {told['entry'].get('url', '')}")
        if event.get("method") == "Network.requestWillBeSent":
            address = told["request"]["url"]
            own = (self._opened, "http://127.0.0.1", "data:", "blob:", "about:")
            if not address.startswith(own):
                self.faults.append(f"asked {address}")
