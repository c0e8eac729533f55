// Thousands of rows, intervals and curves: tables that draw what is in view, and canvases.
"use strict";
(() => {
  const dataOf = (place) => JSON.parse(place.querySelector("script[type='application/json']").textContent);
  const text = (cell) => cell === null ? "–" : Array.isArray(cell) ? cell[1]
    : typeof cell === "number" ? String(Number(cell.toPrecision(3))) : cell;
  const key = (cell) => Array.isArray(cell) ? cell[0] : cell;

  const HEIGHT = 28, AROUND = 20;
  for (const place of document.querySelectorAll(".sortable")) {
    const {rows, links} = dataOf(place);
    const view = place.querySelector(".view"), body = place.querySelector("tbody");
    const find = place.querySelector("input"), count = place.querySelector("output");
    const heads = [...place.querySelectorAll("thead th")];
    let order = rows.map((_, k) => k), texts = null, first = -1;
    const filler = (pixels) => {
      const row = document.createElement("tr"), cell = document.createElement("td");
      row.className = "filler";
      row.setAttribute("aria-hidden", "true");
      cell.colSpan = heads.length;
      cell.style.height = `${pixels}px`;
      row.append(cell);
      return row;
    };
    const drawn = (k) => {
      const row = document.createElement("tr");
      rows[k].forEach((cell, column) => {
        const box = document.createElement(column ? "td" : "th");
        if (!column) box.scope = "row";
        if (!column && links[k]) {
          const link = document.createElement("a");
          link.href = links[k];
          link.textContent = text(cell);
          box.append(link);
        } else box.textContent = text(cell);
        box.title = box.textContent;
        row.append(box);
      });
      return row;
    };
    const draw = (again) => {
      const begin = Math.max(0, Math.floor(view.scrollTop / HEIGHT) - AROUND);
      if (begin === first && !again) return;
      first = begin;
      const end = Math.min(order.length, begin + 2 * AROUND + Math.ceil(460 / HEIGHT));
      const parts = order.slice(begin, end).map(drawn);
      if (begin) parts.unshift(filler(begin * HEIGHT));
      if (end < order.length) parts.push(filler((order.length - end) * HEIGHT));
      body.replaceChildren(...parts);
      count.textContent = order.length === rows.length ? `${rows.length} rows` : `${order.length} of ${rows.length} rows`;
    };
    view.addEventListener("scroll", () => draw(false));
    const sorted = {column: -1, way: 1};
    const arrange = () => {
      const wanted = find.value.trim().toLowerCase();
      if (wanted) texts ??= rows.map((row) => row.map(text).join("\u0001").toLowerCase());
      order = rows.map((_, k) => k).filter((k) => !wanted || texts[k].includes(wanted));
      if (sorted.column >= 0) {
        const keys = rows.map((row) => key(row[sorted.column]));
        const empty = (value) => value === null || value === "";
        order.sort((a, b) => {
          const x = keys[a], y = keys[b];
          if (empty(x) || empty(y)) return empty(x) - empty(y); // last, either way
          const before = typeof x === "number" && typeof y === "number" ? x - y
            : String(x) < String(y) ? -1 : String(x) > String(y) ? 1 : 0;
          return sorted.way * before;
        });
      }
      view.scrollTop = 0;
      draw(true);
    };
    heads.forEach((head, column) => head.firstElementChild.addEventListener("click", () => {
      sorted.way = sorted.column === column ? -sorted.way : 1;
      sorted.column = column;
      for (const one of heads) one.removeAttribute("aria-sort");
      head.setAttribute("aria-sort", sorted.way > 0 ? "ascending" : "descending");
      arrange();
    }));
    find.addEventListener("input", arrange);
    addEventListener("beforeprint", () => {
      body.replaceChildren(...order.slice(0, 300).map(drawn));
      first = -1;
    });
    draw(true);
  }

  const INK = "#1a1a1a", LINE = "#c8c8c8", FONT = "12px system-ui, 'DejaVu Sans', sans-serif";
  const ticks = (low, high, most) => {
    const rough = (high - low) / most, power = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 5, 10].map((k) => k * power).find((one) => one >= rough);
    const found = [];
    for (let at = Math.ceil(low / step) * step; at <= high + 1e-9 * step; at += step) found.push(at);
    return found.map((at) => Number(at.toPrecision(10)));
  };
  const canvasOf = (figure, height) => {
    const canvas = figure.querySelector("canvas"), width = figure.clientWidth, scale = devicePixelRatio || 1;
    canvas.style.height = `${height}px`;
    canvas.width = width * scale;
    canvas.height = height * scale;
    const brush = canvas.getContext("2d");
    brush.scale(scale, scale);
    brush.font = FONT;
    brush.textBaseline = "middle";
    return {brush, width, canvas};
  };
  const visible = (figure) => new Set([...figure.querySelectorAll("[data-group]")].filter((box) => box.checked)
    .map((box) => Number(box.dataset.group)));
  const redraw = (figure, draw) => {
    for (const input of figure.querySelectorAll("input, select")) input.addEventListener("input", draw);
    addEventListener("resize", draw);
    draw();
  };
  const across = (brush, low, high, place, left, right, top, bottom, label) => {
    brush.textAlign = "center";
    for (const at of ticks(low, high, 6)) {
      brush.strokeStyle = LINE;
      brush.beginPath();
      brush.moveTo(place(at), top);
      brush.lineTo(place(at), bottom);
      brush.stroke();
      brush.fillStyle = INK;
      brush.fillText(String(at), place(at), bottom + 10);
    }
    brush.fillText(label, (left + right) / 2, bottom + 27);
  };

  const forest = document.getElementById("forest");
  if (forest) {
    const {names, colours, group, metrics} = dataOf(forest), said = forest.querySelector("output");
    const pick = document.getElementById("forest-metric"), byGroup = document.getElementById("forest-by-group");
    let hit = () => -1;
    redraw(forest, () => {
      const {label, unit, values, low, high} = metrics[pick.value], seen = visible(forest);
      const order = names.map((_, k) => k).filter((k) => values[k] !== null && seen.has(group[k]));
      order.sort((a, b) => (byGroup.checked ? group[a] - group[b] : 0) || values[a] - values[b]);
      const named = order.length <= 150, tall = named ? 16 : Math.max(600 / order.length, 0.05);
      const top = 8, bottom = top + Math.max(order.length, 1) * tall;
      const {brush, width, canvas} = canvasOf(forest, bottom + 40);
      const left = named ? Math.min(1.1 * Math.max(0, ...order.map((k) => brush.measureText(names[k]).width)) + 8, 220) : 12;
      // Some intervals have no end, or one far away: the axis ends where most do.
      const ends = order.flatMap((k) => [values[k], low[k] ?? values[k], high[k] ?? values[k]]).sort((a, b) => a - b);
      const spread = (ends[Math.floor(0.99 * ends.length)] ?? 1) * 1.15;
      const begin = Math.min(0, ends[Math.floor(0.01 * ends.length)] ?? 0), end = Math.min(ends.at(-1) ?? 1, spread) || 1;
      const right = width - 10;
      const at = (value) => left + (Math.min(Math.max(value, begin), end) - begin) / (end - begin) * (right - left);
      across(brush, begin, end, at, left, right, top, bottom, `${label} (${unit})`);
      order.forEach((k, number) => {
        const y = top + (number + 0.5) * tall;
        brush.strokeStyle = brush.fillStyle = colours[group[k]];
        if (low[k] !== null && high[k] !== null) {
          brush.lineWidth = named ? 1.5 : Math.min(1, Math.max(tall, 0.3));
          brush.globalAlpha = named ? 1 : 0.5;
          brush.beginPath();
          brush.moveTo(at(low[k]), y);
          brush.lineTo(at(high[k]), y);
          brush.stroke();
          brush.globalAlpha = 1;
        }
        const size = named ? 3.5 : 1;
        brush.fillRect(at(values[k]) - size, y - size, 2 * size, 2 * size);
        if (named) {
          brush.fillStyle = INK;
          brush.textAlign = "right";
          brush.fillText(names[k], left - 6, y, left - 8);
        }
      });
      hit = (event) => order[Math.floor((event.clientY - canvas.getBoundingClientRect().top - top) / tall)] ?? -1;
    });
    forest.querySelector("canvas").addEventListener("pointermove", (event) => {
      const k = hit(event), {values, low, high, unit} = metrics[pick.value];
      said.textContent = k < 0 ? "" : `${names[k]}: ${text(values[k])} (${text(low[k])} to ${text(high[k])}) ${unit}`;
    });
  }

  const bundle = document.getElementById("bundle");
  if (bundle) {
    const {names, colours, group, x, labels, most, finest, counts} = dataOf(bundle);
    const bytes = Uint8Array.from(atob(counts), (one) => one.charCodeAt(0));
    const values = new Int16Array(bytes.buffer), said = bundle.querySelector("output"), canvas = bundle.querySelector("canvas");
    const left = 54, top = 8, bottom = 360;
    let lit = -1, places = null;
    const draw = () => {
      const {brush, width} = canvasOf(bundle, bottom + 40), right = width - 10, seen = visible(bundle);
      const across_x = (at) => left + at / x.at(-1) * (right - left), up = (force) => bottom - force / most * (bottom - top);
      across(brush, 0, x.at(-1), across_x, left, right, top, bottom, labels[0]);
      brush.textAlign = "right";
      for (const at of ticks(0, most, 6)) brush.fillText(String(at), left - 6, up(at));
      brush.save();
      brush.translate(12, (top + bottom) / 2);
      brush.rotate(-Math.PI / 2);
      brush.textAlign = "center";
      brush.fillText(labels[1], 0, 0);
      brush.restore();
      places = {at: x.map(across_x), up, seen};
      const curve = (k) => {
        let begun = false;
        for (let n = 0; n < x.length; n++) {
          const count = values[k * x.length + n];
          if (count < -finest) continue;
          brush[begun ? "lineTo" : "moveTo"](places.at[n], up(count / finest * most));
          begun = true;
        }
      };
      // Some curves a path, for thousands of strokes take seconds; groups by turns, so that none hides another.
      const SOME = 100;
      brush.globalAlpha = Math.max(0.08, Math.min(1, 40 / names.length));
      brush.lineWidth = 1;
      for (let start = 0; start < names.length; start += SOME)
        for (const g of seen) {
          brush.strokeStyle = colours[g];
          brush.beginPath();
          for (let k = start; k < Math.min(start + SOME, names.length); k++) if (group[k] === g) curve(k);
          brush.stroke();
        }
      brush.globalAlpha = 1;
      if (lit < 0) return;
      brush.strokeStyle = "#000";
      brush.lineWidth = 2.5;
      brush.beginPath();
      curve(lit);
      brush.stroke();
    };
    redraw(bundle, draw);
    canvas.addEventListener("pointermove", (event) => {
      const {left: x0, top: y0} = canvas.getBoundingClientRect(), across_x = event.clientX - x0, y = event.clientY - y0;
      let column = 0, best = -1, least = 12;
      places.at.forEach((at, n) => { if (Math.abs(at - across_x) < Math.abs(places.at[column] - across_x)) column = n; });
      for (let k = 0; k < names.length; k++) {
        const count = values[k * x.length + column], far = Math.abs(places.up(count / finest * most) - y);
        if (count >= -finest && places.seen.has(group[k]) && far < least) [best, least] = [k, far];
      }
      if (best === lit) return;
      lit = best;
      said.textContent = lit < 0 ? "" : names[lit];
      draw();
    });
  }
})();
