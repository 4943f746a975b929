// A panel: one mesh, its camera, and what lies under the pointer.

// Pixels around the pointer in which a thin part still counts as hit, and that a finger may slip in a tap.
const REACH = 9, SLIP = 7;
// Shape of the canvas, and the share of it that an object fills at the start.
const ASPECT = 4 / 3, FILL = 0.82;
// A surface that is this much nearer to the eye, as a share of the object's radius, hides a vertex.
const BEHIND = 0.06;
// Steps of the keys: radians, pixels and a factor. Radians of a dragged pixel.
const KEY_TURN = 0.1, KEY_MOVE = 30, KEY_ZOOM = 1.15, DRAG_TURN = 0.008;
const ARROWS = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
const NO_WEBGL = "This browser does not offer WebGL 2, which the three-dimensional view needs. Turn on hardware acceleration, or open this page in another browser.";

class Panel {
  // `data` as in the page, with positions, faces and the colours of each layer decoded.
  constructor(painter, data) {
    this.painter = painter;
    this.name = data.name;
    this.positions = data.positions;
    this.faces = data.faces;
    this.layers = data.layers;
    // What stands or moves beside the mesh: hands, or an arm.
    this.hands = data.hands;
    // The place on the first object that each vertex is matched to: its own, until panels are linked.
    this.matched = data.positions;
    this.n = this.positions.length / 3;
    this.colors = this.layers[0].colors;
    this.spot = [0, 0, 0, 0];
    // Rows: right, away from the eye and up at the start; and where the eye stands then.
    [this.right, this.away, this.up] = [0, 3, 6].map(i => data.upright.slice(i, i + 3));
    this.home = { yaw: data.yaw, pitch: data.pitch, zoom: 1, shift: [0, 0] };
    // What the page does when a vertex is pointed at, when none is, and when the panel was turned.
    this.hover = () => {};
    this.leave = () => {};
    this.turned = () => {};
    this.fit();
    this.build(data);
    this.reset();
    if (painter.gl) this.listen();
  }

  build({ name, note }) {
    this.stage = element("div", null, "stage");
    this.output = element("output");
    if (this.painter.gl) {
      this.canvas = element("canvas");
      this.canvas.tabIndex = 0;
      this.canvas.setAttribute("role", "application");
      this.canvas.setAttribute("aria-label", `${name}, ${note}, to be turned with the arrow keys`);
      this.hiddenPlace = element("div", element("span"), "hidden-place");
      this.hiddenPlace.hidden = true;
      this.stage.append(this.canvas, this.hiddenPlace);
    } else {
      this.stage.className = "fault";
      this.stage.textContent = NO_WEBGL;
    }
    const caption = element("figcaption", [element("b", name), element("span", note), this.output]);
    this.figure = element("figure", [this.stage, caption]);
    this.write("");
  }

  // Writes a line below the object.
  write(text) {
    this.output.className = text ? "" : "idle";
    this.output.textContent = text || (this.painter.gl ? "Point at the object." : "");
  }

  // A vertex as text: its number, and its value in each layer.
  describe(vertex) {
    return [`vertex ${vertex}`, ...this.layers.map(layer => layer.describe(vertex))].filter(Boolean).join(", ");
  }

  // Chooses centre and scale so that the object, as seen at the start, fills most of the canvas; turned,
  // it may touch the edge.
  fit() {
    const [low, high] = boundsOf(this.positions, this.faces);
    const hands = this.hands ? this.hands.reach() : [];
    // The first hand is seen in full at the start; depth is for all of them.
    this.beside = hands[0] || [];
    for (const p of hands.flat()) for (let k = 0; k < 3; k++) {
      low[k] = Math.min(low[k], p[k]); high[k] = Math.max(high[k], p[k]);
    }
    this.centre = low.map((x, k) => (x + high[k]) / 2);
    this.radius = Math.hypot(...low.map((x, k) => (high[k] - x) / 2)) || 1;
    Object.assign(this, this.home);
    const [right, up] = this.axes();
    const [left, bottom, rightmost, top] = this.boxAlong(right, up);
    const half = Math.max((rightmost - left) / 2 / ASPECT, (top - bottom) / 2);
    this.extent = Math.max(half / FILL, 0.6 * this.radius);
    const du = (left + rightmost) / 2 - dot(right, this.centre), dv = (bottom + top) / 2 - dot(up, this.centre);
    this.centre = this.centre.map((x, k) => x + du * right[k] + dv * up[k]);
  }

