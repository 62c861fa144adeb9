// The view of one run: what is shown of it, and what the pointer and the keys do.

const NEAR = 10; // pixels: how far from a cable or rod a click still picks it

class View {
  constructor(stage, run, viridis, show, unit, camera = new Camera()) {
    this.run = run;
    this.unit = unit;
    this.viridis = viridis.map((colour) => colour.map((value) => value / 255));
    this.show = show; // { design, load, surface, cables, loads, supports, colour, scale, exaggerate, moment, cut, measured }
    this.stage = stage;
    this.canvas = stage.querySelector("canvas");
    this.tip = stage.querySelector(".tip");
    this.picked = null; // { kind: "cable" | "rod", index }: a candidate cable's or a rod's number
    this.onpick = () => {};
    this.onmeasure = () => {};
    this.solid = new Solid(this.canvas);
    this.camera = camera;
    this.twins = []; // views beside this one, of the same camera and the same scales
    this.target = floats(run.target);
    this.cache = new Map();
    this.solid.setSkin(floats(run.surface.vertices), new Uint32Array(bytes(run.surface.triangles)));
    this.reach = extent(this.target);
    this.listen();
    this.observer = new ResizeObserver(() => this.resize());
    this.observer.observe(this.canvas);
    this.resize();
  }

  close() {
    this.observer.disconnect();
    this.stop.abort();
    this.solid.release();
  }

  get design() { return this.run.designs.find((each) => each.name === this.show.design); }
  get state() { return this.design.states[this.show.load]; }

  decoded(key, state = this.state) { // an array of a state, once
    if (!this.cache.has(state)) this.cache.set(state, {});
    const known = this.cache.get(state);
    return (known[key] ||= floats(state[key]));
  }

  // The states on the way to the one that is chosen: { title, state }, where null is the flat grid.
  get way() {
    const { design, run } = this, found = [], unbraced = run.designs.find((each) => each.name === "unbraced"), { none } = design.states;
    if (run.flat) found.push({ title: "flat", state: null });
    if (unbraced && unbraced !== design && unbraced.states.none) found.push({ title: "erected", state: unbraced.states.none, bare: true });
    if (none && this.show.load !== "none") found.push({ title: design.cables.length ? "braced" : "erected", state: none });
    if (this.show.load === "additional" && design.states.design) found.push({ title: "poured", state: design.states.design });
    return [...found, { title: { none: design.cables.length ? "braced" : "erected", design: "poured", additional: "overloaded" }[this.show.load] || "loaded", state: this.state }];
  }

  get between() { // the two states that the moment shown lies between, and how far: { from, to, share, whole }
    const way = this.way, last = way.length - 1, at = Math.min(this.show.moment, 1) * last, k = Math.min(Math.floor(at), Math.max(last - 1, 0));
    return { from: way[k], to: way[Math.min(k + 1, last)], share: last ? at - k : 0, whole: this.show.moment >= 1 };
  }

  blend() { // what is drawn of the moment: places, stress over strength, cable forces; straight between the computed states
    const { from, to, share, whole } = this.between, [a, b] = [from, to].map((each) => (each.state ? this.decoded("positions", each.state) : floats(this.run.flat)));
    const mixed = (first, second) => (share === 0 ? first : share === 1 || first === second ? second : second.map((value, k) => first[k] + share * (value - first[k])));
    const used = [from, to].map((each) => (each.state ? this.decoded("utilisation", each.state) : new Float32Array(a.length / 3)));
    const force = [from, to].map((each) => (each.state && !each.bare ? each.state.force : this.state.force.map(() => 0)));
    this.places = mixed(a, b);
    this.used = mixed(...used);
    this.force = whole ? this.state.force : mixed(...force);
    this.hung = whole || !(to.state === null || to.bare || ((from.state === null || from.bare) && share === 0)); // cables are there
    this.deviation = Float32Array.from({ length: this.places.length / 3 }, (_, k) => 1e3 * norm(minus(at(this.places, k), at(this.target, k)))); // (n,) mm
  }

