"use strict";
// What is drawn: tapered cylinders (rods, cables, cones, arrows), thousands in one call, and one translucent surface, in WebGL 2.

const SIDES = 10;
const STRIDE = 16; // floats a cylinder: a xyz, radius, b xyz, radius, colour at a, colour at b, least radius in pixels, flat colour

const LIGHT = `
  uniform float rim; // light along the edges, by which dark rods are seen on a dark page
  vec3 lit(vec3 colour, vec3 normal, vec3 toEye) { // from the eye and a little from above, so that colours stay those of the legend
    float facing = abs(dot(normal, toEye));
    return colour * (0.62 + 0.30 * facing + 0.08 * normal.z) + 0.10 * pow(facing, 24.0) + rim * pow(1.0 - facing, 1.5);
  }`;

const TUBE_VERTEX = `#version 300 es
  layout(location = 0) in vec4 corner; // cosine, sine, which end, cap
  layout(location = 1) in vec4 a;
  layout(location = 2) in vec4 b;
  layout(location = 3) in vec3 colourA;
  layout(location = 4) in vec3 colourB;
  layout(location = 5) in vec2 extra;
  uniform mat4 project;
  uniform float pixel; // width of a pixel at distance 1
  out vec3 colour, normal, place;
  out float plain;
  void main() {
    vec3 axis = b.xyz - a.xyz;
    float length_ = length(axis);
    axis = length_ > 0.0 ? axis / length_ : vec3(0.0, 0.0, 1.0);
    vec3 across = normalize(cross(axis, abs(axis.z) < 0.9 ? vec3(0.0, 0.0, 1.0) : vec3(1.0, 0.0, 0.0)));
    vec3 round = across * corner.x + cross(axis, across) * corner.y;
    vec4 end = corner.z < 0.5 ? a : b;
    float far = (project * vec4(end.xyz, 1.0)).w;
    float radius = end.w > 0.0 ? max(end.w, extra.x * pixel * far) : 0.0;
    place = end.xyz + round * radius * (corner.w == 0.0 || corner.x * corner.x + corner.y * corner.y > 0.0 ? 1.0 : 0.0);
    normal = corner.w == 0.0 ? normalize(round * length_ + axis * (a.w - b.w)) : axis * corner.w;
    colour = corner.z < 0.5 ? colourA : colourB;
    plain = extra.y;
    gl_Position = project * vec4(place, 1.0);
  }`;

const TUBE_FRAGMENT = `#version 300 es
  precision highp float;
  in vec3 colour, normal, place;
  in float plain;
  uniform vec3 eye;
  uniform vec4 cut;
  out vec4 result;
  ${LIGHT}
  void main() {
    if (dot(place, cut.xyz) > cut.w) discard;
    result = vec4(mix(lit(colour, normalize(normal), normalize(eye - place)), colour, plain), 1.0);
  }`;

const SKIN_VERTEX = `#version 300 es
  layout(location = 0) in vec3 place_;
  layout(location = 1) in vec3 normal_;
  uniform mat4 project;
  out vec3 normal, place;
  void main() { normal = normal_; place = place_; gl_Position = project * vec4(place_, 1.0); }`;

const SKIN_FRAGMENT = `#version 300 es
  precision highp float;
  in vec3 normal, place;
  uniform vec3 eye, colour;
  uniform vec4 cut;
  out vec4 result;
  void main() { // denser where it is seen from the side, as glass is
    if (dot(place, cut.xyz) > cut.w) discard;
    float facing = abs(dot(normalize(normal), normalize(eye - place)));
    result = vec4(colour, 0.18 + 0.42 * pow(1.0 - facing, 2.0));
  }`;

