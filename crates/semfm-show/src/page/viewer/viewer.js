// The page: groups of panels side by side, in one of several layers of colour. Data: {groups: [{title,
// facts, linked, layers: [{name, kind, legend: [[colour, text]]}], panels: [{name, note, n, step,
// positions, faces, paints, upright, yaw, pitch}], sourceOf, pictures: [{name, png, yaw, pitch}]}]}.
// Arrays are zlib streams in base64: of bytes (paints), or of whole numbers as `numbers` reads them.

async function inflate(text) {
  const raw = atob(text), packed = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) packed[i] = raw.charCodeAt(i);
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// Whole numbers: differences to the number before, signs folded into the last bit, in four planes of bytes.
async function numbers(text) {
  const planes = await inflate(text), n = planes.length / 4, out = new Uint32Array(n);
  let value = 0;
  for (let i = 0; i < n; i++) {
    const folded = (planes[i] | planes[n + i] << 8 | planes[2 * n + i] << 16 | planes[3 * n + i] << 24) >>> 0;
    value = (value + ((folded >>> 1) ^ -(folded & 1))) >>> 0;
    out[i] = value;
  }
  return out;
}

// Positions: whole numbers of steps, axis by axis. Here they are counted from the middle of the box, since
// 32 bits would not tell neighbours apart far from the origin.
async function positions(panel) {
  const steps = await numbers(panel.positions), out = new Float32Array(steps.length), n = panel.n;
  for (let k = 0; k < 3; k++) for (let v = 0; v < n; v++) out[3 * v + k] = panel.step[k] * (steps[k * n + v] - 2 ** 19);
  return out;
}

function hex(color) { return [1, 3, 5].map(i => parseInt(color.slice(i, i + 2), 16)); }

// Colours of positions, x, y and z over the bounding box, as in `transfer.png`.
function placeColors(p, faces) {
  const [low, high] = boundsOf(p, faces), out = new Uint8ClampedArray(p.length);
  for (let i = 0; i < p.length; i++) out[i] = Math.round(255 * (0.15 + 0.8 * (p[i] - low[i % 3]) / (high[i % 3] - low[i % 3] || 1)));
  return out;
}

// A layer of one panel: `colors` (three bytes a vertex) and `say`, which tells a vertex's number.
async function paint(layer, packed, n, places, sourceOf) {
  if (layer.kind === "places") {
    if (!sourceOf) return { colors: places, say: () => "" };
    const colors = new Uint8Array(3 * n);
    for (let v = 0; v < n; v++) for (let k = 0; k < 3; k++) colors[3 * v + k] = places[3 * sourceOf[v] + k];
    return { colors, say: () => "" };
  }
  const data = await inflate(packed);
  if (layer.kind === "colors") return { colors: data, say: () => "" };
  const colors = new Uint8Array(3 * n);
  if (layer.kind === "weights") {
    for (let v = 0; v < n; v++) for (let k = 0; k < 3; k++) colors[3 * v + k] = Math.round(layer.plain[k] + data[v] / 255 * (layer.marked[k] - layer.plain[k]));
    return { colors, say: v => `weight ${(data[v] / 255).toFixed(2)}` };
  }
  const palette = layer.legend.map(([color]) => color && hex(color));
  for (let v = 0; v < n; v++) for (let k = 0; k < 3; k++) colors[3 * v + k] = palette[data[v]][k];
  // The first class is none of the others, and goes without saying.
  return { colors, say: v => data[v] ? layer.legend[data[v]][1] : "" };
}

// Joins the first panel to the second: the place under the pointer lights its counterpart.
function link([source, target], sourceOf) {
  target.keys = new Float32Array(3 * target.n);
  for (let v = 0; v < target.n; v++) target.keys.set(source.position(sourceOf[v]), 3 * v);
  const radius = 0.09 * source.radius;
  const count = n => n === 1 ? "1 vertex" : `${n} vertices`;
  const light = (vertex, reach) => {
    source.light(vertex < 0 ? null : source.position(vertex), radius);
    target.light(vertex < 0 ? null : source.position(vertex), reach);
  };
  for (const panel of [source, target]) panel.leave = () => { light(-1); source.say(""); target.say(""); };
  source.hover = vertex => {
    source.say(source.tell(vertex));
    // A map need not reach every place of the source.
    const off = target.nearestKey(source.position(vertex));
    light(vertex, Math.max(radius, 1.4 * off));
    target.say(off < radius ? `${count(target.nLit())} matched to the place under the pointer`
      : "nothing is matched to the place under the pointer; the nearest that is lights up");
  };
  target.hover = vertex => {
    light(sourceOf[vertex], radius);
    target.say(`${target.tell(vertex)}, matched to source vertex ${sourceOf[vertex]}`);
    source.say(source.tell(sourceOf[vertex]));
  };
}