  get ownScale() {
    return { design: this.run.fitting, case: this.run.limit }[this.show.scale] || Math.max(largest(this.deviation || [0]), 1e-6);
  }

  get values() { // of the nodes, as they are coloured: mm, % of the strength, or 1/m
    if (this.show.colour === "stress") return this.used.map((share) => 100 * share);
    return this.show.colour === "curvature" ? this.decoded("curved", this.run) : this.deviation;
  }

  get scale() { // end of the colours
    if (this.show.colour === "curvature") return Math.max(this.run.curvature, 1e-9);
    return this.show.colour === "stress" ? 100 : Math.max(...[this, ...this.twins].map((view) => view.ownScale));
  }

  get forceScale() { // N: one for all designs and loads, as in the pictures
    return Math.max(...[this, ...this.twins].map((view) => view.run.force), 1e-9);
  }

  node(k) { // where a node is drawn
    const there = at(this.places, k), { exaggerate } = this.show;
    if (exaggerate === 1 || !this.between.whole) return there;
    const meant = at(this.target, k);
    return plus(meant, times(exaggerate, minus(there, meant)));
  }

  crossing(k) { // the middle of a connector
    const [u, v] = this.run.crossings[k];
    return times(0.5, plus(this.node(u), this.node(v)));
  }

  get plane() { // [normal, level]: what lies beyond isn't drawn
    const { cut } = this.show, axis = cut ? "xyz".indexOf(cut.axis) : 0;
    return cut ? [[0, 1, 2].map((k) => (k === axis ? 1 : 0)), cut.at] : [[0, 0, 0], 1];
  }

  update() { // after any change of what is shown
    this.blend();
    const { run, show } = this, rows = [], css = getComputedStyle(this.stage), colour = (name) => rgb(css.getPropertyValue(`--${name}`));
    this.colours = { background: colour("stage"), skin: colour("skin"), rim: Number(css.getPropertyValue("--rim")) };
    const [low, mid, high, picked] = ["cable-low", "cable-mid", "cable-high", "picked"].map(colour);
    const thick = Math.max(this.design.radius, 0.0016 * this.reach);
    const add = (a, ra, b, rb, ca, cb, least = 0, plain = 0) => rows.push(...a, ra, ...b, rb, ...ca, ...cb, least, plain);
    const { values } = this;
    const shade = (k) => this.viridisAt(values[k] / this.scale);
    run.rods.forEach((rod, index) => {
      const own = this.picked?.kind === "rod" && this.picked.index === index;
      for (let k = 1; k < rod.nodes.length; k++) {
        const [a, b] = [rod.nodes[k - 1], rod.nodes[k]];
        add(this.node(a), thick, this.node(b), thick, own ? picked : shade(a), own ? picked : shade(b), own ? 2.6 : 1.4, own ? 1 : 0);
      }
    });
    if (this.between.from.state) for (const [a, b] of run.edges) { // edge beams, which the flat grid has none of; as thick as in the pictures
      add(this.node(a), 1.8 * thick, this.node(b), 1.8 * thick, colour("support"), colour("support"), 2.2);
    }
    if (show.cables && this.hung) {
      const top = this.forceScale;
      this.design.cables.forEach((cable, k) => {
        const own = this.picked?.kind === "cable" && this.picked.index === cable, [a, b] = run.cables.ends[cable].map((n) => this.node(n));
        const share = this.force[k] / top, slack = share <= 0;
        const tint = slack ? mix(this.colours.background, low, 0.55) : share < 0.5 ? mix(low, mid, 2 * share) : mix(mid, high, 2 * share - 1);
        const radius = thick * (slack ? 0.2 : 0.3 + 0.45 * Math.sqrt(share)), drawn = own ? picked : tint;
        add(a, own ? thick : radius, b, own ? thick : radius, drawn, drawn, own ? 2.4 : slack ? 0.6 : 0.9, own ? 1 : 0);
      });
    }
    if (show.supports) for (const n of run.supports) {
      const top = this.node(n);
      add(minus(top, [0, 0, 6 * thick]), 3 * thick, top, 0, colour("support"), colour("support"));
    }
    const marks = show.measured.filter((k) => k < run.crossings.length).map((k) => this.crossing(k));
    for (const [x, y, z] of marks) add([x, y, z - 2.2 * thick], 2.6 * thick, [x, y, z + 2.2 * thick], 2.6 * thick, picked, picked, 4, 1);
    if (marks.length === 2) add(marks[0], 0.6 * thick, marks[1], 0.6 * thick, picked, picked, 1, 1);
    if (show.loads && this.between.whole) for (const n of run.loads.find((each) => each.name === show.load).points) {
      const tip = plus(this.node(n), [0, 0, 1.3 * thick]), tall = 0.05 * this.reach;
      add(plus(tip, [0, 0, 0.35 * tall]), 0.10 * tall, tip, 0, colour("load"), colour("load"));
      add(plus(tip, [0, 0, tall]), 0.028 * tall, plus(tip, [0, 0, 0.35 * tall]), 0.028 * tall, colour("load"), colour("load"), 0.5);
    }
    this.solid.setTubes(rows);
    this.draw();
  }

