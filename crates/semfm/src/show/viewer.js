"use strict";
// The page's viewer: every group of panels shows meshes side by side, in one of several layers of
// colour. Data: {groups: [{title, facts, layers: [name], panels: [{name, note, positions, faces,
// colors: {layer: base64}}], sourceOf: base64 | null}]}; arrays are base64 of little-endian
// float32 (positions), uint32 (faces, sourceOf) and uint8 (colours, three a vertex).

const VERTEX = `#version 300 es
in vec3 position; in vec3 normal; in vec3 color; in float mark;
uniform mat4 clip; uniform mat3 turn;
out vec3 shade; out vec3 tilt; out float lit;
void main() { gl_Position = clip * vec4(position, 1.0); shade = color; tilt = turn * normal; lit = mark; }`;
const FRAGMENT = `#version 300 es
precision highp float;
in vec3 shade; in vec3 tilt; in float lit; out vec4 color;
void main() {
  vec3 n = normalize(tilt);
  float light = 0.38 + 0.62 * abs(dot(n, normalize(vec3(0.25, 0.35, 0.9))));
  vec3 base = mix(shade, vec3(1.0, 0.82, 0.05), clamp(lit, 0.0, 1.0));
  color = vec4(base * light, 1.0);
}`;

function bytes(text) {
  const raw = atob(text), out = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) out[i] = raw.charCodeAt(i);
  return out;
}

function smoothNormals(positions, faces) {
  const normals = new Float32Array(positions.length);
  for (let t = 0; t < faces.length; t += 3) {
    const [a, b, c] = [3 * faces[t], 3 * faces[t + 1], 3 * faces[t + 2]];
    const u = [0, 1, 2].map(i => positions[b + i] - positions[a + i]);
    const v = [0, 1, 2].map(i => positions[c + i] - positions[a + i]);
    const n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    for (const corner of [a, b, c]) for (let i = 0; i < 3; i++) normals[corner + i] += n[i];
  }
  for (let i = 0; i < normals.length; i += 3) {
    const length = Math.hypot(normals[i], normals[i + 1], normals[i + 2]) || 1;
    for (let k = 0; k < 3; k++) normals[i + k] /= length;
  }
  return normals;
}

class Panel {
  constructor(data, layers) {
    this.positions = new Float32Array(bytes(data.positions).buffer);
    this.faces = new Uint32Array(bytes(data.faces).buffer);
    this.colors = layers.map(layer => bytes(data.colors[layer]));
    this.n = this.positions.length / 3;
    this.marks = new Float32Array(this.n);
    this.figure = document.createElement("figure");
    this.canvas = document.createElement("canvas");
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", data.name + ": " + data.note);
    const caption = document.createElement("figcaption");
    const name = document.createElement("b"), note = document.createElement("span");
    name.textContent = data.name; note.textContent = data.note;
    caption.append(name, note);
    this.figure.append(this.canvas, caption);
    this.measure();
    this.reset();
    this.listen();
    this.hover = null; this.leave = null;
    this.layer = 0;
    // Browsers allow a dozen or so drawing contexts: one is made when the panel comes into view.
    new IntersectionObserver(seen => { if (seen.some(e => e.isIntersecting)) { this.open(); this.draw(); } },
      { rootMargin: "200px" }).observe(this.figure);
    new ResizeObserver(() => this.draw()).observe(this.canvas);
  }

  measure() {
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    for (let i = 0; i < this.positions.length; i++) {
      low[i % 3] = Math.min(low[i % 3], this.positions[i]);
      high[i % 3] = Math.max(high[i % 3], this.positions[i]);
    }
    this.centre = low.map((x, i) => (x + high[i]) / 2);
    this.radius = Math.hypot(...low.map((x, i) => (high[i] - x) / 2)) || 1;
  }

  reset() { this.yaw = 0.7; this.pitch = 0.45; this.zoom = 1; this.shift = [0, 0]; }

