// The view of one run: what is shown of it, and what the pointer and the keys do.

const NEAR = 10; // pixels: how far from a cable or rod a click still picks it

class View {
  constructor(stage, run, viridis, show) {
    this.run = run;
    this.viridis = viridis.map((colour) => colour.map((value) => value / 255));
    this.show = show; // { design, load, surface, cables, loads, supports, colour, scale, exaggerate }
    this.stage = stage;
    this.canvas = stage.querySelector("canvas");
    this.tip = stage.querySelector(".tip");
    this.picked = null; // { kind: "cable" | "rod", index }: a candidate cable's or a rod's number
    this.onpick = () => {};
    this.solid = new Solid(this.canvas);
    this.camera = new Camera();
    this.target = floats(run.target);
    this.cache = new Map();
    this.solid.setSkin(floats(run.surface.vertices), new Uint32Array(bytes(run.surface.triangles)));
    this.reach = extent(this.target);
    this.listen();
    this.observer = new ResizeObserver(() => this.resize());
    this.observer.observe(this.canvas);
    this.resize();
    this.look("iso");
  }

  close() {
    this.observer.disconnect();
    this.stop.abort();
    this.solid.release();
  }

  get design() { return this.run.designs.find((each) => each.name === this.show.design); }
  get state() { return this.design.states[this.show.load]; }

  decoded(key) { // an array of this state, once
    const name = [this.show.design, this.show.load, key].join("\n");
    if (!this.cache.has(name)) this.cache.set(name, floats(this.state[key]));
    return this.cache.get(name);
  }

  get deviation() { // (n,) mm
    const name = [this.show.design, this.show.load, "deviation"].join("\n");
    if (!this.cache.has(name)) {
      const place = this.decoded("positions");
      this.cache.set(name, Float32Array.from({ length: place.length / 3 }, (_, k) => 1e3 * norm(minus(at(place, k), at(this.target, k)))));
    }
    return this.cache.get(name);
  }

  get scale() { // end of the colours: mm, or % of the strength
    if (this.show.colour === "stress") return 100;
    return { design: this.run.fitting, case: this.run.limit }[this.show.scale] || Math.max(largest(this.deviation), 1e-6);
  }

  get forceScale() { // N: one for all designs and loads, as in the pictures
    return Math.max(...this.run.designs.flatMap((each) => Object.values(each.states).map((state) => largest(state.force))), 1e-9);
  }

  node(k) { // where a node is drawn
    const there = at(this.decoded("positions"), k), meant = at(this.target, k);
    return this.show.exaggerate === 1 ? there : plus(meant, times(this.show.exaggerate, minus(there, meant)));
  }

  update() { // after any change of what is shown
    const { run, show } = this, rows = [], css = getComputedStyle(this.stage), colour = (name) => rgb(css.getPropertyValue(`--${name}`));
    this.colours = { background: colour("stage"), skin: colour("skin"), rim: Number(css.getPropertyValue("--rim")) };
    const [low, mid, high, picked] = ["cable-low", "cable-mid", "cable-high", "picked"].map(colour);
    const thick = Math.max(this.design.radius, 0.0016 * this.reach);
    const add = (a, ra, b, rb, ca, cb, least = 0, plain = 0) => rows.push(...a, ra, ...b, rb, ...ca, ...cb, least, plain);
    const values = show.colour === "stress" ? this.decoded("utilisation").map((share) => 100 * share) : this.deviation;
    const shade = (k) => this.viridisAt(values[k] / this.scale);
    run.rods.forEach((rod, index) => {
      const own = this.picked?.kind === "rod" && this.picked.index === index;
      for (let k = 1; k < rod.nodes.length; k++) {
        const [a, b] = [rod.nodes[k - 1], rod.nodes[k]];
        add(this.node(a), thick, this.node(b), thick, own ? picked : shade(a), own ? picked : shade(b), own ? 2.6 : 1.4, own ? 1 : 0);
      }
    });
    if (show.cables) {
      const top = this.forceScale;
      this.design.cables.forEach((cable, k) => {
        const own = this.picked?.kind === "cable" && this.picked.index === cable, [a, b] = run.cables.ends[cable].map((n) => this.node(n));
        const share = this.state.force[k] / top, slack = share <= 0;
        const tint = slack ? mix(this.colours.background, low, 0.55) : share < 0.5 ? mix(low, mid, 2 * share) : mix(mid, high, 2 * share - 1);
        const radius = thick * (slack ? 0.2 : 0.3 + 0.45 * Math.sqrt(share)), drawn = own ? picked : tint;
        add(a, own ? thick : radius, b, own ? thick : radius, drawn, drawn, own ? 2.4 : slack ? 0.6 : 0.9, own ? 1 : 0);
      });
    }
    if (show.supports) for (const n of run.supports) {
      const top = this.node(n);
      add(minus(top, [0, 0, 6 * thick]), 3 * thick, top, 0, colour("support"), colour("support"));
    }
    if (show.loads) for (const n of run.loads.find((each) => each.name === show.load).points) {
      const tip = plus(this.node(n), [0, 0, 1.3 * thick]), tall = 0.05 * this.reach;
      add(plus(tip, [0, 0, 0.35 * tall]), 0.10 * tall, tip, 0, colour("load"), colour("load"));
      add(plus(tip, [0, 0, tall]), 0.028 * tall, plus(tip, [0, 0, 0.35 * tall]), 0.028 * tall, colour("load"), colour("load"), 0.5);
    }
    this.solid.setTubes(rows);
    this.redraw();
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

  redraw() {
    if (this.waiting || !this.colours) return;
    this.waiting = requestAnimationFrame(() => this.drawNow());
  }

  drawNow() {
    this.waiting = 0;
    this.camera.place(this.canvas.width, this.canvas.height);
    this.solid.draw(this.camera, { ...this.colours, skin: this.show.surface ? this.colours.skin : null });
  }

  look(view) {
    this.camera.turn(view);
    this.camera.fit(this.frame(), this.canvas.width / this.canvas.height);
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
      const deep = screen(a)[2] + share * (screen(b)[2] - screen(a)[2]);
      if (away < NEAR * ratio) found.push({ kind, index, node: share < 0.5 ? a : b, score: away / (NEAR * ratio) + (3 * deep) / this.camera.distance });
    };
    if (this.show.cables) for (const cable of this.design.cables) test("cable", cable, ...this.run.cables.ends[cable]);
    this.run.rods.forEach((rod, index) => rod.nodes.slice(1).forEach((n, k) => test("rod", index, rod.nodes[k], n)));
    return found.sort((a, b) => a.score - b.score)[0] || null;
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
      if (down.has(event.pointerId) && down.size === 1 && moved <= 4 && event.button === 0) this.pick(this.find(event.offsetX, event.offsetY));
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

  hover(event) {
    cancelAnimationFrame(this.hovering);
    const [x, y] = [event.offsetX, event.offsetY];
    this.hovering = requestAnimationFrame(() => this.hint(this.find(x, y), x, y));
  }

  hint(found, x, y) {
    this.tip.hidden = !found;
    this.canvas.classList.toggle("over", Boolean(found));
    if (!found) return;
    const away = `${this.deviation[found.node].toFixed(2)} mm off`, k = this.design.cables.indexOf(found.index);
    this.tip.textContent = found.kind === "cable" ? `Cable C${k}: ${newtons(this.state.force[k])} N` : `Rod ${this.run.rods[found.index].name}: ${away}`;
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

function newtons(force) { return force >= 1000 ? force.toFixed(0) : force >= 100 ? force.toFixed(1) : force.toFixed(2); }
