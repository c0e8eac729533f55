"""A page in headless Chromium without a network: what went wrong, and what its controls do.

Needs Python and a browser only, so that it runs where legfem's environment has no browser:
``python3 tests/browser.py results/identify-3/report.html`` prints what was seen, and fails where
something is wrong with a page. ``tests/making_pages.py`` makes one of every kind.
"""

from __future__ import annotations

import html
import json
import re
import shutil
import subprocess
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path

AXE = "axe.min.js"
NAMES = ("chromium-headless-shell", "chromium", "chromium-browser", "google-chrome", "chrome")
# Root, and who is in a namespace already, can't make Chromium's own sandbox: the pages are ours.
# All but this machine is asked for through a proxy that isn't there: there is no network.
FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-dev-shm-usage",
    "--proxy-server=127.0.0.1:9",
)
_EARLY = """<script>
window.seen = {faults: []};
addEventListener("error", (event) => seen.faults.push(String(event.message)));
addEventListener("unhandledrejection", (event) => seen.faults.push(String(event.reason)));
addEventListener("securitypolicyviolation", (event) => seen.faults.push(event.blockedURI));
console.error = (...words) => seen.faults.push(words.join(" "));
// Virtual time doesn't wait for the compositor's frames: on a busy machine none comes for seconds of it.
window.requestAnimationFrame = (drawn) => setTimeout(() => drawn(performance.now()), 16);
window.cancelAnimationFrame = clearTimeout;
</script>"""
_LATE = """<script>
addEventListener("load", async () => {
  const wait = () => new Promise((done) => setTimeout(done, 400));
  const charts = () => (window.Chart ? Object.values(Chart.instances) : []);
  const visible = (box) => [...box.closest("figure").querySelectorAll(".plot canvas")]
    .map((canvas) => Chart.getChart(canvas).isDatasetVisible(Number(box.dataset.line)));
  const drawn = () => charts().reduce((sum, one) => sum + one.getVisibleDatasetCount(), 0);
  // What is drawn comes in pieces, as frames do: until two looks see as much.
  const pause = async () => {
    let before;
    do {
      before = drawn();
      await wait();
    } while (drawn() !== before);
  };
  await pause();
  seen.ready_ms = performance.now();
  seen.wide = document.documentElement.scrollWidth > document.documentElement.clientWidth;
  seen.requests = performance.getEntriesByType("resource").map((one) => one.name)
    .filter((name) => !name.startsWith("data:") && !name.startsWith("blob:"));
  seen.paths = drawn();
  const box = [...document.querySelectorAll("input[data-plot]")].pop();
  if (box) {
    box.click();
    await pause();
    seen.off = visible(box);
    seen.paths_off = drawn();
    box.click();
    await pause();
    seen.on = visible(box);
    const canvas = box.closest("figure").querySelector(".plot canvas"), chart = Chart.getChart(canvas);
    const {left, top, width, height} = canvas.getBoundingClientRect();
    const at = {clientX: left + 0.6 * width, clientY: top + 0.5 * height, bubbles: true};
    const picture = canvas.toDataURL();
    canvas.dispatchEvent(new MouseEvent("mousemove", at));
    await pause();
    seen.pointed = canvas.toDataURL() !== picture;
    seen.cursor = [...(chart.tooltip.title ?? []), ...(chart.tooltip.body ?? []).flatMap((one) => one.lines)].join(" ");
    const before = chart.scales.x.max - chart.scales.x.min;
    const drag = (kind, across) => canvas.dispatchEvent(new MouseEvent(kind,
      {...at, clientX: left + across * width, view: window, button: 0, buttons: 1}));
    drag("mousedown", 0.4);
    drag("mousemove", 0.5);
    drag("mouseup", 0.6);
    await pause();
    const figure = [...box.closest("figure").querySelectorAll(".plot canvas")]
      .map((one) => Chart.getChart(one).scales.x);
    seen.zoomed = figure.map((x) => (x.max - x.min) / before);
    canvas.dispatchEvent(new MouseEvent("dblclick", at));
    await pause();
    seen.unzoomed = figure.map((x) => (x.max - x.min) / before);
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
    await press(slider.max);
    const colours = [...document.querySelectorAll("[name=press-colour]")], coloured = new Set();
    for (const colour of colours) {
      colour.click();
      await pause();
      coloured.add(look()[2]);
    }
    seen.colours = [coloured.size, colours.length];
  }
  const set = async (id, value) => {
    const input = document.getElementById(id);
    if (input.type === "checkbox" || input.type === "radio") input.checked = value;
    else input.value = value;
    input.dispatchEvent(new Event("input", {bubbles: true}));
    await pause();
  };
  const leg = document.getElementById("turn");
  if (leg) {
    const pictures = [leg.toDataURL()];
    const said = () => document.getElementById("turn-reading").textContent;
    seen.dressed = [said()];
    for (const [id, value] of [["turn-at", 0], ["turn-around", 90], ["turn-tilt", 40]]) {
      await set(id, value);
      pictures.push(leg.toDataURL());
      seen.dressed.push(said());
    }
    await set("turn-at", document.getElementById("turn-at").max);
    for (const name of ["turn-show", "turn-colour"]) {
      [...document.querySelectorAll(`[name=${name}]`)].pop().click();
      await pause();
      pictures.push(leg.toDataURL());
    }
    const {left, top, width, height} = leg.getBoundingClientRect();
    const at = (x) => ({clientX: left + x * width, clientY: top + 0.5 * height, pointerId: 1});
    leg.setPointerCapture = () => {};
    leg.dispatchEvent(new PointerEvent("pointerdown", at(0.3)));
    leg.dispatchEvent(new PointerEvent("pointermove", at(0.5)));
    leg.dispatchEvent(new PointerEvent("pointerup", at(0.5)));
    await pause();
    pictures.push(leg.toDataURL());
    seen.dragged = Number(document.getElementById("turn-around").value) !== 90;
    seen.views = new Set(pictures).size;
  }
  if (document.getElementById("response-metric")) {
    const said = () => document.getElementById("response-reading").textContent;
    const cells = () => document.getElementById("response").toDataURL();
    seen.surface = [said()];
    const before = cells();
    await set(`response-factor-${document.getElementById("response-pick-x").value}`, 1);
    seen.surface.push(said());
    await set("response-metric", 0);
    seen.surface_moved = cells() !== before;
  }
  const sortable = document.querySelector(".sortable");
  if (sortable) {
    const head = [...sortable.querySelectorAll("thead th")].at(-1);
    const last = () => [...sortable.querySelectorAll("tbody tr:not(.filler)")].map((one) => one.lastChild.textContent);
    head.firstElementChild.click();
    const up = last();
    head.firstElementChild.click();
    const down = last();
    seen.sorted = [up, down].map((one) => one[0]);
    const find = sortable.querySelector("input");
    find.value = "no such member";
    find.dispatchEvent(new Event("input", {bubbles: true}));
    seen.left = last().length;
    find.value = "";
    find.dispatchEvent(new Event("input", {bubbles: true}));
    seen.rows = last().length;
    sortable.querySelector(".view").scrollTop = 1e9;
    await pause();
    seen.elements = document.querySelectorAll("*").length;
  }
  for (const name of ["forest", "bundle"]) {
    const box = document.querySelector(`#${name} [data-group]`);
    if (!box) continue;
    const looks = () => document.querySelector(`#${name} canvas`).toDataURL();
    const before = looks();
    box.click();
    seen[name] = looks() !== before;
    box.click();
  }
  if (window.axe) {
    const found = await axe.run(document, {resultTypes: ["violations"]});
    const where = (node) => node.target.join(" ");
    seen.inaccessible = found.violations.map((one) =>
      `${one.impact}: ${one.id}: ${one.nodes.slice(0, 3).map(where).join("; ")}`);
  }
  document.documentElement.dataset.seen = JSON.stringify(seen);
});
</script>"""