class Solid {
  constructor(canvas) {
    const gl = canvas.getContext("webgl2", { alpha: false, antialias: true, preserveDrawingBuffer: true });
    if (!gl) throw new Error("this browser has no WebGL 2");
    this.gl = gl;
    this.tube = program(gl, TUBE_VERTEX, TUBE_FRAGMENT, ["project", "pixel", "eye", "rim", "cut"]);
    this.skin = program(gl, SKIN_VERTEX, SKIN_FRAGMENT, ["project", "eye", "colour", "cut"]);
    const { corners, triangles } = cylinder();
    this.corners = triangles.length;
    this.tubes = gl.createVertexArray();
    gl.bindVertexArray(this.tubes);
    fill(gl, gl.ARRAY_BUFFER, new Float32Array(corners));
    attribute(gl, 0, 4, 4, 0, 0);
    fill(gl, gl.ELEMENT_ARRAY_BUFFER, new Uint16Array(triangles));
    this.instances = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, this.instances);
    [[1, 4, 0], [2, 4, 4], [3, 3, 8], [4, 3, 11], [5, 2, 14]].forEach(([where, size, at]) => attribute(gl, where, size, STRIDE, at, 1));
    this.count = 0;
    this.skins = gl.createVertexArray();
    this.skinCount = 0;
  }

  setTubes(rows) { // rows of STRIDE floats
    const gl = this.gl;
    gl.bindBuffer(gl.ARRAY_BUFFER, this.instances);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(rows), gl.DYNAMIC_DRAW);
    this.count = rows.length / STRIDE;
  }

  setSkin(vertices, triangles) { // Float32Array xyz, Uint32Array
    const gl = this.gl, normals = new Float32Array(vertices.length);
    for (let t = 0; t < triangles.length; t += 3) {
      const [p, q, r] = [0, 1, 2].map((k) => at(vertices, triangles[t + k]));
      const n = cross(minus(q, p), minus(r, p));
      for (let k = 0; k < 3; k++) for (let i = 0; i < 3; i++) normals[3 * triangles[t + k] + i] += n[i];
    }
    gl.bindVertexArray(this.skins);
    fill(gl, gl.ARRAY_BUFFER, vertices);
    attribute(gl, 0, 3, 3, 0, 0);
    fill(gl, gl.ARRAY_BUFFER, normals);
    attribute(gl, 1, 3, 3, 0, 0);
    fill(gl, gl.ELEMENT_ARRAY_BUFFER, triangles);
    this.skinCount = triangles.length;
  }

  draw(camera, { background, skin, rim, cut }) { // colours as [r, g, b] up to 1; skin null: no surface; what lies beyond dot(p, cut.xyz) = cut.w isn't drawn
    const gl = this.gl;
    gl.viewport(0, 0, gl.drawingBufferWidth, gl.drawingBufferHeight);
    gl.clearColor(...background, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.useProgram(this.tube.program);
    gl.uniformMatrix4fv(this.tube.project, false, camera.matrix);
    gl.uniform1f(this.tube.pixel, camera.pixel);
    gl.uniform1f(this.tube.rim, rim);
    gl.uniform3fv(this.tube.eye, camera.eye);
    gl.uniform4fv(this.tube.cut, cut);
    gl.bindVertexArray(this.tubes);
    gl.drawElementsInstanced(gl.TRIANGLES, this.corners, gl.UNSIGNED_SHORT, 0, this.count);
    if (!skin || !this.skinCount) return;
    gl.useProgram(this.skin.program);
    gl.uniformMatrix4fv(this.skin.project, false, camera.matrix);
    gl.uniform3fv(this.skin.eye, camera.eye);
    gl.uniform4fv(this.skin.cut, cut);
    gl.uniform3fv(this.skin.colour, skin);
    gl.bindVertexArray(this.skins);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    gl.depthMask(false);
    gl.drawElements(gl.TRIANGLES, this.skinCount, gl.UNSIGNED_INT, 0);
    gl.depthMask(true);
    gl.disable(gl.BLEND);
  }

  release() { // browsers keep few contexts alive
    const lose = this.gl.getExtension("WEBGL_lose_context");
    if (lose) lose.loseContext();
  }
}

function cylinder() { // of radius 1 from end 0 to end 1, with both caps: rows of cosine, sine, end, cap (0 side, -1, 1)
  const corners = [], triangles = [];
  for (let k = 0; k < SIDES; k++) {
    const turn = (2 * Math.PI * k) / SIDES, next = (k + 1) % SIDES;
    for (const [end, cap] of [[0, 0], [1, 0], [0, -1], [1, 1]]) corners.push(Math.cos(turn), Math.sin(turn), end, cap);
    triangles.push(4 * k, 4 * next, 4 * k + 1, 4 * k + 1, 4 * next, 4 * next + 1);
    triangles.push(4 * SIDES, 4 * next + 2, 4 * k + 2, 4 * SIDES + 1, 4 * k + 3, 4 * next + 3);
  }
  corners.push(0, 0, 0, -1, 0, 0, 1, 1);
  return { corners, triangles };
}

function program(gl, vertex, fragment, uniforms) {
  const made = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(made, shader);
  }
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(made));
  return { program: made, ...Object.fromEntries(uniforms.map((name) => [name, gl.getUniformLocation(made, name)])) };
}

