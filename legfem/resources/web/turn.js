// The leg in 3D: facets sorted by depth and filled, from any side, between the states solved for.
"use strict";
(() => {
  const given = JSON.parse(document.getElementById("turn-data").textContent);
  const [placeUnit, moveUnit] = given.mm_a_count;
  const parts = given.parts.map((part) => ({...part,
    at: unpacked(part.at, Int16Array),
    moves: part.moves && unpacked(part.moves, Int16Array),
    fields: (part.fields || []).map((field) =>
      ({...field, values: unpacked(field.values, Uint16Array)}))}));
  const byId = (id) => document.getElementById(id);
  const canvas = byId("turn"), slider = byId("turn-at"), around = byId("turn-around");
  const tilt = byId("turn-tilt"), times = byId("turn-times"), reading = byId("turn-reading");
  const chosen = (name) => document.querySelector(`[name=${name}]:checked`).value;

  // The state before a place of the slider, and the share of the way to the next.
  const stopped = () => {
    const at = Number(slider.value), stops = given.stops;
    let k = stops.findIndex((stop) => stop >= at - 1e-9);
    k = Math.max(k < 0 ? stops.length - 1 : k, 1);
    return [k - 1, Math.min((at - stops[k - 1]) / (stops[k] - stops[k - 1]), 1)];
  };

  const placed = (part, [k, share], times, view) => {
    const [rows, columns] = part.shape, count = rows * columns, state = 3 * count;
    const found = new Float64Array(state);
    for (let i = 0; i < count; i++) {
      const p = [0, 1, 2].map((c) => {
        const j = 3 * i + c;
        return placeUnit * part.at[j] + (part.moves ? times * moveUnit *
          between(part.moves[k * state + j], part.moves[(k + 1) * state + j], share) : 0);
      });
      found.set(view(p), 3 * i);
    }
    return found;
  };

  const facets = (part, points, colour, alpha) => {
    const [rows, columns] = part.shape, found = [];
    for (let r = 0; r + 1 < rows; r++)
      for (let c = 0; c < columns; c++) {
        const next = (c + 1) % columns;
        const corners = [r * columns + c, r * columns + next,
          (r + 1) * columns + next, (r + 1) * columns + c];
        const [a, b, d] = [corners[0], corners[1], corners[3]].map((k) => 3 * k);
        const u = [0, 1, 2].map((k) => points[b + k] - points[a + k]);
        const v = [0, 1, 2].map((k) => points[d + k] - points[a + k]);
        const normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2],
          u[0] * v[1] - u[1] * v[0]];
        const facing = normal[2] / Math.hypot(...normal);
        const depth = corners.reduce((sum, k) => sum + points[3 * k + 2], 0);
        found.push({corners, points, depth, alpha, fill: colour(corners, facing)});
      }
    return found;
  };

  const draw = () => {
    const [state, share] = stopped(), shown = canvas.clientWidth;
    const dense = Math.max(window.devicePixelRatio || 1, 2);
    const inside = chosen("turn-show") === "inside";
    const width = 2.6 * given.reach, height = given.height + 1.2 * given.reach;
    canvas.width = shown * dense;
    canvas.height = Math.min(canvas.width * height / width, 560 * dense);
    const zoom = Math.min(canvas.width / width, canvas.height / height);
    const pen = canvas.getContext("2d");
    const turn = around.value * Math.PI / 180, lean = tilt.value * Math.PI / 180;
    const view = ([x, y, z]) => {
      // From the front at 0 degrees: DICOM's y points to the patient's back.
      const right = x * Math.cos(turn) + y * Math.sin(turn);
      const near = x * Math.sin(turn) - y * Math.cos(turn);
      return [right, z * Math.cos(lean) - near * Math.sin(lean),
        near * Math.cos(lean) + z * Math.sin(lean)];
    };
    const on = ([x, y]) => [canvas.width / 2 + zoom * x, canvas.height / 2 - zoom * y];
    const skin = parts.find((part) => part.name === "skin");
    const field = skin.fields.find((one) => one.name === chosen("turn-colour"));
    const [low, high] = field.range;
    const count = skin.shape[0] * skin.shape[1];
    const value = (k) => low + (high - low) * given.share_a_count *
      between(field.values[state * count + k], field.values[(state + 1) * count + k], share);
    const lit = (facing) => 0.88 + 0.12 * Math.abs(facing);
    let every = [];
    for (const part of parts) {
      if (!inside && !["skin", "tool"].includes(part.name)) continue;
      const points = placed(part, [state, share], times && times.checked ? 5 : 1, view);
      const colour = part.name === "skin"
        ? (corners, facing) => scaled((corners.reduce((sum, k) => sum + value(k), 0) / 4 - low) /
            (high - low), lit(facing))
        : (corners, facing) => `color-mix(in srgb, ${part.colour} ${100 * lit(facing)}%, black)`;
      const alpha = part.name === "tool" ? 0.3
        : !inside ? 1 : {skin: 0.12, hull: 0.35}[part.name] || 1;
      every = every.concat(facets(part, points, colour, alpha));
    }
    every.sort((one, other) => one.depth - other.depth);
    pen.lineWidth = 0.6 * dense;
    for (const facet of every) {
      pen.globalAlpha = facet.alpha;
      pen.beginPath();
      facet.corners.forEach((k, i) => {
        const [x, y] = on(facet.points.subarray(3 * k, 3 * k + 2));
        if (i) pen.lineTo(x, y); else pen.moveTo(x, y);
      });
      pen.closePath();
      pen.fillStyle = pen.strokeStyle = facet.fill;
      pen.fill();
      if (facet.alpha === 1) pen.stroke(); // else the seams would be darker
    }
    pen.globalAlpha = 1;
    if (inside) {
      pen.font = `${13 * dense}px system-ui, sans-serif`;
      for (const mark of given.marked) {
        const [x, y] = on(view(mark.at));
        pen.beginPath();
        pen.arc(x, y, 4 * dense, 0, 2 * Math.PI);
        pen.fillStyle = "#0b3d91";
        pen.fill();
        pen.lineWidth = 3 * dense;
        pen.strokeStyle = "#fff";
        pen.strokeText(mark.name, x + 7 * dense, y + 4 * dense);
        pen.fillStyle = "#000";
        pen.fillText(mark.name, x + 7 * dense, y + 4 * dense);
      }
    }
    const seen = given.views[Math.round(((Number(around.value) % 360) + 360) / 45) % 8];
    const values = Array.from({length: count}, (_, k) => value(k));
    const said = field.told === "most" ? Math.max(...values)
      : values.reduce((sum, one) => sum + one, 0) / count;
    const force = given.force.length
      ? `, ${between(given.force[state], given.force[state + 1], share).toFixed(2)} N` : "";
    const at = `${Number(slider.value).toFixed(given.digits)}${given.unit}${force}`;
    const told = `${field.told === "most" ? "at most" : "mean"} ${said.toFixed(1)} ${field.unit}`;
    reading.textContent = `${at}, seen from ${seen}: ${told}`;
    slider.setAttribute("aria-valuetext", `${at}, ${told}`);
    around.setAttribute("aria-valuetext", `seen from ${seen}`);
    byId("turn-low").textContent = `${low.toFixed(1)} ${field.unit}`;
    byId("turn-high").textContent = `${high.toFixed(1)} ${field.unit}, ${field.name}`;
    byId("turn-scale").hidden = inside;
    byId("turn-tissues").hidden = !inside;
  };

  let from = null;
  canvas.addEventListener("pointerdown", (event) => {
    from = {x: event.clientX, y: event.clientY, turn: Number(around.value), tilt: Number(tilt.value)};
    canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!from) return;
    const turn = from.turn - 0.6 * (event.clientX - from.x);
    around.value = ((turn + 180) % 360 + 360) % 360 - 180;
    tilt.value = from.tilt + 0.4 * (event.clientY - from.y);
    draw();
  });
  for (const end of ["pointerup", "pointercancel"])
    canvas.addEventListener(end, () => { from = null; });
  for (const input of document.querySelectorAll(".turn input"))
    input.addEventListener("input", draw);
  // In the next frame: drawing changes the height of what is observed.
  new ResizeObserver(() => requestAnimationFrame(draw)).observe(canvas.parentElement);
  addEventListener("beforeprint", draw);
})();
