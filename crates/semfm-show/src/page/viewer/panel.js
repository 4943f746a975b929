// A panel: one mesh, its camera, and what lies under the pointer.

// Pixels around the pointer in which a thin part still counts as hit, and that a finger may slip in a tap.
const REACH = 9, SLIP = 7;
// Shape of the canvas, and the share of it that an object fills at the start.
const ASPECT = 4 / 3, FILL = 0.82;

class Panel {
  constructor(painter, data) {
    Object.assign(this, { painter, name: data.name, positions: data.positions, faces: data.faces, keys: data.positions, paints: data.paints });
    this.n = this.positions.length / 3;
    this.colors = this.paints[0].colors;
    this.spot = [0, 0, 0, 0];
    // Rows: right, away from the eye and up at the start; and where the eye stands then.
    [this.right, this.away, this.up] = [0, 3, 6].map(i => data.upright.slice(i, i + 3));
    this.home = { yaw: data.yaw, pitch: data.pitch, zoom: 1, shift: [0, 0] };
    this.measure();
    this.build(data);
    this.hover = () => {}; this.leave = () => {}; this.turned = () => {};
    this.reset();
    if (!painter.gl) return;
    this.listen();
    new IntersectionObserver(seen => { this.visible = seen.some(entry => entry.isIntersecting); this.draw(); },
      { rootMargin: "200px" }).observe(this.figure);
    new ResizeObserver(() => this.draw()).observe(this.canvas);
  }

  build(data) {
    const make = name => document.createElement(name);
    this.figure = make("figure");
    const stage = this.stage = make("div"), caption = make("figcaption"), name = make("b"), note = make("span");
    stage.className = "stage";
    this.told = make("output");
    name.textContent = data.name; note.textContent = data.note;
    caption.append(name, note, this.told);
    if (this.painter.gl) {
      this.canvas = make("canvas");
      this.canvas.tabIndex = 0;
      this.canvas.setAttribute("role", "application");
      this.canvas.setAttribute("aria-label", `${data.name}, ${data.note}, to be turned with the arrow keys`);
      stage.append(this.canvas);
    } else {
      stage.className = "fault";
      stage.textContent = "This browser does not offer WebGL 2, which the three-dimensional view needs. Turn on hardware acceleration, or open this page in another browser.";
    }
    this.figure.append(stage, caption);
    this.say("");
  }

  say(text) {
    this.told.className = text ? "" : "idle";
    this.told.textContent = text || (this.painter.gl ? "Point at the object." : "");
  }

  measure() {
    const p = this.positions, [low, high] = boundsOf(p, this.faces);
    this.centre = low.map((x, k) => (x + high[k]) / 2);
    this.radius = Math.hypot(...low.map((x, k) => (high[k] - x) / 2)) || 1;
    // As seen at the start, the object fills most of the canvas; turned, it may touch the edge.
    Object.assign(this, this.home);
    const [right, up] = this.axes(), box = [Infinity, -Infinity, Infinity, -Infinity];
    for (const vertex of this.faces) {
      const i = 3 * vertex, u = right[0] * p[i] + right[1] * p[i + 1] + right[2] * p[i + 2], v = up[0] * p[i] + up[1] * p[i + 1] + up[2] * p[i + 2];
      box[0] = Math.min(box[0], u); box[1] = Math.max(box[1], u);
      box[2] = Math.min(box[2], v); box[3] = Math.max(box[3], v);
    }
    const half = Math.max((box[1] - box[0]) / 2 / ASPECT, (box[3] - box[2]) / 2);
    this.reach = Math.max(half / FILL, 0.6 * this.radius);
    const along = axis => axis[0] * this.centre[0] + axis[1] * this.centre[1] + axis[2] * this.centre[2];
    const [du, dv] = [(box[0] + box[1]) / 2 - along(right), (box[2] + box[3]) / 2 - along(up)];
    this.centre = this.centre.map((x, k) => x + du * right[k] + dv * up[k]);
  }

  reset() { Object.assign(this, this.home, { shift: [...this.home.shift] }); this.moved(); }

  moved() { this.ids = null; this.draw(); }

  position(vertex) { return this.positions.subarray(3 * vertex, 3 * vertex + 3); }

  show(layer) {
    this.colors = this.paints[layer].colors;
    if (this.loaded) this.painter.recolor(this.loaded, this.colors);
    this.draw();
  }

  // Lights what has its key within the radius of a point.
  light(centre, radius) { this.spot = centre ? [...centre, radius] : [0, 0, 0, 0]; this.draw(); }