function fill(gl, kind, data) {
  gl.bindBuffer(kind, gl.createBuffer());
  gl.bufferData(kind, data, gl.STATIC_DRAW);
}

function attribute(gl, where, size, stride, offset, divisor) {
  gl.enableVertexAttribArray(where);
  gl.vertexAttribPointer(where, size, gl.FLOAT, false, 4 * stride, 4 * offset);
  gl.vertexAttribDivisor(where, divisor);
}

// Vectors of three numbers.
const at = (values, k) => [values[3 * k], values[3 * k + 1], values[3 * k + 2]];
const plus = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const times = (s, a) => [s * a[0], s * a[1], s * a[2]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const norm = (a) => Math.hypot(...a);
const mix = (a, b, share) => a.map((value, k) => value + share * (b[k] - value));

class Camera { // looks at `centre` from `distance` m in the direction of yaw and pitch, z upwards
  static SPREAD = Math.tan((14 * Math.PI) / 180); // half the height of the picture at distance 1

  constructor() {
    this.centre = [0, 0, 0];
    this.turn("iso");
    this.distance = 1;
  }

  turn(view) {
    const angles = { iso: [-58, 30], top: [-90, 89.99], front: [-90, 0], side: [0, 0] };
    [this.yaw, this.pitch] = angles[view].map((degrees) => (degrees * Math.PI) / 180);
  }

  axes() {
    const away = [Math.cos(this.pitch) * Math.cos(this.yaw), Math.cos(this.pitch) * Math.sin(this.yaw), Math.sin(this.pitch)];
    const right = [-Math.sin(this.yaw), Math.cos(this.yaw), 0];
    return { away, right, up: cross(away, right) };
  }

  fit(points, aspect) { // the least distance at which all points (flat array) are in view, with a margin
    const { away, right, up } = this.axes();
    this.centre = [0, 0, 0];
    let [left, most, low, high] = [Infinity, -Infinity, Infinity, -Infinity];
    for (let k = 0; k < points.length / 3; k++) {
      const p = at(points, k);
      [left, most] = [Math.min(left, dot(right, p)), Math.max(most, dot(right, p))];
      [low, high] = [Math.min(low, dot(up, p)), Math.max(high, dot(up, p))];
    }
    this.centre = plus(times((left + most) / 2, right), times((low + high) / 2, up));
    const spread = 0.92 * Camera.SPREAD;
    this.distance = 0;
    for (let k = 0; k < points.length / 3; k++) {
      const p = minus(at(points, k), this.centre);
      const beside = Math.max(Math.abs(dot(right, p)) / (spread * aspect), Math.abs(dot(up, p)) / spread);
      this.distance = Math.max(this.distance, dot(away, p) + beside);
    }
    this.reach = this.distance;
  }

  place(width, height) { // what the shaders and the picking need
    const { away, right, up } = this.axes(), aspect = width / height, spread = Camera.SPREAD;
    const eye = plus(this.centre, times(this.distance, away));
    const near = 0.02 * this.distance, far = this.distance + 3 * (this.reach || 1);
    const deep = (far + near) / (far - near), shift = (-2 * far * near) / (far - near);
    const rows = [times(1 / (spread * aspect), right), times(1 / spread, up), times(-deep, away), times(-1, away)];
    const offset = rows.map((row) => -dot(row, eye));
    offset[2] += shift;
    const matrix = new Float32Array(16);
    rows.forEach((row, i) => [...row, offset[i]].forEach((value, j) => (matrix[4 * j + i] = value)));
    this.matrix = matrix;
    this.eye = eye;
    this.pixel = (2 * spread) / height;
    this.size = [width, height];
  }

  onScreen(p) { // pixels from the upper left corner, and the distance from the eye
    const m = this.matrix, [x, y, , w] = [0, 1, 2, 3].map((i) => m[i] * p[0] + m[4 + i] * p[1] + m[8 + i] * p[2] + m[12 + i]);
    return [(0.5 + (0.5 * x) / w) * this.size[0], (0.5 - (0.5 * y) / w) * this.size[1], w];
  }

  move(dx, dy) { // by pixels
    const { right, up } = this.axes(), scale = this.pixel * this.distance;
    this.centre = plus(this.centre, plus(times(-dx * scale, right), times(dy * scale, up)));
  }

  rotate(dx, dy) { // radians
    this.yaw -= dx;
    this.pitch = Math.max(-1.5706, Math.min(1.5706, this.pitch + dy));
  }

  zoom(factor) {
    this.distance = Math.max(0.02 * this.reach, Math.min(6 * this.reach, this.distance * factor));
  }
}