  open() {
    if (this.gl) return;
    const gl = this.canvas.getContext("webgl2", { antialias: true });
    if (!gl) { this.figure.replaceChildren("This browser cannot draw WebGL 2."); return; }
    const program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text); gl.compileShader(shader); gl.attachShader(program, shader);
    }
    gl.linkProgram(program); gl.useProgram(program);
    const attribute = (name, array, size, type, normalised, usage) => {
      const buffer = gl.createBuffer(), place = gl.getAttribLocation(program, name);
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.bufferData(gl.ARRAY_BUFFER, array, usage || gl.STATIC_DRAW);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, size, type, normalised, 0, 0);
      return buffer;
    };
    attribute("position", this.positions, 3, gl.FLOAT, false);
    attribute("normal", smoothNormals(this.positions, this.faces), 3, gl.FLOAT, false);
    this.colorBuffer = attribute("color", this.colors[this.layer], 3, gl.UNSIGNED_BYTE, true, gl.DYNAMIC_DRAW);
    this.markBuffer = attribute("mark", this.marks, 1, gl.FLOAT, false, gl.DYNAMIC_DRAW);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, this.faces, gl.STATIC_DRAW);
    gl.enable(gl.DEPTH_TEST);
    this.gl = gl;
    this.clipPlace = gl.getUniformLocation(program, "clip");
    this.turnPlace = gl.getUniformLocation(program, "turn");
  }

  show(layer) {
    this.layer = layer;
    if (!this.gl) return;
    this.gl.bindBuffer(this.gl.ARRAY_BUFFER, this.colorBuffer);
    this.gl.bufferData(this.gl.ARRAY_BUFFER, this.colors[layer], this.gl.DYNAMIC_DRAW);
    this.draw();
  }

  mark(values) {
    this.marks.set(values);
    if (!this.gl) return;
    this.gl.bindBuffer(this.gl.ARRAY_BUFFER, this.markBuffer);
    this.gl.bufferData(this.gl.ARRAY_BUFFER, this.marks, this.gl.DYNAMIC_DRAW);
    this.draw();
  }

  // Rows of the rotation: image right, image up, towards the viewer. y of the mesh is up.
  axes() {
    const [sy, cy, sp, cp] = [Math.sin(this.yaw), Math.cos(this.yaw), Math.sin(this.pitch), Math.cos(this.pitch)];
    return [[cy, 0, -sy], [-sp * sy, cp, -sp * cy], [cp * sy, sp, cp * cy]];
  }

  // Clip space of a point p: scale · axes · (p − centre) + shift, orthographic.
  scales() {
    const aspect = this.canvas.clientWidth / Math.max(this.canvas.clientHeight, 1);
    const unit = this.zoom / (1.05 * this.radius);
    return aspect > 1 ? [unit / aspect, unit] : [unit, unit * aspect];
  }

  draw() {
    const gl = this.gl;
    if (!gl || this.pending) return;
    this.pending = true;
    requestAnimationFrame(() => {
      this.pending = false;
      const ratio = Math.min(window.devicePixelRatio || 1, 2);
      this.canvas.width = Math.round(this.canvas.clientWidth * ratio);
      this.canvas.height = Math.round(this.canvas.clientHeight * ratio);
      gl.viewport(0, 0, this.canvas.width, this.canvas.height);
      gl.clearColor(1, 1, 1, 1);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      const [right, up, back] = this.axes(), [sx, sy] = this.scales(), depth = -0.5 / this.radius;
      const at = row => row.reduce((sum, x, i) => sum - x * this.centre[i], 0);
      const clip = [];
      for (let i = 0; i < 3; i++) clip.push(sx * right[i], sy * up[i], depth * back[i], 0);
      clip.push(sx * at(right) + this.shift[0], sy * at(up) + this.shift[1], depth * at(back), 1);
      gl.uniformMatrix4fv(this.clipPlace, false, clip);
      const turn = [];
      for (let i = 0; i < 3; i++) turn.push(right[i], up[i], back[i]);
      gl.uniformMatrix3fv(this.turnPlace, false, turn);
      gl.drawElements(gl.TRIANGLES, this.faces.length, gl.UNSIGNED_INT, 0);
    });
  }

  // The vertex in front nearest to the pointer, or −1 where there is none within a few pixels.
  pick(event) {
    const box = this.canvas.getBoundingClientRect();
    const x = 2 * (event.clientX - box.left) / box.width - 1;
    const y = 1 - 2 * (event.clientY - box.top) / box.height;
    const [right, up, back] = this.axes(), [sx, sy] = this.scales();
    const reach = 2 * 14 / box.width, stretch = box.height / box.width;
    let best = -1, front = -Infinity;
    for (let v = 0; v < this.n; v++) {
      const p = [0, 1, 2].map(i => this.positions[3 * v + i] - this.centre[i]);
      const u = sx * (right[0] * p[0] + right[1] * p[1] + right[2] * p[2]) + this.shift[0] - x;
      if (u > reach || u < -reach) continue;
      const w = (sy * (up[0] * p[0] + up[1] * p[1] + up[2] * p[2]) + this.shift[1] - y) * stretch;
      const off = Math.hypot(u, w);
      if (off > reach) continue;
      const height = (back[0] * p[0] + back[1] * p[1] + back[2] * p[2]) / this.radius - 2 * off / reach * 0.05;
      if (height > front) { front = height; best = v; }
    }
    return best;
  }

  listen() {
    let last = null;
    this.canvas.addEventListener("pointerdown", event => {
      last = [event.clientX, event.clientY];
      this.canvas.setPointerCapture(event.pointerId);
    });
    this.canvas.addEventListener("pointerup", () => { last = null; });
    this.canvas.addEventListener("pointermove", event => {
      if (!last) { if (this.hover) this.hover(this.pick(event)); return; }
      const [dx, dy] = [event.clientX - last[0], event.clientY - last[1]];
      last = [event.clientX, event.clientY];
      if (event.shiftKey || event.buttons === 4) {
        this.shift[0] += 2 * dx / this.canvas.clientWidth;
        this.shift[1] -= 2 * dy / this.canvas.clientHeight;
      } else {
        this.yaw -= dx * 0.008;
        this.pitch = Math.max(-1.57, Math.min(1.57, this.pitch + dy * 0.008));
      }
      this.draw();
    });
    this.canvas.addEventListener("pointerleave", () => { if (this.leave) this.leave(); });
    this.canvas.addEventListener("wheel", event => {
      event.preventDefault();
      this.zoom = Math.max(0.2, Math.min(40, this.zoom * Math.exp(-event.deltaY * 0.0012)));
      this.draw();
    }, { passive: false });
    this.canvas.addEventListener("dblclick", () => { this.reset(); this.draw(); });
  }

  // A smooth spot around a point, as one mark per vertex.
  spot(centre, radius) {
    const marks = new Float32Array(this.n);
    for (let v = 0; v < this.n; v++) {
      const d = Math.hypot(...[0, 1, 2].map(i => this.positions[3 * v + i] - centre[i])) / radius;
      if (d < 1) marks[v] = 1 - d * d;
    }
    return marks;
  }
}