  // How many vertices that are.
  nLit() {
    const [x, y, z, r] = this.spot, k = this.keys;
    let n = 0;
    for (let i = 0; i < k.length; i += 3) if ((k[i] - x) ** 2 + (k[i + 1] - y) ** 2 + (k[i + 2] - z) ** 2 < r * r) n++;
    return n;
  }

  // Distance of the nearest key to a point.
  nearestKey([x, y, z]) {
    const k = this.keys;
    let least = Infinity;
    for (let i = 0; i < k.length; i += 3) least = Math.min(least, (k[i] - x) ** 2 + (k[i + 1] - y) ** 2 + (k[i + 2] - z) ** 2);
    return Math.sqrt(least);
  }

  // Image right, image up and towards the eye, in the mesh's frame.
  axes() {
    const [sy, cy, sp, cp] = [Math.sin(this.yaw), Math.cos(this.yaw), Math.sin(this.pitch), Math.cos(this.pitch)];
    const mix = (a, b, c) => [0, 1, 2].map(i => a * this.right[i] + b * this.away[i] + c * this.up[i]);
    return [mix(cy, sy, 0), mix(-sp * sy, sp * cy, cp), mix(cp * sy, -cp * cy, sp)];
  }

  // Clip space of a point p: scale · axes · (p − centre) + shift, orthographic.
  view() {
    const aspect = this.canvas.clientWidth / Math.max(this.canvas.clientHeight, 1), unit = this.zoom / this.reach;
    const [sx, sy] = aspect > 1 ? [unit / aspect, unit] : [unit, unit * aspect];
    const [right, up, back] = this.axes(), depth = -0.4 / this.radius;
    const at = row => -(row[0] * this.centre[0] + row[1] * this.centre[1] + row[2] * this.centre[2]);
    const clip = [], turn = [];
    for (let i = 0; i < 3; i++) {
      clip.push(sx * right[i], sy * up[i], depth * back[i], 0);
      turn.push(right[i], up[i], back[i]);
    }
    clip.push(sx * at(right) + this.shift[0], sy * at(up) + this.shift[1], depth * at(back), 1);
    return { clip, turn, spot: this.spot };
  }

  // In the next frame, once, where it can be seen.
  draw() {
    if (this.pending || !this.visible) return;
    this.pending = true;
    requestAnimationFrame(() => { this.pending = false; this.paint(); });
  }

