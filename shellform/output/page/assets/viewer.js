// The view with its controls: what is shown, a second design beside the first, the way from the flat grid, measuring and cutting.

const TRUE = 0.01; // of a scale: how far from its place a number of its legend may stand, as in the pictures

class Viewer {
  constructor(article, runs, number, viridis) {
    this.article = article;
    this.runs = runs;
    this.run = runs[number];
    this.viridis = viridis;
    this.unit = new ForceUnit(largest(runs.map((each) => each.force)));
    this.picked = null;
    this.hint = article.querySelector(".picked").textContent;
    this.onshow = () => {}; // after any change of what is shown
    this.onpick = () => {}; // (picked, whether it was picked in the view)
    const best = this.run.designs[this.run.best], find = (what) => article.querySelector(what), spaced = this.run.spacing < 0.2 ? 2 : 1;
    this.find = find;
    this.mm = (value) => (value === undefined ? "–" : value.toFixed(spaced));
    this.show = {
      design: best.name, load: find(".controls [name=load]:checked").value, surface: false, cables: true, loads: true, supports: true, colour: "deviation",
      exaggerate: 1, moment: 1, cut: null, measured: [], measuring: false, scale: find("[name=scale]").value,
    };
    if (!this.run.strength) find("option[value=stress]").remove();
    if (this.run.curved) find("[name=colour]").value = this.show.colour = "curvature";
    else find("option[value=curvature]").remove();
    for (const [value, title] of this.others()) find("[name=beside]").append(new Option(title, value));
    find(".controls").addEventListener("change", (event) => {
      const { name, value } = event.target;
      if (name === "beside") return this.setBeside(value);
      if (name === "load" || name === "design") this.setMoment(1);
      this.show[name] = value;
      this.update();
    });
    find(".options").addEventListener("input", (event) => this.option(event.target));
    find(".measure").addEventListener("input", () => this.measureTyped());
    find("[data-measure]").addEventListener("click", () => this.measuring(!this.show.measuring));
    for (const form of article.querySelectorAll(".viewer form")) form.addEventListener("submit", (event) => event.preventDefault());
    for (const button of article.querySelectorAll("[data-camera]")) button.addEventListener("click", () => this.move(button.dataset.camera));
    find("[data-save=picture]").addEventListener("click", () => this.savePicture());
  }

  others() { // what can stand beside the design: [value, title]
    const own = this.run.designs.map((each) => [JSON.stringify([this.runs.indexOf(this.run), each.name, ""]), each.title]);
    const loads = this.run.loads.map((each) => [JSON.stringify([this.runs.indexOf(this.run), "", each.name]), `the same under ${each.title}`]);
    const rest = this.runs.flatMap((run, k) => (run === this.run ? [] : run.designs.map((each) => [JSON.stringify([k, each.name, ""]), `${run.title}: ${each.title}`])));
    return [...own, ...loads, ...rest];
  }

  open() { // the view takes a drawing context, so that only the run that is seen has one
    try {
      this.view = this.viewOn(this.find(".pane"), this.run, this.show);
      this.view.picked = this.picked;
      this.view.onpick = (picked) => this.tell(picked, true);
      this.update();
      this.view.look("iso");
      if (this.find("[name=beside]").value) this.setBeside(this.find("[name=beside]").value);
    } catch (error) {
      this.view = null;
      this.find(".told").textContent = `The view can't be drawn: ${error.message}. The pictures below show the same.`;
      this.update();
    }
  }

  viewOn(pane, run, show, camera) {
    const canvas = pane.querySelector("canvas");
    if (pane.dataset.used) canvas.replaceWith(canvas.cloneNode());
    pane.dataset.used = "yes";
    const view = new View(pane, run, this.viridis, show, this.unit, camera);
    view.onmeasure = (crossing) => this.measured(this.show.measured.length === 2 ? [crossing] : [...this.show.measured, crossing]);
    return view;
  }