function link(source, target, sourceOf) {
  source.leave = () => { source.mark(new Float32Array(source.n)); target.mark(new Float32Array(target.n)); };
  source.hover = vertex => {
    if (vertex < 0) return source.leave();
    const spot = source.spot(source.positions.slice(3 * vertex, 3 * vertex + 3), 0.09 * source.radius);
    source.mark(spot);
    target.mark(Float32Array.from(sourceOf, v => spot[v]));
  };
}

function group(data) {
  const section = document.createElement("section");
  const title = document.createElement("h2");
  title.textContent = data.title;
  const facts = document.createElement("ul");
  facts.className = "facts";
  for (const [name, value, kind] of data.facts) {
    const item = document.createElement("li"), strong = document.createElement("b");
    strong.textContent = value;
    if (kind) strong.className = "verdict " + kind;
    item.append(name + " ", strong);
    facts.append(item);
  }
  const panels = data.panels.map(panel => new Panel(panel, data.layers));
  const layers = document.createElement("div");
  layers.className = "layers";
  const buttons = data.layers.map((name, i) => {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = name;
    button.addEventListener("click", () => {
      buttons.forEach((other, k) => other.setAttribute("aria-pressed", String(k === i)));
      panels.forEach(panel => panel.show(i));
    });
    button.setAttribute("aria-pressed", String(i === 0));
    return button;
  });
  if (buttons.length > 1) layers.append(...buttons);
  const row = document.createElement("div");
  row.className = "panels";
  row.append(...panels.map(panel => panel.figure));
  section.append(title, facts, layers, row);
  document.getElementById("main").append(section);
  if (data.sourceOf) link(panels[0], panels[1], new Uint32Array(bytes(data.sourceOf).buffer));
  return panels;
}

const page = JSON.parse(document.getElementById("data").textContent);
window.semfmPanels = page.groups.map(group);