  // Least and largest coordinates along two axes, of the surface and of what stands beside it.
  boxAlong(right, up) {
    const p = this.positions;
    let left = Infinity, bottom = Infinity, rightmost = -Infinity, top = -Infinity;
    const add = (x, y, z) => {
      const u = right[0] * x + right[1] * y + right[2] * z, v = up[0] * x + up[1] * y + up[2] * z;
      left = Math.min(left, u); rightmost = Math.max(rightmost, u);
      bottom = Math.min(bottom, v); top = Math.max(top, v);
    };
    for (const vertex of this.faces) add(p[3 * vertex], p[3 * vertex + 1], p[3 * vertex + 2]);
    for (const point of this.beside) add(...point);
    return [left, bottom, rightmost, top];
  }

  reset() {
    Object.assign(this, this.home, { shift: [...this.home.shift] });
    this.moved();
  }

  moved() {
    this.ids = null;
    this.pointAt(-1);
    this.draw();
  }

  position(vertex) { return this.positions.subarray(3 * vertex, 3 * vertex + 3); }

  show(layer) {
    this.colors = this.layers[layer].colors;
    if (this.loaded) this.painter.recolor(this.loaded, this.colors);
    this.draw();
  }

  // Highlights what is matched to places within the radius of a point; without a point, nothing.
  highlight(centre, radius) {
    this.spot = centre ? [...centre, radius] : [0, 0, 0, 0];
    this.draw();
  }