  close() {
    for (const view of [this.view, this.second]) view?.close();
    this.view = this.second = null;
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

  option({ name, type, checked, value }) {
    if (name === "moment") this.setMoment(Number(value) / 100);
    else if (name === "cut" || name === "level") this.cut();
    else {
      this.show[name] = type === "checkbox" ? checked : type === "range" ? Number(value) : value;
      if (name === "exaggerate") this.find("[name=exaggerate]").previousElementSibling.textContent = `${value} ×`;
    }
    this.update();
  }

  setMoment(share) {
    this.show.moment = share;
    this.find("[name=moment]").value = String(Math.round(100 * share));
  }

  cut() { // beyond the plane across an axis nothing is drawn
    const axis = this.find("[name=cut]").value, slider = this.find("[name=level]"), words = slider.previousElementSibling;
    slider.disabled = !axis;
    this.find(".profile").hidden = !axis;
    words.textContent = "";
    this.show.cut = null;
    if (!axis) return;
    const k = "xyz".indexOf(axis), [low, high] = this.run.box.map((corner) => corner[k]), level = low + (Number(slider.value) / 100) * (high - low);
    this.show.cut = { axis, at: level };
    words.textContent = `at ${axis} = ${this.mm(1e3 * (level + this.run.middle[k]))} mm`;
  }

  setBeside(value) {
    this.second?.close();
    this.second = null;
    this.beside = value ? JSON.parse(value) : null;
    const pane = this.find(".pane.second");
    pane.hidden = !this.beside;
    if (this.view) {
      this.view.twins = [];
      if (this.beside) {
        const run = this.runs[this.beside[0]];
        this.second = this.viewOn(pane, run, {}, this.view.camera);
        [this.view.twins, this.second.twins] = [[this.second], [this.view]];
        this.second.onpick = (picked) => run === this.run && this.tell(picked, true);
      }
    }
    this.update();
    if (this.view) { this.view.resize(); this.second?.resize(); this.view.fit(); }
  }

  update() {
    if (this.picked?.kind === "cable" && !this.design.cables.includes(this.picked.index)) this.picked = null;
    if (this.view) {
      this.view.picked = this.picked;
      if (this.second) this.follow();
      for (const view of [this.view, this.second, this.second && this.view]) view?.update(); // a common scale is known once both are blended
      this.legends();
      this.find(".told").textContent = this.told(this.view);
      if (this.second) this.find(".pane.second .told").textContent = (this.second.run === this.run ? "" : `${this.second.run.title}: `) + this.told(this.second);
      if (this.show.cut) this.find(".profile").replaceChildren(profile(this.view), element("figcaption", `The cut ${this.find("[name=level]").previousElementSibling.textContent}: the target as a line, rods as dots in their colours${this.show.cut.axis === "z" ? ", seen from above" : ""}. Lengths in millimetres.`));
      this.find(".way").textContent = this.view.way.map((each) => each.title).join(" → ");
      this.find("[name=moment]").previousElementSibling.textContent = this.moment();
    }
    this.onshow();
    this.measured(this.show.measured, false);
    this.tell(this.picked);
  }

  follow() { // the second view shows what the first does, of its own design or load
    const [, design, load] = this.beside, { run } = this.second, name = design || this.show.design, own = run.designs.find((each) => each.name === name);
    const wanted = load || this.show.load;
    this.second.show = { ...this.show, design: name, load: own.states[wanted] ? wanted : "design" };
    const { picked } = this;
    this.second.picked = picked && run === this.run && (picked.kind === "rod" || own.cables.includes(picked.index)) ? picked : null;
  }

  moment() {
    const { from, to, share, whole } = this.view.between;
    if (whole || share === 1) return to.title;
    return share === 0 ? from.title : `${Math.round(100 * share)} % from ${from.title} to ${to.title}`;
  }

  told(view) {
    const { design } = view, load = view.run.loads.find((each) => each.name === view.show.load);
    if (!view.between.whole) {
      const { from, to, share } = view.between;
      return share === 0 || share === 1 ? `${design.title} design: ${(share ? to : from).title}.` : `${design.title} design between ${from.title} and ${to.title}: drawn straight between these two states, which are computed.`;
    }
    if (view.run.told) return view.run.told;
    const off = view.deviation, slack = view.state.force.flatMap((force, k) => (force <= 0 ? [`C${k}`] : []));
    const mean = off.reduce((sum, value) => sum + value, 0) / off.length, count = design.cables.length;
    const named = slack.length <= 6 ? slack.join(", ") : `${slack.slice(0, 6).join(", ")} and ${slack.length - 6} more`;
    const cables = count ? `${count} cables, ${slack.length ? `${slack.length} slack (${named})` : "none slack"}` : "no cables";
    return `${design.title} design under ${load.title}: ${millimetres(largest(off))} mm off at most, ${millimetres(mean)} in the mean; ${cables}.`;
  }

  legends() {
    const ticks = (where, end, over) => { // a number has to stand where it says
      const values = [0, 0.25, 0.5, 0.75, 1].map((share) => share * end);
      let digits = 0;
      while (digits < 12 && values.some((value) => Math.abs(Number(value.toFixed(digits)) - value) > TRUE * end)) digits += 1;
      this.find(`${where} .ticks`).replaceChildren(...values.map((value, k) => element("span", (k === 4 && over ? "≥ " : "") + (value ? value.toFixed(digits) : "0"))));
    };
    const { scale, forceScale } = this.view, stress = this.show.colour === "stress";
    this.find(".rods-legend figcaption").textContent = this.show.colour === "curvature" ? "Rods: curvature, 1/metre" : stress ? "Rods: bending stress, percent of the strength" : "Rods: distance from the target, millimetres";
    ticks(".rods-legend", scale, this.show.colour !== "curvature" && (stress || this.show.scale !== "state"));
    this.find(".cables-legend").hidden = !this.design.cables.length || !(forceScale > 1e-9);
    this.find(".cables-legend figcaption").textContent = `Cables: force, ${this.unit.word}; slack ones faint`;
    ticks(".cables-legend", forceScale / this.unit.size, false);
  }

  measuring(on) {
    this.show.measuring = on;
    this.find("[data-measure]").setAttribute("aria-pressed", String(on));
    for (const canvas of this.article.querySelectorAll("canvas")) canvas.classList.toggle("measuring", on);
    if (on) this.measured([]);
  }

  measureTyped() {
    const numbers = ["from", "to"].map((name) => this.find(`[name=${name}]`).value);
    this.measured(numbers.filter((text) => text !== "").map(Number), true, false);
  }

  measured(crossings, redraw = true, written = true) { // up to two numbers of crossings
    const count = this.run.crossings.length, known = crossings.filter((k) => Number.isInteger(k) && k >= 0 && k < count);
    this.show.measured = known;
    if (written) ["from", "to"].forEach((name, k) => (this.find(`[name=${name}]`).value = known[k] ?? ""));
    this.find(".measure output").textContent = known.length < crossings.length ? `Crossings are numbered from 0 to ${count - 1}.` : known.length === 2 ? this.distance(...known) : known.length ? "And the other crossing?" : "";
    if (redraw && this.view) for (const view of [this.view, this.second]) if (view) { view.show.measured = known; view.update(); }
  }

  distance(from, to) {
    if (!this.view) return "";
    const { view } = this, middle = (values, k) => times(0.5, plus(...this.run.crossings[k].map((n) => at(values, n)))), apart = minus(middle(view.places, to), middle(view.places, from));
    const here = 1e3 * norm(apart), meant = 1e3 * norm(minus(middle(view.target, to), middle(view.target, from))), signed = (value) => `${value < 0 ? "−" : ""}${this.mm(Math.abs(value))}`;
    return `${this.mm(here)} mm straight from crossing ${from} to ${to} (along x ${signed(1e3 * apart[0])}, y ${signed(1e3 * apart[1])}, z ${signed(1e3 * apart[2])}); on the target ${this.mm(meant)} mm.`;
  }

  savePicture() { // of the view, both halves
    if (!this.view) return;
    const views = [this.view, this.second].filter(Boolean), all = document.createElement("canvas"), pen = all.getContext("2d");
    [all.width, all.height] = [views.reduce((sum, { canvas }) => sum + canvas.width, 0), Math.max(...views.map(({ canvas }) => canvas.height))];
    let left = 0;
    for (const view of views) { view.drawNow(); pen.drawImage(view.canvas, left, 0); left += view.canvas.width; }
    download(all.toDataURL("image/png"), `${this.run.title} ${this.show.design} ${this.show.load}.png`);
  }

  pick(picked) { // from a table
    if (this.view) this.view.picked = picked;
    this.picked = picked;
    if (this.view) this.update();
    else this.tell(picked);
  }

  tell(picked, inView = false) {
    this.picked = picked;
    if (inView && this.second) this.update();
    this.onpick(picked, inView);
    const box = this.find(".picked");
    if (!picked) return box.replaceChildren(element("p", this.hint, "quiet"));
    const head = element("h3", `${picked.kind === "cable" ? "Cable" : "Rod"} ${this.name(picked)}`);
    const away = element("button", "Let go");
    away.type = "button";
    away.addEventListener("click", () => this.pick(null));
    head.append(away);
    box.replaceChildren(head, ...(picked.kind === "cable" ? this.cable(picked.index) : this.rod(picked.index)));
  }

  cable(index) {
    const k = this.design.cables.indexOf(index), [from, to] = this.run.cables.joints[index];
    const words = element("p", `From crossing ${from} to ${to}, rest length ${this.mm(this.design.rest[k])} mm.`);
    return [words, this.overLoads(["Length [mm]", `Force [${this.unit.name}]`], (state) => [this.mm(state.length[k]), this.unit.cable(state.force[k])])];
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

function download(source, name) {
  const link = document.createElement("a");
  Object.assign(link, { href: source, download: name });
  link.click();
}

function millimetres(value) { return value >= 10 ? value.toFixed(0) : value >= 0.1 ? value.toFixed(1) : value.toPrecision(1); }
