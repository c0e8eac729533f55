// Curves by Chart.js: both panels of a figure share the abscissa, its zoom and the cursor.
"use strict";
(() => {
  const DASHES = {solid: [], dashed: [8, 5], dotted: [2, 4], dotdash: [2, 4, 8, 4]};
  const EDGE = 74, LEAST = 640, PRINTED = {alone: 240, above: 155, below: 160};
  Chart.defaults.font.family = getComputedStyle(document.body).fontFamily;
  Chart.defaults.color = "#222";
  const points = (x, y) => x.map((one, k) => ({x: one, y: y[k]}));
  const every = [];
  for (const script of document.querySelectorAll("script[data-curves]")) {
    const given = JSON.parse(script.textContent);
    const figure = script.closest("figure");
    const known = given.x.filter((one) => one !== null);
    const [min, max] = [Math.min(...known), Math.max(...known)];
    const rising = given.x.every((one, k) => !k || one >= given.x[k - 1]);
    const charts = [];
    let cursor = null;
    const together = (chart) => {
      const {min, max} = chart.scales.x;
      for (const other of charts) {
        if (other === chart || (other.scales.x.min === min && other.scales.x.max === max)) continue;
        other.zoomScale("x", {min, max});
      }
    };
    const canvases = [...figure.querySelectorAll(".plot canvas")];
    canvases.forEach((canvas, place) => {
      const last = place === canvases.length - 1;
      const datasets = given.lines.map((line) => ({
        label: line.name, data: line.values[place] ? points(given.x, line.values[place]) : [], read: line.read,
        borderColor: line.colour, borderWidth: line.points || line.faint ? 1 : 2, borderDash: DASHES[line.dash],
        pointRadius: line.points ? 2.5 : 0, pointHoverRadius: 4, pointBackgroundColor: "#fff", showLine: !line.points, clip: 6,
      }));
      for (const [x, low, high] of last ? given.band : []) {
        const edge = {borderWidth: 0, pointRadius: 0, pointHoverRadius: 0, backgroundColor: "rgba(120, 120, 120, 0.3)"};
        datasets.push({...edge, data: points(x, high), fill: "+1"}, {...edge, data: points(x, low)});
      }
      const marks = {
        id: "marks",
        beforeDatasetsDraw({ctx, chartArea: {left, right, top, bottom}, scales: {x, y}}) {
          ctx.save();
          ctx.beginPath();
          ctx.rect(left, top, right - left, bottom - top);
          ctx.clip();
          for (const [from, to] of last ? given.located : []) {
            const [a, b] = [x.getPixelForValue(from), x.getPixelForValue(to)];
            ctx.fillStyle = "rgba(240, 228, 66, 0.45)";
            ctx.fillRect(a, top, Math.max(b - a, 1), bottom - top);
          }
          const line = (dash, ...ends) => {
            ctx.setLineDash(dash);
            ctx.beginPath();
            ctx.moveTo(...ends.slice(0, 2));
            ctx.lineTo(...ends.slice(2));
            ctx.stroke();
          };
          if (last) line([], left, y.getPixelForValue(0), right, y.getPixelForValue(0));
          if (cursor !== null) line([4, 4], x.getPixelForValue(cursor), top, x.getPixelForValue(cursor), bottom);
          ctx.restore();
        },
      };
      // Noise about zero alone is no reason for a tick below it.
      const drawn = given.lines.flatMap((line) => line.values[place] ?? []).filter((one) => one !== null);
      const [lowest, highest] = [drawn.reduce((a, b) => Math.min(a, b), 0), drawn.reduce((a, b) => Math.max(a, b), 0)];
      const below = lowest < 0 && lowest > -0.05 * highest ? {min: lowest} : {};
      const chart = new Chart(canvas, {
        type: "line",
        data: {datasets},
        plugins: [marks],
        options: {
          animation: false, maintainAspectRatio: false, layout: {padding: {right: 12}},
          interaction: {mode: "index", axis: rising ? "x" : "xy", intersect: false},
          onHover: (event, active, hovered) => {
            cursor = active.length ? hovered.data.datasets[active[0].datasetIndex].data[active[0].index].x : null;
            for (const other of charts) other.draw();
          },
          scales: {
            // With limits of its own the axis has its ticks at round numbers, not counted from the first reading.
            x: {type: "linear", min, max, ticks: {display: last, includeBounds: false}, title: {display: last, text: given.label}},
            y: {...below, ticks: {includeBounds: false}, title: {display: true, text: given.labels[place]}, afterFit: (axis) => { axis.width = EDGE; }},
          },
          plugins: {
            legend: {display: false},
            tooltip: {
              filter: (item) => item.dataset.read,
              callbacks: {
                title: (items) => (items.length ? `${given.label}: ${items[0].parsed.x.toFixed(2)}` : ""),
                label: (item) => `${item.dataset.label}: ${item.parsed.y.toFixed(3)}`,
              },
            },
            zoom: {zoom: {drag: {enabled: true, threshold: 4}, mode: "xy", onZoomComplete: ({chart: one}) => together(one)}},
          },
        },
      });
      canvas.addEventListener("dblclick", () => charts.forEach((one) => one.resetZoom()));
      charts.push(chart);
      every.push(chart);
    });
    for (const box of figure.querySelectorAll("input[data-plot]"))
      box.addEventListener("change", () => charts.forEach((chart) => {
        chart.setDatasetVisibility(Number(box.dataset.line), box.checked);
        chart.update();
      }));
  }
  // A printed page has another width than the window, and holds two figures.
  const place = (box) => box.className || (box.parentNode.querySelector(".below") ? "above" : "alone");
  addEventListener("beforeprint", () => every.forEach((chart) =>
    chart.resize(LEAST, PRINTED[place(chart.canvas.parentNode)] || PRINTED.alone)));
  addEventListener("afterprint", () => every.forEach((chart) => chart.resize()));
})();
