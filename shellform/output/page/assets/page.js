// Joins the parts: one panel for each run, the tabs between them, and enlarged pictures.

const data = JSON.parse(document.getElementById("data").textContent);

class Panel {
  constructor(article) {
    this.article = article;
    this.run = data.runs[Number(article.dataset.run)];
    const best = this.run.designs[this.run.best];
    this.show = { design: best.name, load: "design", surface: false, cables: true, loads: true, supports: true, colour: "deviation", exaggerate: 1 };
    const find = (what) => article.querySelector(what), spaced = this.run.spacing < 0.2 ? 2 : 1;
    this.mm = (value) => (value === undefined ? "–" : value.toFixed(spaced));
    this.find = find;
    this.show.scale = find("[name=scale]").value;
    this.cables = new LiveTable(find("[data-table=cables]"), find("[data-search=cables]"), find("[id$=-cables] .count"), [
      { title: "Cable", value: (row) => row.order, text: (row) => `C${row.order}` },
      { title: "From crossing", number: true, value: (row) => row.from, text: (row) => String(row.from) },
      { title: "To crossing", number: true, value: (row) => row.to, text: (row) => String(row.to) },
      { title: "Rest length [mm]", number: true, value: (row) => row.rest, text: (row) => this.mm(row.rest) },
      { title: "Length [mm]", number: true, value: (row) => row.length, text: (row) => this.mm(row.length) },
      { title: "Force [N]", number: true, value: (row) => row.force, text: (row) => (row.force > 0 ? newtons(row.force) : "slack") },
      { title: "Largest of all loads [N]", number: true, value: (row) => row.most, text: (row) => newtons(row.most) },
    ], (key) => this.pick({ kind: "cable", index: key }));
    this.rods = new LiveTable(find("[data-table=rods]"), find("[data-search=rods]"), find("[id$=-rods] .count"), [
      { title: "Rod", value: (row) => row.key, text: (row) => row.name },
      { title: "Length [mm]", number: true, value: (row) => row.length, text: (row) => this.mm(row.length) },
      { title: "Crossings", number: true, value: (row) => row.crossings, text: (row) => String(row.crossings) },
      { title: "Off at most [mm]", number: true, value: (row) => row.off, text: (row) => row.off.toFixed(2) },
      ...(this.run.strength ? [{ title: "Bending stress over strength [%]", number: true, value: (row) => 100 * row.used, text: (row) => (100 * row.used).toFixed(0) }] : []),
    ], (key) => this.pick({ kind: "rod", index: key }));
    for (const button of this.article.querySelectorAll("[data-save]")) {
      const table = button.dataset.save;
      button.addEventListener("click", () => this[table].save(`${table} ${this.show.design} ${this.show.load}`));
    }
    if (!this.run.strength) find("option[value=stress]").remove();
    find(".controls").addEventListener("change", (event) => { this.show[event.target.name] = event.target.value; this.update(); });
    find(".options").addEventListener("input", (event) => {
      const { name, type, checked, value } = event.target;
      this.show[name] = type === "checkbox" ? checked : type === "range" ? Number(value) : value;
      if (type === "range") find(".options output").textContent = `${value} ×`;
      this.update();
    });
    for (const form of article.querySelectorAll(".viewer form")) form.addEventListener("submit", (event) => event.preventDefault());
    for (const button of article.querySelectorAll("[data-camera]")) button.addEventListener("click", () => this.move(button.dataset.camera));
    this.picked = null;
  }

  open() { // the view takes a drawing context, so that only the run that is seen has one
    try {
      const canvas = this.find("canvas");
      if (this.used) canvas.replaceWith(canvas.cloneNode());
      this.used = true;
      this.view = new View(this.find(".stage"), this.run, data.viridis, this.show);
      this.view.picked = this.picked;
      this.view.onpick = (picked) => this.tell(picked, true);
    } catch (error) {
      this.view = null;
      this.find(".told").textContent = `The view can't be drawn: ${error.message}. The pictures below show the same.`;
    }
    this.update();
  }

  close() {
    this.view?.close();
    this.view = null;
  }

  move(view) {
    if (!this.view) return;
    if (view === "in" || view === "out") { this.view.camera.zoom(view === "in" ? 0.8 : 1.25); this.view.redraw(); }
    else this.view.look(view);
  }

  name(picked) { // as on the drawings and schedules: cables are counted by design
    return picked.kind === "cable" ? `C${this.design.cables.indexOf(picked.index)}` : this.run.rods[picked.index].name;
  }

  get design() { return this.run.designs.find((each) => each.name === this.show.design); }
  get state() { return this.design.states[this.show.load]; }
  get load() { return this.run.loads.find((each) => each.name === this.show.load); }

