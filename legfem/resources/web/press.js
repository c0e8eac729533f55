// The section between the states that were solved, drawn at the slider's displacement.
"use strict";
(() => {
  const given = JSON.parse(document.getElementById("press-data").textContent);
  const cells = unpacked(given.cells, Uint16Array);
  const moves = unpacked(given.moves, Int16Array);
  const measures = given.measures.map((one) =>
    ({...one, values: unpacked(one.values, Uint16Array)}));
  const corners = given.corners, count = cells.length / corners, length = given.vertices.length;
  const [left, bottom, width, height] = given.frame;
  const canvas = document.getElementById("press"), slider = document.getElementById("press-at");
  const reading = document.getElementById("press-reading");
  const mesh = document.getElementById("press-mesh");
  // Plus zero, so that what rounds to zero has no sign.
  const told = (measure, value) =>
    `${(Number(value.toFixed(measure.digits)) + 0).toFixed(measure.digits)} ${measure.unit}`.trim();

  const draw = () => {
    const d = Number(slider.value), known = given.displacement;
    let k = known.findIndex((at) => at >= d - 1e-9);
    k = Math.max(k < 0 ? known.length - 1 : k, 1);
    const part = Math.min((d - known[k - 1]) / (known[k] - known[k - 1]), 1);
    const at = new Float64Array(length);
    for (let i = 0; i < length; i++)
      at[i] = given.vertices[i] +
        given.mm_a_count * between(moves[(k - 1) * length + i], moves[k * length + i], part);

    const shown = canvas.clientWidth, dense = Math.max(window.devicePixelRatio || 1, 2);
    canvas.width = shown * dense;
    canvas.height = canvas.width * height / width;
    const pen = canvas.getContext("2d"), zoom = canvas.width / width;
    const X = (x) => (x - left) * zoom, Y = (y) => (bottom + height - y) * zoom;
    const outline = (points) => {
      pen.beginPath();
      points.forEach(([x, y], i) => (i ? pen.lineTo(X(x), Y(y)) : pen.moveTo(X(x), Y(y))));
      pen.closePath();
    };
    const chosen = document.querySelector("[name=press-colour]:checked").value;
    const measure = measures.find((one) => one.name === chosen), byTissue = !measure;
    const share = (c) => given.share_a_count *
      between(measure.values[(k - 1) * count + c], measure.values[k * count + c], part);
    pen.lineWidth = 0.35 * dense;
    for (let c = 0; c < count; c++) {
      pen.beginPath();
      for (let n = 0; n < corners; n++) {
        const v = 2 * cells[c * corners + n];
        if (n) pen.lineTo(X(at[v]), Y(at[v + 1]));
        else pen.moveTo(X(at[v]), Y(at[v + 1]));
      }
      pen.closePath();
      pen.fillStyle = byTissue ? given.tissue[c] : scaled(share(c));
      pen.fill();
      // Without the mesh, cells are edged in their own colour: else the seams between them show.
      pen.strokeStyle = mesh.checked ? "rgba(0, 0, 0, 0.35)" : pen.fillStyle;
      pen.stroke();
    }
    pen.strokeStyle = "#222";
    pen.lineWidth = dense;
    for (const bone of given.bones) {
      outline(bone);
      pen.fillStyle = given.bone;
      pen.fill();
      pen.stroke();
    }
    pen.setLineDash([4 * dense, 3 * dense]);
    pen.strokeStyle = "#666";
    outline(given.skin);
    pen.stroke();
    pen.setLineDash([]);
    const [a, b] = [given.centres[k - 1], given.centres[k]];
    pen.beginPath();
    pen.arc(X(between(a[0], b[0], part)), Y(between(a[1], b[1], part)), given.radius * zoom,
      0, 2 * Math.PI);
    pen.fillStyle = "#B8C4CC";
    pen.fill();
    pen.strokeStyle = "#000";
    pen.stroke();

    const force = between(given.force[k - 1], given.force[k], part);
    const text = `${d.toFixed(1)} mm, ${force.toFixed(2)} N`;
    reading.textContent = text;
    slider.setAttribute("aria-valuetext", text);
    if (measure) {
      const [low, high] = measure.range;
      document.getElementById("press-low").textContent = told(measure, low);
      document.getElementById("press-high").textContent = `${told(measure, high)} ${measure.name}`;
    }
    document.getElementById("press-scale").hidden = byTissue;
    document.getElementById("press-tissues").hidden = !byTissue;
  };

  for (const input of document.querySelectorAll(".press input"))
    input.addEventListener("input", draw);
  // In the next frame: drawing changes the height of what is observed.
  new ResizeObserver(() => requestAnimationFrame(draw)).observe(canvas.parentElement);
  addEventListener("beforeprint", draw);
})();