  // Shows where a vertex lies that the object hides, or the edge of the picture does; −1: nowhere.
  pointAt(vertex) {
    if (!this.hiddenPlace) return;
    const why = vertex < 0 ? "" : this.whyUnseen(vertex);
    this.hiddenPlace.hidden = !why;
    if (!why) return;
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight];
    const [x, y] = this.placeOf(vertex), inside = (at, size) => Math.max(20, Math.min(size - 20, at));
    this.hiddenPlace.style.left = `${inside(x, width)}px`;
    this.hiddenPlace.style.top = `${inside(y, height)}px`;
    this.hiddenPlace.classList.toggle("low", y > height - 60);
    this.hiddenPlace.firstChild.textContent = why;
  }

  // Where a vertex is on the canvas, in CSS pixels.
  placeOf(vertex) {
    const m = this.view().clip, [a, b, c] = this.position(vertex);
    const x = m[0] * a + m[4] * b + m[8] * c + m[12], y = m[1] * a + m[5] * b + m[9] * c + m[13];
    return [(1 + x) / 2 * this.canvas.clientWidth, (1 - y) / 2 * this.canvas.clientHeight];
  }

  // Why a vertex cannot be seen; nothing where it can.
  whyUnseen(vertex) {
    const [x, y] = this.placeOf(vertex), [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight];
    if (x < 0 || y < 0 || x > width || y > height) return "outside the picture";
    const before = this.pick(x, y), [, , back] = this.axes();
    if (before < 0) return "";
    const nearer = dot(back, this.position(before)) - dot(back, this.position(vertex));
    return nearer > BEHIND * this.radius ? "on the far side" : "";
  }

  // The vertex that is matched nearest to the highlighted place.
  nearestHighlighted() {
    const [x, y, z] = this.spot;
    let nearest = -1, least = Infinity;
    for (let v = 0; v < this.n; v++) {
      const squared = this.squaredDistance(v, x, y, z);
      if (squared < least) { least = squared; nearest = v; }
    }
    return nearest;
  }

  // How many vertices that are.
  nHighlighted() {
    const [x, y, z, radius] = this.spot;
    let n = 0;
    for (let v = 0; v < this.n; v++) if (this.squaredDistance(v, x, y, z) < radius * radius) n++;
    return n;
  }

  // Distance from a point to the nearest place that a vertex is matched to.
  distanceToMatched([x, y, z]) {
    let least = Infinity;
    for (let v = 0; v < this.n; v++) least = Math.min(least, this.squaredDistance(v, x, y, z));
    return Math.sqrt(least);
  }

  squaredDistance(vertex, x, y, z) {
    const m = this.matched, i = 3 * vertex;
    return (m[i] - x) ** 2 + (m[i + 1] - y) ** 2 + (m[i + 2] - z) ** 2;
  }

  // Image right, image up and towards the eye, in the mesh's frame.
  axes() {
    const [sy, cy, sp, cp] = [Math.sin(this.yaw), Math.cos(this.yaw), Math.sin(this.pitch), Math.cos(this.pitch)];
    const mix = (a, b, c) => [0, 1, 2].map(i => a * this.right[i] + b * this.away[i] + c * this.up[i]);
    return [mix(cy, sy, 0), mix(-sp * sy, sp * cy, cp), mix(cp * sy, -cp * cy, sp)];
  }

  // Clip space of a point p: scale · axes · (p − centre) + shift, orthographic.
  view() {
    const aspect = this.canvas.clientWidth / Math.max(this.canvas.clientHeight, 1), unit = this.zoom * (this.hands?.reduction ?? 1) / this.extent;
    const [sx, sy] = aspect > 1 ? [unit / aspect, unit] : [unit, unit * aspect];
    const [right, up, back] = this.axes(), depth = -0.4 / this.radius;
    const clip = [], turn = [];
    for (let i = 0; i < 3; i++) {
      clip.push(sx * right[i], sy * up[i], depth * back[i], 0);
      turn.push(right[i], up[i], back[i]);
    }
    const lift = this.hands?.lift?.() ?? [0, 0, 0], at = axis => dot(axis, lift) - dot(axis, this.centre);
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
    this.painter.draw(this.loaded, this.view(), this.canvas, width, height, this.hands ? this.itemsBeside() : []);
  }

  // What stands beside the object. Seen from below, a table is all but clear.
  itemsBeside() {
    const [, , back] = this.axes(), normal = this.hands.data.tableNormal;
    return this.hands.items().map(item => item.isTable && dot(back, normal) < 0 ? { ...item, alpha: 0.25 } : item);
  }

  // The vertex at a place of the canvas in CSS pixels, or the nearest within reach, or −1. The picture
  // of numbers is drawn once for each camera; after that a look-up is all it takes.
  pick(x, y) {
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight];
    if (this.painter.lost || width < 1 || height < 1) return -1;
    this.loaded ||= this.painter.load(this);
    const view = this.view();
    this.ids ||= this.painter.pick(this.loaded, view, width, height);
    const id = this.nearestId(Math.round(x), height - 1 - Math.round(y), width, height);
    if (!id) return -1;
    return this.nearestCorner(id - 1, 2 * x / width - 1, 1 - 2 * y / height, view.clip, width / height);
  }

  // The number nearest to a pixel of the picture of numbers, 0 where there is none within reach.
  nearestId(column, row, width, height) {
    let found = 0, least = REACH * REACH + 1;
    for (let dy = -REACH; dy <= REACH; dy++) for (let dx = -REACH; dx <= REACH; dx++) {
      const u = column + dx, v = row + dy, off = dx * dx + dy * dy;
      if (off >= least || u < 0 || v < 0 || u >= width || v >= height) continue;
      const id = this.ids[v * width + u];
      if (id) { found = id; least = off; }
    }
    return found;
  }

  // Of the triangles around a vertex, the corner that is nearest to a place in clip space.
  nearestCorner(vertex, x, y, m, aspect) {
    this.around ||= trianglesAround(this.faces, this.n);
    const { start, triangles } = this.around, p = this.positions;
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
    this.pitch = clampPitch(this.pitch + pitch);
    this.turned(this);
    this.moved();
  }

  enlarge(factor) {
    this.zoom = Math.max(0.2, Math.min(60, this.zoom * factor));
    this.turned(this);
    this.moved();
  }

  move(dx, dy) {
    this.shift[0] += 2 * dx / this.canvas.clientWidth;
    this.shift[1] -= 2 * dy / this.canvas.clientHeight;
    this.moved();
  }

  startAgain() {
    this.reset();
    this.turned(this);
  }

  listen() {
    this.listenToSize();
    this.listenToPointer();
    this.listenToWheel();
    this.listenToKeys();
  }

  listenToSize() {
    const look = seen => { this.visible = seen.some(entry => entry.isIntersecting); this.draw(); };
    new IntersectionObserver(look, { rootMargin: "200px" }).observe(this.figure);
    new ResizeObserver(() => { this.pointAt(-1); this.draw(); }).observe(this.canvas);
    // Paper shows panels that were never scrolled to.
    addEventListener("beforeprint", () => { this.visible = true; this.paint(); });
  }

  listenToPointer() {
    // Places of the pointers that are down, and pixels that the last one to go down has moved since.
    this.down = new Map();
    this.dragged = 0;
    const on = (name, answer) => this.canvas.addEventListener(name, answer);
    on("pointerdown", event => this.pointerDown(event));
    on("pointerup", event => this.pointerUp(event));
    on("pointercancel", event => this.pointerUp(event));
    on("pointermove", event => this.pointerMove(event));
    on("pointerleave", event => { if (event.pointerType === "mouse") this.pointerLeave(); });
    on("dblclick", () => this.startAgain());
  }

  // Place of an event on the canvas in CSS pixels.
  place(event) {
    const box = this.canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  pointerDown(event) {
    this.down.set(event.pointerId, this.place(event));
    this.dragged = 0;
    try { this.canvas.setPointerCapture(event.pointerId); } catch { /* a pointer that is gone already */ }
  }

  pointerUp(event) {
    const tapped = this.down.delete(event.pointerId) && this.dragged < SLIP && event.pointerType !== "mouse";
    if (tapped && event.type === "pointerup") this.point(...this.place(event));
  }

  pointerMove(event) {
    const here = this.place(event), before = this.down.get(event.pointerId);
    this.stage.classList.remove("crosshair");
    if (before) this.drag(event, before, here);
    else this.pointSoon(here);
  }

  pointerLeave() {
    cancelAnimationFrame(this.waiting);
    this.waiting = 0;
    this.leave();
  }

  // Of many moves between two frames, the last is answered.
  pointSoon(here) {
    this.pointer = here;
    this.waiting ||= requestAnimationFrame(() => { this.waiting = 0; this.point(...this.pointer); });
  }

  drag(event, before, here) {
    const [dx, dy] = [here[0] - before[0], here[1] - before[1]];
    this.dragged += Math.abs(dx) + Math.abs(dy);
    if (this.down.size === 2) this.pinch(event.pointerId, before, here);
    else if (event.shiftKey || event.buttons === 4) this.move(dx, dy);
    else this.turn(-dx * DRAG_TURN, dy * DRAG_TURN);
    this.down.set(event.pointerId, here);
  }

  // One of two fingers moves.
  pinch(pointerId, before, here) {
    const other = [...this.down].find(([id]) => id !== pointerId)[1];
    const gap = at => Math.max(1, Math.hypot(at[0] - other[0], at[1] - other[1]));
    this.enlarge(gap(here) / gap(before));
    this.move((here[0] - before[0]) / 2, (here[1] - before[1]) / 2);
  }

  listenToWheel() {
    const zoom = event => { event.preventDefault(); this.enlarge(Math.exp(-event.deltaY * 0.0012)); };
    this.canvas.addEventListener("wheel", zoom, { passive: false });
  }

  listenToKeys() {
    this.canvas.addEventListener("blur", () => this.stage.classList.remove("crosshair"));
    this.canvas.addEventListener("keydown", event => {
      if (event.ctrlKey || event.metaKey || event.altKey || !this.key(event)) return;
      event.preventDefault();
      this.stage.classList.add("crosshair");
      this.point(this.canvas.clientWidth / 2, this.canvas.clientHeight / 2);
    });
  }

  // Does what a key stands for; false where it stands for nothing.
  key({ key, shiftKey }) {
    const step = ARROWS[key];
    if (step && shiftKey) this.move(-KEY_MOVE * step[0], -KEY_MOVE * step[1]);
    else if (step) this.turn(KEY_TURN * step[0], KEY_TURN * step[1]);
    else if (key === "+" || key === "=") this.enlarge(KEY_ZOOM);
    else if (key === "-") this.enlarge(1 / KEY_ZOOM);
    else if (key === "Home" || key === "0") this.startAgain();
    else return false;
    return true;
  }
}

function dot(a, b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

// Up to a little less than straight from above or below.
function clampPitch(pitch) { return Math.max(-1.57, Math.min(1.57, pitch)); }

// An element with children (elements or text) and a class.
function element(name, content, className) {
  const made = document.createElement(name);
  if (className) made.className = className;
  made.append(...[content ?? []].flat());
  return made;
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
function trianglesAround(faces, n) {
  const start = new Uint32Array(n + 1), triangles = new Uint32Array(faces.length);
  for (let i = 0; i < faces.length; i++) start[faces[i] + 1]++;
  for (let v = 0; v < n; v++) start[v + 1] += start[v];
  const next = start.slice();
  for (let i = 0; i < faces.length; i++) triangles[next[faces[i]]++] = (i / 3) | 0;
  return { start, triangles };
}
