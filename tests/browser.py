"""A page in headless Chromium without a network: what went wrong, and what its controls do.

Needs Python and a browser only, so that it runs where legfem's environment has no browser:
``python3 tests/browser.py results/identify-3/report.html`` prints what was seen.
"""

from __future__ import annotations

import html
import json
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--host-resolver-rules=MAP * ~NOTFOUND", "--window-size=1000,1400",
)  # fmt: skip
_EARLY = """<script>
window.seen = {faults: []};
addEventListener("error", (event) => seen.faults.push(String(event.message)));
addEventListener("unhandledrejection", (event) => seen.faults.push(String(event.reason)));
addEventListener("securitypolicyviolation", (event) => seen.faults.push(event.blockedURI));
console.error = (...words) => seen.faults.push(words.join(" "));
</script>"""
_LATE = """<script>
addEventListener("load", async () => {
  const pause = () => new Promise((done) => setTimeout(done, 400));
  const inside = (root, found = []) => {
    for (const one of root.querySelectorAll("*")) {
      found.push(one);
      if (one.shadowRoot) inside(one.shadowRoot, found);
    }
    return found;
  };
  const plots = () => inside(document.querySelector("main"));
  const visible = (box, place) => Bokeh.documents.map((known) =>
    known.get_model_by_name(`${box.dataset.plot}-${place}-${box.dataset.line}`))
    .filter(Boolean).map((line) => line.visible);
  await pause();
  seen.ready_ms = performance.now();
  seen.requests = performance.getEntriesByType("resource").map((one) => one.name)
    .filter((name) => !name.startsWith("data:") && !name.startsWith("blob:"));
  const drawn = () => plots().filter((one) => one.tagName === "path").length;
  seen.paths = drawn();
  const box = [...document.querySelectorAll("input[data-plot]")].pop();
  if (box) {
    box.click();
    await pause();
    seen.off = [...visible(box, "above"), ...visible(box, "below")];
    seen.paths_off = drawn();
    box.click();
    await pause();
    seen.on = [...visible(box, "above"), ...visible(box, "below")];
    const surface = plots().find((one) => one.classList.contains("bk-events"));
    const {left, top, width, height} = surface.getBoundingClientRect();
    const at = {clientX: left + 0.6 * width, clientY: top + 0.5 * height, bubbles: true,
      composed: true, pointerType: "mouse", isPrimary: true};
    for (const kind of ["pointerenter", "pointerover", "pointermove", "mousemove"])
      surface.dispatchEvent(new PointerEvent(kind, at));
    await pause();
    seen.cursor = inside(document).filter((one) => one.classList.contains("bk-Tooltip"))
      .map((one) => inside(one.shadowRoot).filter((part) => part.tagName !== "STYLE")
        .map((part) => part.textContent).join(" "))
      .join(" ").slice(0, 300);
  }
  const slider = document.getElementById("press-at"), canvas = document.getElementById("press");
  if (slider) {
    const look = () => [document.getElementById("press-reading").textContent,
      slider.getAttribute("aria-valuetext"), canvas.toDataURL()];
    const press = async (value) => {
      slider.value = value;
      slider.dispatchEvent(new Event("input", {bubbles: true}));
      await pause();
      return look();
    };
    const [deep, half, none] = [look(), await press(slider.max / 2), await press(0)];
    seen.readings = [deep[0], half[0], none[0]];
    seen.spoken = half[1];
    seen.pictures = new Set([deep[2], half[2], none[2]]).size;
    document.querySelector("[name=press-colour][value=tissue]").click();
    await pause();
    seen.pictures += look()[2] !== none[2];
  }
  document.documentElement.dataset.seen = JSON.stringify(seen);
});
</script>"""


def browser() -> str | None:
    """Return the path of a browser, if there is one."""
    return next((path for name in NAMES if (path := shutil.which(name))), None)


def seen(page: Path, program: str) -> dict:
    """Open a copy of a page and use its controls; return what was seen."""
    text = page.read_text(encoding="utf-8")
    text = text.replace("<head>", f"<head>{_EARLY}", 1)
    head, _, tail = text.rpartition("</body>")
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "page.html"
        copy.write_text(f"{head}{_LATE}</body>{tail}", encoding="utf-8")
        done = subprocess.run(
            [program, *FLAGS, f"--user-data-dir={folder}/profile", "--virtual-time-budget=20000",
             "--dump-dom", copy.as_uri()],
            capture_output=True, text=True, check=True, timeout=300,
        )  # fmt: skip
    told = re.search(r'<html[^>]* data-seen="([^"]*)"', done.stdout)
    assert told, "the page's scripts did not come to their end"
    return json.loads(html.unescape(told[1]))


if __name__ == "__main__":
    found = browser()
    if found is None:
        sys.exit("no Chromium here")
    for name in sys.argv[1:]:
        print(json.dumps(seen(Path(name), found), indent=1))