def browser() -> str | None:
    """Return the path of a browser, if there is one."""
    return next((path for name in NAMES if (path := shutil.which(name))), None)


def axe() -> str:
    """Return the script of axe-core, which looks for what keeps people from reading a page."""
    package = find_spec("axe_core_python")
    beside = Path(sys.argv[-1]).with_name(AXE)  # as making_pages.py leaves it
    path = beside if package is None else Path(package.origin).with_name(AXE)
    return path.read_text(encoding="utf-8") if path.exists() else ""


def faults(found: dict) -> list[str]:
    """Return what is wrong with a page for whoever reads it."""
    told = [f"error: {fault}" for fault in found["faults"]]
    told += [f"request: {name}" for name in found["requests"]]
    if found["wide"]:
        told.append("the page is wider than the window")
    return told + [one for one in found.get("inaccessible", []) if one.startswith(("critical", "serious"))]


def idle(found: dict) -> list[str]:
    """Return the controls that don't do what they are for."""
    works = {
        "check boxes": "off" not in found or (not any(found["off"]) and all(found["on"])),
        "cursor": "cursor" not in found or (":" in found["cursor"] and found["pointed"]),
        "zoom": "zoomed" not in found
        or (max(found["zoomed"]) < 0.9 and all(abs(one - 1) < 0.01 for one in found["unzoomed"])),
        "press": "pictures" not in found or (found["pictures"] == 3 and found["colours"] == [4, 4]),
        "turn and dress": "views" not in found or (found["views"] >= 7 and found["dragged"]),
        "sort and find": "sorted" not in found
        or (len(set(found["sorted"])) == 2 and found["left"] == 0 < found["rows"]),
        "groups": all(found.get(name, True) for name in ("forest", "bundle")),
        "surface": "surface" not in found or (found["surface_moved"] and len(set(found["surface"])) == 2),
    }
    return [name for name, good in works.items() if not good]


def seen(page: Path, program: str, script: str = "", width: int = 1000) -> dict:
    """Open a copy of a page and use its controls; return what was seen.

    ``script`` is that of axe-core, if the page is to be looked at by it.
    """
    text = page.read_text(encoding="utf-8")
    text = text.replace("<head>", f"<head>{_EARLY}", 1)
    head, _, tail = text.rpartition("</body>")
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "page.html"
        looks = f"<script>{script}</script>{_LATE}" if script else _LATE
        copy.write_text(f"{head}{looks}</body>{tail}", encoding="utf-8")
        done = subprocess.run(
            [
                program,
                *FLAGS,
                f"--window-size={width},1400",
                f"--user-data-dir={folder}/profile",
                "--virtual-time-budget=30000",
                "--dump-dom",
                copy.as_uri(),
            ],
            capture_output=True,
            text=True,
            check=True,
            timeout=300,
        )
    told = re.search(r'<html[^>]* data-seen="([^"]*)"', done.stdout)
    assert told, "the page's scripts did not come to their end"
    return json.loads(html.unescape(told[1]))


if __name__ == "__main__":
    found = browser()
    if found is None:
        sys.exit("no Chromium here")
    wrong = []
    for name in sys.argv[1:]:
        for width in (1000, 500):
            told = seen(Path(name), found, axe(), width)
            print(name, width, json.dumps(told, indent=1))
            every = [*faults(told), *(f"nothing happens: {one}" for one in idle(told))]
            wrong += [f"{name}, {width} pixels wide: {fault}" for fault in every]
    sys.exit("\n".join(wrong) or 0)