  viridisAt(share) {
    const place = Math.min(Math.max(share, 0), 1) * (this.viridis.length - 1), k = Math.min(Math.floor(place), this.viridis.length - 2);
    return mix(this.viridis[k], this.viridis[k + 1], place - k);
  }

  resize() {
    const ratio = Math.min(window.devicePixelRatio || 1, 2), { clientWidth: width, clientHeight: height } = this.canvas;
    if (!width || !height) return;
    [this.canvas.width, this.canvas.height] = [Math.round(width * ratio), Math.round(height * ratio)];
    this.redraw();
  }

  redraw() { // and those of the same camera
    for (const view of [this, ...this.twins]) view.draw();
  }

  draw() {
    if (this.waiting || !this.colours) return;
    this.waiting = requestAnimationFrame(() => this.drawNow());
  }

  drawNow() {
    this.waiting = 0;
    this.camera.place(this.canvas.width, this.canvas.height);
    this.solid.draw(this.camera, { ...this.colours, skin: this.show.surface ? this.colours.skin : null, cut: this.plane.flat() });
  }

  look(view) {
    this.camera.turn(view);
    this.fit();
  }

  fit() {
    this.camera.fit([this, ...this.twins].flatMap((view) => view.frame()), this.canvas.width / this.canvas.height);
    this.redraw();
  }

  frame() { // the target and the state, with room for arrows and supports; another state leaves the camera where it is, to be compared
    const above = 0.06 * this.reach, below = 0.02 * this.reach, points = [];
    for (let k = 0; k < this.target.length / 3; k++) {
      for (const p of [at(this.target, k), this.node(k)]) points.push(...plus(p, [0, 0, above]), ...minus(p, [0, 0, below]));
    }
    return points;
  }

  // The nearest cable or rod to a place on the canvas, in CSS pixels; what lies in front wins among those that are about as near.
  find(x, y) {
    const ratio = this.canvas.width / this.canvas.clientWidth, found = [];
    this.camera.place(this.canvas.width, this.canvas.height);
    const seen = new Map(), screen = (n) => { if (!seen.has(n)) seen.set(n, this.camera.onScreen(this.node(n))); return seen.get(n); };
    const test = (kind, index, a, b) => {
      const { away, share } = besides([x * ratio, y * ratio], screen(a), screen(b));
      const [normal, level] = this.plane;
      if (dot(normal, this.node(share < 0.5 ? a : b)) > level) return;
      const deep = screen(a)[2] + share * (screen(b)[2] - screen(a)[2]);
      if (away < NEAR * ratio) found.push({ kind, index, node: share < 0.5 ? a : b, score: away / (NEAR * ratio) + (3 * deep) / this.camera.distance });
    };
    if (this.show.cables && this.hung) for (const cable of this.design.cables) test("cable", cable, ...this.run.cables.ends[cable]);
    this.run.rods.forEach((rod, index) => rod.nodes.slice(1).forEach((n, k) => test("rod", index, rod.nodes[k], n)));
    return found.sort((a, b) => a.score - b.score)[0] || null;
  }

