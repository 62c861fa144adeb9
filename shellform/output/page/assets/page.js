// Joins the parts: one panel for each run, the tabs between them, and enlarged pictures.

const data = JSON.parse(document.getElementById("data").textContent);

class Panel { // a run: its view, and its tables that follow
  constructor(article) {
    this.article = article;
    this.viewer = new Viewer(article, data.runs, Number(article.dataset.run), data.viridis);
    const find = this.viewer.find, { run, mm, unit } = this.viewer;
    this.cables = new LiveTable(find("[data-table=cables]"), find("[data-search=cables]"), find("[id$=-cables] .count"), [
      { title: "Cable", value: (row) => row.order, text: (row) => `C${row.order}` },
      { title: "From crossing", number: true, value: (row) => row.from, text: (row) => String(row.from) },
      { title: "To crossing", number: true, value: (row) => row.to, text: (row) => String(row.to) },
      { title: "Rest length [mm]", number: true, value: (row) => row.rest, text: (row) => mm(row.rest) },
      { title: "Length [mm]", number: true, value: (row) => row.length, text: (row) => mm(row.length) },
      { title: `Force [${unit.name}]`, number: true, value: (row) => row.force / unit.size, text: (row) => unit.cable(row.force) },
      { title: `Largest of all loads [${unit.name}]`, number: true, value: (row) => row.most / unit.size, text: (row) => unit.of(row.most) },
    ], (key) => this.viewer.pick({ kind: "cable", index: key }));
    this.rods = new LiveTable(find("[data-table=rods]"), find("[data-search=rods]"), find("[id$=-rods] .count"), [
      { title: "Rod", value: (row) => row.key, text: (row) => row.name },
      { title: "Length [mm]", number: true, value: (row) => row.length, text: (row) => mm(row.length) },
      { title: "Crossings", number: true, value: (row) => row.crossings, text: (row) => String(row.crossings) },
      { title: "Off at most [mm]", number: true, value: (row) => row.off, text: (row) => row.off.toFixed(2) },
      ...(run.strength ? [{ title: "Bending stress over strength [%]", number: true, value: (row) => 100 * row.used, text: (row) => (100 * row.used).toFixed(0) }] : []),
    ], (key) => this.viewer.pick({ kind: "rod", index: key }));
    for (const table of ["cables", "rods"]) find(`[data-save=${table}]`).addEventListener("click", () => this[table].save(`${table} ${this.viewer.show.design} ${this.viewer.show.load}`));
    this.viewer.onshow = () => this.fill();
    this.viewer.onpick = (picked, inView) => this.mark(picked, inView);
  }

  open() { this.viewer.open(); }
  close() { this.viewer.close(); }

  fill() {
    const { design, state, load, run } = this.viewer, all = Object.values(design.states);
    for (const words of this.article.querySelectorAll(".which")) words.textContent = `${design.title} design under ${load.title}`;
    this.cables.fill(design.cables.map((cable, k) => ({
      key: cable, order: k, from: run.cables.joints[cable][0], to: run.cables.joints[cable][1], rest: design.rest[k],
      length: state.length[k], force: state.force[k], most: Math.max(...all.map((each) => each.force[k])), faint: state.force[k] <= 0,
    })));
    this.rods.fill(run.rods.map((rod, k) => ({ key: k, ...rod, off: state.rods[k][0], used: state.rods[k][1] })));
  }

  mark(picked, scroll) {
    this.cables.mark(picked?.kind === "cable" ? picked.index : null, scroll);
    this.rods.mark(picked?.kind === "rod" ? picked.index : null, scroll);
    for (const link of this.article.querySelectorAll(".see")) {
      link.hidden = !picked || !link.closest("section").id.endsWith(`-${picked.kind}s`);
      link.textContent = picked ? `See ${picked.kind === "cable" ? "Cable" : "Rod"} ${this.viewer.name(picked)} in the view` : "";
    }
  }
}

const panels = [...document.querySelectorAll(".run")].map((article) => new Panel(article));
const tabs = [...document.querySelectorAll("[role=tab]")];
let open = null;

function choose(number, focus = false) {
  if (open === number) return;
  if (open !== null) panels[open].close();
  open = number;
  panels.forEach((panel, k) => (panel.article.hidden = tabs.length > 0 && k !== number));
  tabs.forEach((tab, k) => {
    tab.setAttribute("aria-selected", String(k === number));
    tab.tabIndex = k === number ? 0 : -1;
  });
  if (focus) tabs[number].focus();
  panels[number].open();
}

tabs.forEach((tab, k) => {
  tab.addEventListener("click", () => choose(k));
  tab.addEventListener("keydown", (event) => {
    const to = { ArrowRight: k + 1, ArrowLeft: k - 1, Home: 0, End: tabs.length - 1 }[event.key];
    if (to !== undefined) { event.preventDefault(); choose((to + tabs.length) % tabs.length, true); }
  });
});
for (const link of document.querySelectorAll(".compare a[href^='#run']")) link.addEventListener("click", () => choose(panels.findIndex((panel) => `#${panel.article.id}` === link.hash)));
for (const table of document.querySelectorAll("table.sortable")) sortStatic(table);
panels.slice(1).forEach((panel) => panel.viewer.update());
choose(0);

const large = document.querySelector("dialog.large");
for (const button of document.querySelectorAll(".gallery figure > button")) button.addEventListener("click", () => {
  const picture = button.querySelector("img");
  Object.assign(large.querySelector("img"), { src: picture.src, alt: picture.alt });
  large.querySelector("p").textContent = picture.alt;
  large.showModal();
});
for (const button of document.querySelectorAll("[data-save-picture]")) button.addEventListener("click", () => {
  const { src } = button.closest("figure").querySelector("img, video"), ending = { "image/svg+xml": "svg" }[src.slice(5, src.indexOf(";"))] || src.slice(src.indexOf("/") + 1, src.indexOf(";"));
  download(src, `${button.dataset.savePicture}.${ending}`);
});
for (const button of document.querySelectorAll("[data-save-table]")) button.addEventListener("click", () => {
  const table = button.closest("section").querySelector("table"), plain = (cell) => cell.textContent.replace(/\s+/g, " ").trim();
  saveCsv([...table.rows].map((row) => [...row.cells].map(plain)), button.dataset.saveTable);
});
large.addEventListener("click", (event) => { if (event.target === large) large.close(); });

// Colours of the view follow the page's: dark, light, and paper. On paper nothing is folded away.
const repaint = () => { for (const view of [panels[open].viewer.view, panels[open].viewer.second]) if (view) { view.update(); view.drawNow(); } };
for (const media of ["(prefers-color-scheme: dark)", "print"]) matchMedia(media).addEventListener("change", repaint);
let folded = [];
addEventListener("beforeprint", () => {
  folded = [...document.querySelectorAll("details:not([open])")];
  for (const each of folded) each.open = true;
  repaint();
});
addEventListener("afterprint", () => {
  for (const each of folded) each.open = false;
  repaint();
});
