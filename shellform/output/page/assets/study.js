"use strict";
// Draws the scatter and the parallel coordinates from the page's data, and ties both together: pointing and ranges hold for both.

const data = JSON.parse(document.getElementById("data").textContent);
const SVG = "http://www.w3.org/2000/svg";
const rows = data.rows.map((row) => ({ number: row[0], front: row[1] === 1, values: row.slice(2) }));
const usable = data.names.map((name, k) => k).filter((k) => rows.some((row) => typeof row.values[k] === "number"));
const label = (k) => data.names[k];
const told = document.getElementById("told");
const ranges = new Map(); // of axes that are narrowed: [low, high] as shares
let picked = null;

function node(name, attributes, parent, text) {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  if (text !== undefined) made.textContent = text;
  parent?.append(made);
  return made;
}

function extent(k) {
  let low = Infinity, high = -Infinity;
  for (const row of rows) { const v = row.values[k]; if (typeof v === "number") { low = Math.min(low, v); high = Math.max(high, v); } }
  if (low === high) { const off = Math.abs(low) / 20 || 1; low -= off; high += off; }
  return [low, high];
}

function ticks(low, high) {
  const raw = (high - low) / 5, ten = 10 ** Math.floor(Math.log10(raw)), step = [1, 2, 5, 10].map((s) => s * ten).find((s) => s >= raw);
  const found = [];
  for (let t = Math.ceil(low / step) * step; t <= high + 1e-9 * step; t += step) found.push(t);
  return found;
}

const shade = (share) => data.colours[Math.min(Math.floor(share * data.colours.length), data.colours.length - 1)];