  findCrossing(x, y) { // the number of the nearest crossing within three times the reach of a pick, or null
    const ratio = this.canvas.width / this.canvas.clientWidth, [normal, level] = this.plane;
    this.camera.place(this.canvas.width, this.canvas.height);
    let best = null, least = 3 * NEAR * ratio;
    this.run.crossings.forEach((_, k) => {
      const place = this.crossing(k), [sx, sy] = this.camera.onScreen(place), away = Math.hypot(sx - x * ratio, sy - y * ratio);
      if (away < least && dot(normal, place) <= level) [best, least] = [k, away];
    });
    return best;
  }

  pick(picked) { // { kind, index } or null
    this.picked = picked;
    this.update();
    this.onpick(picked);
  }

  step(by) { // to the next cable of the design
    const all = this.design.cables, now = this.picked?.kind === "cable" ? all.indexOf(this.picked.index) : by > 0 ? -1 : 0;
    if (all.length) this.pick({ kind: "cable", index: all[(now + by + all.length) % all.length] });
  }

  listen() {
    this.stop = new AbortController();
    const down = new Map(), { canvas } = this;
    const on = (name, act, options = {}) => canvas.addEventListener(name, act, { signal: this.stop.signal, ...options });
    let moved = 0;
    on("focus", () => canvas.classList.add("held")); // from then on one finger turns the shell both ways; until then it scrolls the page up and down
    on("blur", () => canvas.classList.remove("held"));
    on("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      down.set(event.pointerId, event);
      if (down.size === 1) moved = 0;
      this.hint(null);
    });
    on("pointermove", (event) => {
      const before = down.get(event.pointerId);
      if (!before) return event.pointerType === "mouse" && this.hover(event);
      const dx = event.clientX - before.clientX, dy = event.clientY - before.clientY, ratio = canvas.width / canvas.clientWidth;
      moved += Math.abs(dx) + Math.abs(dy);
      const other = [...down.values()].find((each) => each.pointerId !== event.pointerId);
      if (other) {
        const wide = (each) => Math.hypot(each.clientX - other.clientX, each.clientY - other.clientY) || 1;
        this.camera.zoom(wide(before) / wide(event));
        this.camera.move((0.5 * dx) * ratio, (0.5 * dy) * ratio);
      } else if (event.shiftKey || event.buttons & 6) this.camera.move(dx * ratio, dy * ratio);
      else this.camera.rotate(0.008 * dx, 0.008 * dy);
      canvas.classList.toggle("dragging", moved > 4);
      down.set(event.pointerId, event);
      this.redraw();
    });
    on("pointerup", (event) => {
      if (down.has(event.pointerId) && down.size === 1 && moved <= 4 && event.button === 0) this.click(event.offsetX, event.offsetY);
      down.delete(event.pointerId);
      canvas.classList.remove("dragging");
    });
    on("pointercancel", (event) => down.delete(event.pointerId));
    on("pointerleave", () => this.hint(null));
    on("contextmenu", (event) => event.preventDefault());
    on("wheel", (event) => { // the page scrolls on until the view was clicked or tabbed to
      if (document.activeElement !== canvas && !event.ctrlKey) return;
      event.preventDefault();
      this.camera.zoom(Math.exp(0.0015 * event.deltaY));
      this.redraw();
    }, { passive: false });
    on("keydown", (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      const far = event.shiftKey, turn = (dx, dy) => (far ? this.camera.move(-400 * dx, -400 * dy) : this.camera.rotate(dx, dy));
      const keys = {
        ArrowLeft: () => turn(-0.1, 0), ArrowRight: () => turn(0.1, 0), ArrowUp: () => turn(0, 0.1), ArrowDown: () => turn(0, -0.1),
        "+": () => this.camera.zoom(0.87), "=": () => this.camera.zoom(0.87), "-": () => this.camera.zoom(1.15), 0: () => this.look("iso"),
        n: () => this.step(1), p: () => this.step(-1), Escape: () => this.pick(null),
      };
      const act = keys[event.key] || keys[event.key.toLowerCase()];
      if (!act) return;
      event.preventDefault();
      act();
      this.redraw();
    });
  }

  click(x, y) {
    if (!this.show.measuring) return this.pick(this.find(x, y));
    const crossing = this.findCrossing(x, y);
    if (crossing !== null) this.onmeasure(crossing);
  }

  hover(event) {
    cancelAnimationFrame(this.hovering);
    const [x, y] = [event.offsetX, event.offsetY];
    this.hovering = requestAnimationFrame(() => this.hint(this.find(x, y), x, y));
  }

  hint(found, x, y) {
    this.tip.hidden = !found;
    this.canvas.classList.toggle("over", Boolean(found));
    if (!found) return;
    const away = this.show.colour === "curvature" ? `${this.values[found.node].toPrecision(3)} 1/m` : `${this.deviation[found.node].toFixed(2)} mm off`, k = this.design.cables.indexOf(found.index);
    this.tip.textContent = found.kind === "cable" ? `Cable C${k}: ${this.unit.of(this.force[k])} ${this.unit.name}` : `Rod ${this.run.rods[found.index].name}: ${away}`;
    const top = this.canvas.offsetTop + y - 36, left = Math.min(x + 12, this.canvas.clientWidth - this.tip.offsetWidth - 8);
    Object.assign(this.tip.style, { left: `${left}px`, top: `${Math.max(top, 4)}px` });
  }
}