  update() {
    if (this.picked?.kind === "cable" && !this.design.cables.includes(this.picked.index)) this.picked = null;
    if (this.view) {
      this.view.picked = this.picked;
      this.view.update();
      this.legends();
      const off = this.view.deviation, slack = this.state.force.filter((force) => force <= 0).length;
      const mean = off.reduce((sum, value) => sum + value, 0) / off.length, count = this.design.cables.length;
      const cables = count ? `${count} cables, ${slack ? `${slack} slack` : "none slack"}` : "no cables";
      this.find(".told").textContent = `${this.design.title} design under ${this.load.title}: ${millimetres(largest(off))} mm off at most, ${millimetres(mean)} in the mean; ${cables}.`;
    }
    for (const words of this.article.querySelectorAll(".which")) words.textContent = `${this.design.title} design under ${this.load.title}`;
    const all = Object.values(this.design.states);
    this.cables.fill(this.design.cables.map((cable, k) => ({
      key: cable, order: k, from: this.run.cables.joints[cable][0], to: this.run.cables.joints[cable][1], rest: this.design.rest[k],
      length: this.state.length[k], force: this.state.force[k], most: Math.max(...all.map((state) => state.force[k])), faint: this.state.force[k] <= 0,
    })));
    this.rods.fill(this.run.rods.map((rod, k) => ({ key: k, ...rod, off: this.state.rods[k][0], used: this.state.rods[k][1] })));
    this.tell(this.picked);
  }

  legends() {
    const ticks = (where, end, digits, over) => {
      const frame = this.find(`${where} .ticks`);
      frame.replaceChildren(...[0, 0.25, 0.5, 0.75, 1].map((share) => {
        const tick = document.createElement("span");
        tick.textContent = (share === 1 && over ? "≥ " : "") + (share * end).toFixed(digits);
        return tick;
      }));
    };
    const digits = (end) => Math.max(0, 2 - Math.floor(Math.log10(end / 4 + 1e-12)) - 1), { scale, forceScale } = this.view, stress = this.show.colour === "stress";
    this.find(".rods-legend figcaption").textContent = stress ? "Rods: bending stress over strength [%]" : "Rods: deviation from the target [mm]";
    ticks(".rods-legend", scale, digits(scale), stress || this.show.scale !== "state");
    this.find(".cables-legend").hidden = !this.design.cables.length;
    ticks(".cables-legend", forceScale, digits(forceScale), false);
  }

  pick(picked) { // from a table
    this.picked = picked;
    if (this.view) { this.view.picked = picked; this.view.update(); }
    this.tell(picked);
  }

  tell(picked, scroll = false) {
    this.picked = picked;
    this.cables.mark(picked?.kind === "cable" ? picked.index : null, scroll);
    this.rods.mark(picked?.kind === "rod" ? picked.index : null, scroll);
    const box = this.find(".picked"), name = picked && `${picked.kind === "cable" ? "Cable" : "Rod"} ${this.name(picked)}`;
    for (const link of this.article.querySelectorAll(".see")) {
      link.hidden = !picked || !link.closest("section").id.endsWith(`-${picked.kind}s`);
      link.textContent = `See ${name} in the view`;
    }
    if (!picked) return box.replaceChildren(element("p", "Pick a cable or a rod in the view, or a row of the tables below.", "quiet"));
    const head = element("h3", name);
    const away = element("button", "Let go");
    away.type = "button";
    away.addEventListener("click", () => this.pick(null));
    head.append(away);
    box.replaceChildren(head, ...(picked.kind === "cable" ? this.cable(picked.index) : this.rod(picked.index)));
  }

  cable(index) {
    const k = this.design.cables.indexOf(index), [from, to] = this.run.cables.joints[index];
    const words = element("p", `From crossing ${from} to ${to}, rest length ${this.mm(this.design.rest[k])} mm.`);
    return [words, this.overLoads(["Length [mm]", "Force [N]"], (state) => [this.mm(state.length[k]), state.force[k] > 0 ? newtons(state.force[k]) : "slack"])];
  }

  rod(index) {
    const rod = this.run.rods[index], words = element("p", `${this.mm(rod.length)} mm long, ${rod.crossings} crossings.`);
    const heads = this.run.strength ? ["Off [mm]", "Stress [%]"] : ["Off [mm]"];
    return [words, this.overLoads(heads, (state) => [state.rods[index][0].toFixed(2), ...(this.run.strength ? [(100 * state.rods[index][1]).toFixed(0)] : [])])];
  }

  overLoads(heads, values) { // a line for each load case
    const table = document.createElement("table"), head = table.createTHead().insertRow(), body = table.createTBody();
    head.append(element("th", "Under"), ...heads.map((text) => element("th", text, "num")));
    for (const load of this.run.loads) {
      const line = body.insertRow();
      if (load.name === this.show.load) line.className = "best";
      line.append(element("th", load.title), ...values(this.design.states[load.name]).map((text) => element("td", text, "num")));
    }
    return table;
  }
}

function element(name, text, kind = "") {
  const made = document.createElement(name);
  made.textContent = text;
  if (kind) made.className = kind;
  return made;
}

function millimetres(value) { return value >= 10 ? value.toFixed(0) : value >= 0.1 ? value.toFixed(1) : value.toPrecision(1); }

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
panels.slice(1).forEach((panel) => panel.update());
choose(0);

const large = document.querySelector("dialog.large");
for (const button of document.querySelectorAll(".gallery button")) button.addEventListener("click", () => {
  const picture = button.querySelector("img");
  Object.assign(large.querySelector("img"), { src: picture.src, alt: picture.alt });
  large.querySelector("p").textContent = picture.alt;
  large.showModal();
});
large.addEventListener("click", (event) => { if (event.target === large) large.close(); });

// Colours of the view follow the page's: dark, light, and paper. On paper nothing is folded away.
const repaint = () => { const view = panels[open].view; if (view) { view.update(); view.drawNow(); } };
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
