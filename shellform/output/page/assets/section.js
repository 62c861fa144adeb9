// A section as a drawing: where the plane of the cut meets the target, and where it meets the rods.

const PROFILE = { width: 900, most: 320, margin: 64 };

function profile(view) { // an SVG in the plane of the cut
  const [normal, level] = view.plane, axis = normal.indexOf(1), [across, up] = [0, 1, 2].filter((k) => k !== axis), svg = mark("svg", { role: "img", "aria-label": "The section" });
  const flat = (p) => [p[across], p[up]], meets = (a, b) => { // the point of a line in the plane, or null
    const [da, db] = [a[axis] - level, b[axis] - level];
    return da * db > 0 || da === db ? null : plus(a, times(da / (da - db), minus(b, a)));
  };
  const skin = floats(view.run.surface.vertices), corners = new Uint32Array(bytes(view.run.surface.triangles)), lines = [], dots = [];
  for (let t = 0; t < corners.length; t += 3) {
    const p = [0, 1, 2].map((k) => at(skin, corners[t + k])), found = [0, 1, 2].map((k) => meets(p[k], p[(k + 1) % 3])).filter(Boolean);
    if (found.length > 1) lines.push([flat(found[0]), flat(found[1])]);
  }
  const { values } = view;
  view.run.rods.forEach((rod) => rod.nodes.slice(1).forEach((b, k) => {
    const a = rod.nodes[k], found = meets(view.node(a), view.node(b));
    if (found) dots.push([flat(found), view.viridisAt(0.5 * (values[a] + values[b]) / view.scale)]);
  }));
  const { width, most, margin } = PROFILE, [low, high] = [0, 1].map((end) => [across, up].map((k) => view.run.box[end][k])), wide = Math.max(high[0] - low[0], 1e-9), tall = Math.max(high[1] - low[1], 1e-9);
  const scale = Math.min((width - 2 * margin) / wide, (most - 2 * margin) / tall), height = tall * scale + 2 * margin, left = (width - wide * scale) / 2;
  const place = ([x, y]) => [left + (x - low[0]) * scale, height - margin - (y - low[1]) * scale].map((value) => Number(value.toFixed(1)));
  svg.setAttribute("viewBox", `0 0 ${width} ${height.toFixed(0)}`);
  [low, high].forEach((corner, end) => {
    const [x, y] = place(corner), named = (value, k) => `${"xyz"[k]} ${(1e3 * (value + view.run.middle[k])).toFixed(0)}`;
    svg.append(mark("text", { x, y: height - 8, "text-anchor": end ? "end" : "start" }, named(corner[0], across)), mark("text", { x: left - 8, y: y + 4, "text-anchor": "end" }, named(corner[1], up)));
  });
  const path = lines.map(([a, b]) => `M${place(a).join(" ")}L${place(b).join(" ")}`).join("");
  if (path) svg.append(mark("path", { d: path, class: "target" }));
  for (const [where, colour] of dots) {
    const [cx, cy] = place(where);
    svg.append(mark("circle", { cx, cy, r: 3.5, fill: `rgb(${colour.map((value) => Math.round(255 * value)).join(" ")})` }));
  }
  return svg;
}

function mark(name, attributes, text) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  if (text !== undefined) made.textContent = text;
  return made;
}