const raised = (power) => [...String(power)].map((sign) => "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["-0123456789".indexOf(sign)]).join("");
const plain = (v) => { // as a person writes it: a power of ten where JavaScript would write 1e-7
  const [digits, power] = String(Number(v.toPrecision(4))).split("e");
  return power === undefined ? digits : `${digits} × 10${raised(Number(power))}`;
};
const number = (v) => (typeof v !== "number" ? "–" : plain(v).replace("-", "−"));

function scatter() {
  const box = document.getElementById("scatter"), form = document.forms[0], W = 900, H = 460, L = 84, R = 32, T = 14, B = 48;
  const kx = Number(form.x.value), ky = Number(form.y.value), [x0, x1] = pad(extent(kx)), [y0, y1] = pad(extent(ky));
  const x = (v) => L + ((v - x0) / (x1 - x0)) * (W - L - R), y = (v) => H - B - ((v - y0) / (y1 - y0)) * (H - T - B);
  const svg = node("svg", { viewBox: `0 0 ${W} ${H}`, role: "img", "aria-label": `${label(ky)} over ${label(kx)}` });
  for (const t of ticks(x0, x1)) { node("line", { class: "axis", x1: x(t), x2: x(t), y1: T, y2: H - B }, svg); node("text", { x: x(t), y: H - B + 16, "text-anchor": "middle" }, svg, number(t)); }
  for (const t of ticks(y0, y1)) { node("line", { class: "axis", x1: L, x2: W - R, y1: y(t), y2: y(t) }, svg); node("text", { x: L - 6, y: y(t) + 4, "text-anchor": "end" }, svg, number(t)); }
  node("text", { class: "title", x: (L + W - R) / 2, y: H - 8, "text-anchor": "middle" }, svg, label(kx));
  node("text", { class: "title", transform: `translate(14 ${(T + H - B) / 2}) rotate(-90)`, "text-anchor": "middle" }, svg, label(ky));
  const drawn = rows.filter((row) => typeof row.values[kx] === "number" && typeof row.values[ky] === "number");
  const front = drawn.filter((row) => row.front).sort((a, b) => a.values[kx] - b.values[kx]);
  if (front.length > 1 && data.goals.length === 2 && data.goals.includes(kx) && data.goals.includes(ky)) {
    node("polyline", { class: "step", points: front.map((row) => `${x(row.values[kx])},${y(row.values[ky])}`).join(" ") }, svg);
  }
  const by = (select) => { // a row's place, from 0 to 1, in a further column
    if (select.value === "") return null;
    const k = Number(select.value), [low, high] = extent(k);
    return { k, low, high, share: (row) => (typeof row.values[k] === "number" ? (row.values[k] - low) / (high - low) : null) };
  };
  const colour = by(form.colour), size = by(form.size), named = [...new Set([kx, ky, colour?.k, size?.k])].filter((k) => k !== undefined);
  const hint = document.createElement("p");
  hint.className = "hint";
  hint.hidden = true;
  for (const row of [...drawn.filter((each) => !each.front), ...front]) {
    const wide = size ? 3 + 7 * (size.share(row) ?? 0) : row.front ? 5 : 3.5, dot = node("circle", { class: "dot", cx: x(row.values[kx]), cy: y(row.values[ky]), r: wide.toFixed(1) }, svg);
    const tint = colour ? colour.share(row) : null;
    if (tint !== null) dot.style.fill = shade(tint);
    if (colour && row.front) dot.style.stroke = "var(--front)";
    row.dot = dot;
    dot.addEventListener("pointerenter", () => {
      pick(row);
      const place = dot.getBoundingClientRect(), frame = box.getBoundingClientRect();
      hint.textContent = [`Design ${row.number}${row.front ? ", on the front" : ""}`, ...named.map((k) => `${label(k)}: ${number(row.values[k])}`)].join("\n");
      hint.hidden = false;
      const left = Math.min(place.right - frame.left + box.scrollLeft + 8, box.scrollLeft + frame.width - hint.offsetWidth - 8);
      Object.assign(hint.style, { left: `${Math.max(left, 4)}px`, top: `${Math.max(place.top - frame.top - hint.offsetHeight - 6, 4)}px` });
    });
    dot.addEventListener("pointerleave", () => (hint.hidden = true));
    dot.addEventListener("click", () => open(row));
  }
  box.replaceChildren(svg, hint);
  key(colour, size);
  mark();
}

function key(colour, size) { // what colours and sizes mean
  const parts = [];
  if (colour) {
    const words = document.createElement("span"), bar = document.createElement("i");
    bar.style.background = `linear-gradient(90deg, ${data.colours.join(", ")})`;
    words.append(`Colour: ${label(colour.k)}, ${number(colour.low)} `, bar, ` ${number(colour.high)}; the front is ringed`);
    parts.push(words);
  }
  if (size) parts.push(Object.assign(document.createElement("span"), { textContent: `Size: ${label(size.k)}, small ${number(size.low)}, large ${number(size.high)}` }));
  document.getElementById("key").replaceChildren(...parts);
}

const pad = ([low, high]) => [low - 0.04 * (high - low), high + 0.04 * (high - low)];

function parallel() {
  const box = document.getElementById("parallel"), axes = usable.slice(0, 12), W = 900, H = 340, T = 46, B = 26, L = 50;
  const svg = node("svg", { viewBox: `0 0 ${W} ${H}`, role: "img", "aria-label": "Parallel coordinates of all designs" });
  const x = (j) => L + (axes.length < 2 ? 0 : (j / (axes.length - 1)) * (W - 2 * L));
  const spans = axes.map(extent), share = (j, v) => (v - spans[j][0]) / (spans[j][1] - spans[j][0]), y = (s) => H - B - s * (H - T - B);
  for (const row of [...rows.filter((each) => !each.front), ...rows.filter((each) => each.front)]) {
    const points = axes.map((k, j) => (typeof row.values[k] === "number" ? `${x(j).toFixed(1)},${y(share(j, row.values[k])).toFixed(1)}` : null)).filter(Boolean);
    row.line = node("polyline", { class: "line", points: points.join(" ") }, svg);
    row.line.addEventListener("pointerenter", () => pick(row));
    row.line.addEventListener("click", () => open(row));
  }
  axes.forEach((k, j) => {
    node("line", { class: "axis", x1: x(j), x2: x(j), y1: T, y2: H - B }, svg);
    node("text", { class: "title", x: j === 0 ? 4 : j === axes.length - 1 ? W - 4 : x(j), y: j % 2 ? 14 : 28, "text-anchor": j === 0 ? "start" : j === axes.length - 1 ? "end" : "middle" }, svg, label(k));
    node("text", { x: x(j), y: T - 5, "text-anchor": "middle" }, svg, number(spans[j][1]));
    node("text", { x: x(j), y: H - B + 15, "text-anchor": "middle" }, svg, number(spans[j][0]));
    const brush = node("rect", { class: "brush", x: x(j) - 7, width: 14, y: 0, height: 0, visibility: "hidden" }, svg);
    const hit = node("rect", { class: "hit", x: x(j) - 12, width: 24, y: T - 4, height: H - T - B + 8 }, svg);
    const at = (event) => { const r = svg.getBoundingClientRect(); return Math.min(1, Math.max(0, (H - B - ((event.clientY - r.top) / r.height) * H) / (H - T - B))); };
    let from = null;
    hit.addEventListener("pointerdown", (event) => { from = at(event); hit.setPointerCapture(event.pointerId); });
    hit.addEventListener("pointermove", (event) => {
      if (from === null) return;
      const to = at(event), low = Math.min(from, to), high = Math.max(from, to);
      if (high - low < 0.01) { ranges.delete(k); brush.setAttribute("visibility", "hidden"); }
      else { ranges.set(k, [low, high]); brush.setAttribute("y", y(high)); brush.setAttribute("height", y(low) - y(high)); brush.setAttribute("visibility", "visible"); }
      mark();
    });
    hit.addEventListener("pointerup", (event) => {
      if (from !== null && Math.abs(at(event) - from) < 0.01) { ranges.delete(k); brush.setAttribute("visibility", "hidden"); mark(); }
      from = null;
    });
  });
  box.replaceChildren(svg);
  mark();
}

function inside(row) {
  for (const [k, [low, high]] of ranges) {
    const [a, b] = extent(k), v = row.values[k];
    if (typeof v !== "number" || (v - a) / (b - a) < low || (v - a) / (b - a) > high) return false;
  }
  return true;
}

function mark() {
  let left = 0;
  for (const row of rows) {
    const within = inside(row), kind = (row.front ? " front" : "") + (row === picked ? " picked" : "") + (within ? "" : " off");
    left += within;
    row.dot?.setAttribute("class", "dot" + kind);
    row.line?.setAttribute("class", "line" + kind);
  }
  if (ranges.size && !picked) told.textContent = `${left} of ${rows.length} designs are in the chosen ranges.`;
}

function pick(row) {
  picked = row;
  const head = document.createElement("strong"), list = document.createElement("dl"), link = data.links[row.number];
  head.textContent = `Design ${row.number}${row.front ? ", on the front" : ""} `;
  list.append(...data.names.map((name, k) => {
    const line = document.createElement("div");
    line.append(...[["dt", name], ["dd", number(row.values[k])]].map(([kind, text]) => Object.assign(document.createElement(kind), { textContent: text })));
    return line;
  }));
  if (link) head.append(Object.assign(document.createElement("a"), { href: link, textContent: "open it" }));
  told.replaceChildren(head, list);
  const picture = document.querySelector(`#design-${row.number} svg`);
  if (picture) told.prepend(picture.cloneNode(true));
  mark();
}

function open(row) {
  const card = document.getElementById(`design-${row.number}`);
  if (card) card.scrollIntoView({ behavior: "smooth" });
}

const form = document.forms[0];
for (const select of [form.x, form.y, form.colour, form.size]) for (const k of usable) select.append(new Option(label(k), k));
const goals = data.goals.filter((k) => usable.includes(k));
const start = [...goals, ...usable.filter((k) => k >= data.varied && !goals.includes(k)), ...usable.filter((k) => !goals.includes(k))];
if (usable.length) {
  form.x.value = start[0];
  form.y.value = start[1] ?? start[0];
  if (goals.length > 2) form.colour.value = goals[2];
  form.addEventListener("change", scatter);
  scatter();
  parallel();
}
form.csv.addEventListener("click", () => {
  const lines = [["number", "front", ...data.names], ...rows.filter(inside).map((row) => [row.number, Number(row.front), ...row.values.map((v) => v ?? "")])];
  const a = document.createElement("a");
  a.href = "data:text/csv;charset=utf-8," + encodeURIComponent(lines.map((line) => line.map((cell) => (/[",\n]/.test(cell) ? `"${String(cell).replaceAll('"', '""')}"` : cell)).join(",")).join("\n"));
  a.download = "designs.csv";
  a.click();
});