  paint() {
    if (this.painter.lost) return;
    this.loaded ||= this.painter.load(this);
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight].map(x => Math.max(1, Math.round(x * ratio)));
    if (this.canvas.width !== width || this.canvas.height !== height) {
      [this.canvas.width, this.canvas.height] = [width, height];
      this.ids = null;
    }
    this.painter.draw(this.loaded, this.view(), this.canvas, width, height);
  }

  // The vertex at a place of the canvas in CSS pixels, or the nearest within reach, or −1. The picture
  // of numbers is drawn once for each camera; after that a look-up is all it takes.
  pick(x, y) {
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight];
    if (this.painter.lost || width < 1 || height < 1) return -1;
    this.loaded ||= this.painter.load(this);
    const view = this.view();
    this.ids ||= this.painter.pick(this.loaded, view, width, height);
    let found = 0, least = Infinity;
    for (let dy = -REACH; dy <= REACH; dy++) for (let dx = -REACH; dx <= REACH; dx++) {
      const [u, v] = [Math.round(x) + dx, height - 1 - Math.round(y) + dy], off = dx * dx + dy * dy;
      if (off >= least || off > REACH * REACH || u < 0 || v < 0 || u >= width || v >= height) continue;
      const id = this.ids[v * width + u];
      if (id) { found = id; least = off; }
    }
    return found ? this.nearest(found - 1, 2 * x / width - 1, 1 - 2 * y / height, view.clip, width / height) : -1;
  }

  // Of the triangles around a vertex, the corner that is nearest to a place on the screen.
  nearest(vertex, x, y, m, aspect) {
    this.fans ||= fans(this.faces, this.n);
    const { start, triangles } = this.fans, p = this.positions;
    let best = vertex, least = Infinity;
    for (let i = start[vertex]; i < start[vertex + 1]; i++) for (let k = 0; k < 3; k++) {
      const v = this.faces[3 * triangles[i] + k], [a, b, c] = [p[3 * v], p[3 * v + 1], p[3 * v + 2]];
      const du = (m[0] * a + m[4] * b + m[8] * c + m[12] - x) * aspect, dv = m[1] * a + m[5] * b + m[9] * c + m[13] - y;
      if (du * du + dv * dv < least) { least = du * du + dv * dv; best = v; }
    }
    return best;
  }

  point(x, y) {
    const vertex = this.pick(x, y);
    if (vertex < 0) this.leave(); else this.hover(vertex);
  }

  turn(yaw, pitch) {
    this.yaw += yaw;
    this.pitch = Math.max(-1.57, Math.min(1.57, this.pitch + pitch));
    this.turned(this); this.moved();
  }

  enlarge(factor) {
    this.zoom = Math.max(0.2, Math.min(60, this.zoom * factor));
    this.turned(this); this.moved();
  }

  move(dx, dy) {
    this.shift[0] += 2 * dx / this.canvas.clientWidth;
    this.shift[1] -= 2 * dy / this.canvas.clientHeight;
    this.moved();
  }

  listen() {
    const canvas = this.canvas, down = new Map();
    let path = 0;
    const local = event => { const box = canvas.getBoundingClientRect(); return [event.clientX - box.left, event.clientY - box.top]; };
    canvas.addEventListener("pointerdown", event => {
      down.set(event.pointerId, local(event));
      path = 0;
      try { canvas.setPointerCapture(event.pointerId); } catch { /* a pointer that is gone already */ }
    });
    const up = event => {
      const tapped = down.delete(event.pointerId) && path < SLIP && event.pointerType !== "mouse";
      if (tapped && event.type === "pointerup") this.point(...local(event));
    };
    canvas.addEventListener("pointerup", up);
    canvas.addEventListener("pointercancel", up);
    canvas.addEventListener("pointermove", event => {
      const here = local(event), before = down.get(event.pointerId);
      this.stage.classList.remove("keys");
      if (!before) {
        // Of many moves between two frames, the last is answered.
        this.waiting ||= requestAnimationFrame(() => { this.waiting = 0; this.point(...this.pointer); });
        this.pointer = here;
        return;
      }
      const [dx, dy] = [here[0] - before[0], here[1] - before[1]];
      path += Math.abs(dx) + Math.abs(dy);
      if (down.size === 2) {
        const other = [...down].find(([id]) => id !== event.pointerId)[1];
        const gap = at => Math.max(1, Math.hypot(at[0] - other[0], at[1] - other[1]));
        this.enlarge(gap(here) / gap(before));
        this.move(dx / 2, dy / 2);
      } else if (event.shiftKey || event.buttons === 4) this.move(dx, dy);
      else this.turn(-dx * 0.008, dy * 0.008);
      down.set(event.pointerId, here);
    });
    canvas.addEventListener("pointerleave", event => {
      if (event.pointerType === "mouse") { cancelAnimationFrame(this.waiting); this.waiting = 0; this.leave(); }
    });
    canvas.addEventListener("wheel", event => { event.preventDefault(); this.enlarge(Math.exp(-event.deltaY * 0.0012)); }, { passive: false });
    canvas.addEventListener("dblclick", () => { this.reset(); this.turned(this); });
    canvas.addEventListener("blur", () => this.stage.classList.remove("keys"));
    canvas.addEventListener("keydown", event => {
      const step = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      if (step && event.shiftKey) this.move(-30 * step[0], -30 * step[1]);
      else if (step) this.turn(0.1 * step[0], 0.1 * step[1]);
      else if (event.key === "+" || event.key === "=") this.enlarge(1.15);
      else if (event.key === "-") this.enlarge(1 / 1.15);
      else if (event.key === "Home" || event.key === "0") { this.reset(); this.turned(this); }
      else return;
      event.preventDefault();
      this.stage.classList.add("keys");
      this.point(canvas.clientWidth / 2, canvas.clientHeight / 2);
    });
  }
}

// Corners of the box around the surface: vertices of no triangle, wherever they lie, do not count.
function boundsOf(p, faces) {
  const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  for (const v of faces) for (let k = 0; k < 3; k++) {
    const x = p[3 * v + k];
    if (x < low[k]) low[k] = x;
    if (x > high[k]) high[k] = x;
  }
  return [low, high];
}

// Triangles around each vertex: those of v are triangles[start[v] .. start[v + 1]].
function fans(faces, n) {
  const start = new Uint32Array(n + 1), triangles = new Uint32Array(faces.length);
  for (let i = 0; i < faces.length; i++) start[faces[i] + 1]++;
  for (let v = 0; v < n; v++) start[v + 1] += start[v];
  const next = start.slice();
  for (let i = 0; i < faces.length; i++) triangles[next[faces[i]]++] = (i / 3) | 0;
  return { start, triangles };
}
