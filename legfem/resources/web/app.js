"use strict";
// Files that are dropped or chosen go to the workspace one by one; what arrived stays there.
(() => {
  const say = (zone, text, wrong = false) => {
    const line = zone.querySelector("[data-said]");
    line.textContent = text;
    line.classList.toggle("wrong", wrong);
  };
  const inside = async (entry, path) => {
    if (entry.name.startsWith(".")) return [];
    const at = path ? `${path}/${entry.name}` : entry.name;
    if (entry.isFile) {
      return [{path: at, file: await new Promise((done, fail) => entry.file(done, fail))}];
    }
    const reader = entry.createReader(), found = [];
    for (;;) {
      const some = await new Promise((done, fail) => reader.readEntries(done, fail));
      if (!some.length) return found;
      for (const one of some) found.push(...await inside(one, at));
    }
  };
  const sent = async (url, options) => {
    for (let pause = 500; ; pause *= 2) {
      try {
        return await fetch(url, options);
      } catch (error) {
        if (pause > 16000) throw error;  // the server may be on its way back
        await new Promise((done) => setTimeout(done, pause));
      }
    }
  };
  const checked = async (answer) => {
    if (!answer.ok) throw new Error((await answer.text()).trim());
    return answer;
  };
  const upload = async (zone, files) => {
    if (!files.length) return say(zone, "the folder is empty: nothing was taken in", true);
    const tops = new Set(files.map((one) => one.path.split("/")[0]));
    const folder = tops.size === 1 && files.every((one) => one.path.includes("/"));
    const top = [...tops][0];
    let name = zone.dataset.input;
    try {
      if (!name) {
        const wish = folder ? top : top.replace(/\.[^.]*$/, "");
        const made = await checked(await sent("/inputs", {
          method: "POST", headers: {"Content-Type": "application/json"},
          body: JSON.stringify({name: wish}),
        }));
        ({name} = await made.json());
      }
      let done = 0;
      for (const {path, file} of files) {
        say(zone, `${++done} of ${files.length}: ${path}`);
        const at = folder ? path.slice(top.length + 1) : path;
        const url = `/inputs/${encodeURIComponent(name)}/${at.split("/").map(encodeURIComponent).join("/")}`;
        await checked(await sent(url, {method: "PUT", body: file}));
      }
      location.assign(`/input/${encodeURIComponent(name)}`);
    } catch (error) {
      say(zone, error.message || "the server doesn't answer: start it again, and drop the files again", true);
    }
  };
  const zoneOf = (event) => event.target.closest?.("[data-drop]");
  for (const kind of ["dragenter", "dragover"]) {
    document.addEventListener(kind, (event) => {
      event.preventDefault();
      zoneOf(event)?.classList.add("over");
    });
  }
  document.addEventListener("dragleave", (event) => zoneOf(event)?.classList.remove("over"));
  document.addEventListener("drop", async (event) => {
    event.preventDefault();
    const zone = zoneOf(event) ?? document.querySelector("[data-drop]");
    if (!zone) return;
    zone.classList.remove("over");
    const entries = [...event.dataTransfer.items].map((one) => one.webkitGetAsEntry()).filter(Boolean);
    const files = [];
    for (const entry of entries) files.push(...await inside(entry, ""));
    upload(zone, files);
  });
  document.addEventListener("change", (event) => {
    if (event.target.type !== "file" || !zoneOf(event)) return;
    const files = [...event.target.files].map((file) => ({path: file.webkitRelativePath || file.name, file}))
      .filter(({path}) => !path.split("/").some((part) => part.startsWith(".")));
    upload(zoneOf(event), files);
  });
})();
