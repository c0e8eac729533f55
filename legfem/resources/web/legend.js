// A check box shows and hides its line in both panels of its plot.
for (const box of document.querySelectorAll("input[data-plot]")) {
  box.addEventListener("change", () => {
    for (const place of ["above", "below"]) {
      const name = `${box.dataset.plot}-${place}-${box.dataset.line}`;
      for (const drawn of Bokeh.documents) {
        const line = drawn.get_model_by_name(name);
        if (line) line.visible = box.checked;
      }
    }
  });
}
