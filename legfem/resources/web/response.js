// The response surface over two factors, the others where their sliders stand.
"use strict";
(() => {
  const given = JSON.parse(document.getElementById("response-data").textContent);
  const byId = (id) => document.getElementById(id);
  const sliders = given.factors.map((_, k) => byId(`response-factor-${k}`));
  const picks = ["x", "y"].map((axis) => byId(`response-pick-${axis}`));
  const metric = byId("response-metric"), reading = byId("response-reading");
  const model = (name) => Bokeh.documents.map((one) => one.get_model_by_name(name)).find(Boolean);
  const levels = given.factors.map((factor) => new Map([-1, 0, 1].map((at, k) =>
    [at, factor.levels[k]])));

  const update = () => {
    if (!Bokeh.documents.length || !model("response-x")) return setTimeout(update, 50);
    const {label, unit, terms} = given.metrics[metric.value];
    const value = (at) => terms.reduce((sum, [term, size]) =>
      sum + term.reduce((product, k) => product * at[k], size), 0);
    const here = sliders.map((slider) => Number(slider.value));
    const [across, up] = picks.map((pick) => Number(pick.value));
    const ends = Array.from({length: given.cells}, (_, k) => -1 + 2 * k / (given.cells - 1));
    const values = ends.flatMap((y) => ends.map((x) =>
      value(here.map((v, k) => (k === across ? x : k === up ? y : v)))));
    const cells = model("response-cells"), colours = model("response-colours");
    colours.setv({low: Math.min(...values), high: Math.max(...values)});
    cells.data = {...cells.data, value: values};
    model("response-at").data = {x: [here[across]], y: [here[up]]};
    for (const [axis, k] of [["response-x", across], ["response-y", up]])
      model(axis).setv({axis_label: given.factors[k].label, major_label_overrides: levels[k]});
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