function element(name, content, className) {
  const made = document.createElement(name);
  if (className) made.className = className;
  made.append(...[content ?? []].flat());
  return made;
}

function legendOf(layer) {
  const items = layer.legend.filter(([, text]) => text).map(([color, text]) => {
    const swatch = element("i");
    if (color) swatch.style.background = color;
    return element("span", color ? [swatch, text] : [text]);
  });
  if (layer.kind === "weights") items.unshift(element("span", ["weight 0", element("i", null, "bar"), "1, counts from the mark on"]));
  return items;
}

async function group(painter, data) {
  const sourceOf = data.sourceOf && await numbers(data.sourceOf);
  const panels = [];
  let places = null;
  for (const [k, panel] of data.panels.entries()) {
    const [points, faces] = [await positions(panel), await numbers(panel.faces)];
    if (k === 0 || !sourceOf) places = placeColors(points, faces);
    const paints = await Promise.all(data.layers.map((layer, i) => paint(layer, panel.paints[i], panel.n, places, k ? sourceOf : null)));
    panels.push(new Panel(painter, { ...panel, positions: points, faces, paints }));
  }
  for (const panel of panels) {
    panel.tell = vertex => [`vertex ${vertex}`, ...panel.paints.map(paint => paint.say(vertex))].filter(Boolean).join(", ");
    panel.hover = vertex => { panel.light(panel.position(vertex), 0.03 * panel.radius); panel.say(panel.tell(vertex)); };
    panel.leave = () => { panel.light(null); panel.say(""); };
  }
  if (sourceOf) link(panels, sourceOf);

  const facts = element("ul", data.facts.map(([name, value, kind]) =>
    element("li", [name + " ", element("b", value, kind ? "verdict " + kind : "")])), "facts");
  const legend = element("div", null, "legend");
  const show = i => {
    buttons.forEach((button, k) => button.setAttribute("aria-pressed", String(k === i)));
    legend.replaceChildren(...legendOf(data.layers[i]));
    panels.forEach(panel => panel.show(i));
  };
  const buttons = data.layers.map((layer, i) => {
    const button = element("button", layer.name);
    button.type = "button";
    button.addEventListener("click", () => show(i));
    return button;
  });
  const together = element("input");
  together.type = "checkbox";
  together.checked = data.linked;
  for (const panel of panels) panel.turned = mover => {
    if (together.checked) for (const other of panels) if (other !== mover) {
      other.yaw = other.home.yaw + mover.yaw - mover.home.yaw;
      other.pitch = Math.max(-1.57, Math.min(1.57, other.home.pitch + mover.pitch - mover.home.pitch));
      other.zoom = mover.zoom;
      other.moved();
    }
  };
  const again = element("button", "start again");
  again.type = "button";
  again.addEventListener("click", () => panels.forEach(panel => panel.reset()));
  const right = element("span", [...(panels.length > 1 ? [element("label", [together, " turn together"])] : []), again], "right");
  const controls = element("div", [...(buttons.length > 1 ? buttons : []), right], "controls");
  const pictures = element("div", (data.pictures || []).map(picture => {
    const image = element("img"), button = element("button", [image, picture.name]);
    image.src = "data:image/png;base64," + picture.png;
    image.alt = "";
    button.type = "button";
    button.title = "turn the object as it was seen";
    button.addEventListener("click", () => { Object.assign(panels[0], { yaw: picture.yaw, pitch: picture.pitch }); panels[0].moved(); });
    return button;
  }), "pictures");
  const section = element("section", [element("h2", data.title), facts, controls, legend, element("div", panels.map(panel => panel.figure), "panels"), pictures]);
  document.getElementById("main").append(section);
  show(0);
  return panels;
}

function fault(text) { document.getElementById("main").append(element("section", element("p", text, "fault"))); }

window.semfmReady = (async () => {
  const painter = new Painter(), all = [];
  if (typeof DecompressionStream === "undefined") fault("This browser is too old for this page: it cannot unpack the meshes (DecompressionStream). Open it in one from 2023 or newer.");
  else for (const data of JSON.parse(document.getElementById("data").textContent).groups) all.push(await group(painter, data));
  return window.semfmPanels = all;
})().catch(error => { fault("This page is damaged: " + error.message); throw error; });
