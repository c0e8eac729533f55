// The response surface over two factors, the others where their sliders stand.
"use strict";
(() => {
  const given = JSON.parse(document.getElementById("response-data").textContent);
  const byId = (id) => document.getElementById(id);
  const sliders = given.factors.map((_, k) => byId(`response-factor-${k}`));
  const picks = ["x", "y"].map((axis) => byId(`response-pick-${axis}`));
  const metric = byId("response-metric"), reading = byId("response-reading");
  let values = [], shown = [0, 1];
  const ends = Array.from({length: given.cells}, (_, k) => -1 + 2 * k / (given.cells - 1));
  const axis = (which) => ({
    min: -1.05, max: 1.05, grid: {display: false}, title: {display: true},
    ticks: {stepSize: 0.05, autoSkip: false, callback: (at) => levels[shown[which]].get(Math.round(at * 100) / 100)},
  });
  const cells = {
    id: "cells",
    beforeDatasetsDraw({ctx, scales: {x, y}}) {
      const [low, high] = [Math.min(...values), Math.max(...values)], half = 1 / (given.cells - 1);
      values.forEach((value, k) => {
        const [at, up] = [ends[k % given.cells], ends[Math.floor(k / given.cells)]];
        const [left, right] = [x.getPixelForValue(at - half), x.getPixelForValue(at + half)];
        const [bottom, top] = [y.getPixelForValue(up - half), y.getPixelForValue(up + half)];
        ctx.fillStyle = scaled((value - low) / (high - low || 1));
        ctx.fillRect(left, top, right - left + 0.5, bottom - top + 0.5);
      });
    },
  };
  const levels = given.factors.map((factor) => new Map([-1, 0, 1].map((at, k) =>
    [at, factor.levels[k]])));

  const chart = new Chart(byId("response"), {
    type: "scatter",
    data: {datasets: [{data: [], pointStyle: "cross", radius: 9, borderColor: "#D55E00", borderWidth: 3}]},
    plugins: [cells],
    options: {
      animation: false, maintainAspectRatio: false, scales: {x: axis(0), y: axis(1)},
      plugins: {legend: {display: false}, tooltip: {enabled: false}},
    },
  });

  const update = () => {
    const {label, unit, terms} = given.metrics[metric.value];
    const value = (at) => terms.reduce((sum, [term, size]) =>
      sum + term.reduce((product, k) => product * at[k], size), 0);
    const here = sliders.map((slider) => Number(slider.value));
    const [across, up] = picks.map((pick) => Number(pick.value));
    shown = [across, up];
    values = ends.flatMap((y) => ends.map((x) =>
      value(here.map((v, k) => (k === across ? x : k === up ? y : v)))));
    chart.data.datasets[0].data = [{x: here[across], y: here[up]}];
    chart.options.scales.x.title.text = given.factors[across].label;
    chart.options.scales.y.title.text = given.factors[up].label;
    chart.update();
    byId("response-low").textContent = Math.min(...values).toPrecision(3);
    byId("response-high").textContent = Math.max(...values).toPrecision(3);
    reading.textContent = `${label}: ${value(here).toPrecision(3)} ${unit}`;
    sliders.forEach((slider, k) => {
      const at = here[k] < -0.5 ? "low" : here[k] > 0.5 ? "high" : "middle";
      slider.setAttribute("aria-valuetext", `${at} (${here[k].toFixed(1)} of its range, coded)`);
    });
  };

  for (const input of document.querySelectorAll(".response input, .response select"))
    input.addEventListener("input", update);
  for (const [one, other] of [picks, [picks[1], picks[0]]])
    one.addEventListener("input", () => {
      // The same factor can't be on both axes.
      if (one.value === other.value) other.value = (Number(one.value) + 1) % given.factors.length;
      update();
    });
  update();
})();