function besides(p, a, b) { // distance of p from the line a b in the plane, and where along it
  const [ux, uy] = [b[0] - a[0], b[1] - a[1]], long = ux * ux + uy * uy || 1e-9;
  const share = Math.min(1, Math.max(0, ((p[0] - a[0]) * ux + (p[1] - a[1]) * uy) / long));
  return { away: Math.hypot(p[0] - a[0] - share * ux, p[1] - a[1] - share * uy), share };
}

function bytes(text) { return Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer; }
function floats(text) { return new Float32Array(bytes(text)); }
function largest(values) { return values.reduce((most, value) => Math.max(most, value), 0); }

function extent(points) {
  const range = (k) => { let low = Infinity, high = -Infinity; for (let i = k; i < points.length; i += 3) { low = Math.min(low, points[i]); high = Math.max(high, points[i]); } return high - low; };
  return Math.max(range(0), range(1), range(2));
}

function rgb(text) { // of "#rrggbb" or "#rgb"
  const hex = text.trim().slice(1), wide = hex.length === 3 ? [...hex].map((each) => each + each).join("") : hex;
  return [0, 2, 4].map((k) => parseInt(wide.slice(k, k + 2), 16) / 255);
}

// The unit that forces up to the largest of all loads are read in: the pictures' own.
class ForceUnit {
  constructor(most) { [this.name, this.word, this.size, this.digits] = most >= 1000 ? ["kN", "kilonewtons", 1000, 3] : ["N", "newtons", 1, 2]; }
  of(force) { const value = force / this.size; return value.toFixed(value >= 1000 ? 0 : value >= 100 ? 1 : this.digits); }
  cable(force) { return force > 0 ? this.of(force) : "slack"; }
}
