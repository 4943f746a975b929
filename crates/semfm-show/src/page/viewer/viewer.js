// The page: groups of panels side by side, in one of several layers of colour. Data: {plain, marked,
// groups: [{title, facts: [{name, value}], notes: [text], layers: [{name, kind, legend: [{color, text}]}], panels: [{name,
// note, n, step, positions, faces, upright, yaw, pitch, colors}], sourceOf, pictures: [{name, png, yaw,
// pitch}], hands, motion}]}. Arrays are read by `decode.js`, hands by `hands.js`, motions by `motion.js`.

const VERDICTS = ["accept", "check", "refuse"];
const TOO_OLD = "This browser is too old for this page: it cannot decompress the meshes (DecompressionStream). Open it in one from 2023 or newer.";

// A layer of one panel: `colors` (three bytes a vertex) and `describe`, a vertex's value as text.
async function decodeLayer(layer, encoded, n, matchColors, { plain, marked }) {
  if (layer.kind === "positions") return { colors: matchColors, describe: () => "" };
  const data = await decodeBytes(encoded);
  if (layer.kind === "colors") return { colors: data, describe: () => "" };
  if (layer.kind === "weights") {
    const mix = v => plain.map((from, k) => Math.round(from + data[v] / 255 * (marked[k] - from)));
    return { colors: colorsOf(n, mix), describe: v => `weight ${(data[v] / 255).toFixed(2)}` };
  }
  const palette = layer.legend.map(({ color }) => color && rgb(color));
  // The first class is none of the others, and is not mentioned.
  const describe = v => data[v] ? layer.legend[data[v]].text : "";
  return { colors: colorsOf(n, v => palette[data[v]]), describe };
}

// The panels of a group. With a point map, the second takes the position colours of the first.
async function decodePanels(painter, group, sourceOf, hands, weightColors) {
  const panels = [];
  let firstColors = null;
  for (const data of group.panels) {
    const [positions, faces] = [await decodePositions(data), await decodeNumbers(data.faces)];
    const isMatched = sourceOf && firstColors;
    const matchColors = isMatched
      ? colorsOf(data.n, v => firstColors.subarray(3 * sourceOf[v], 3 * sourceOf[v] + 3))
      : positionColors(positions, faces);
    firstColors ||= matchColors;
    const layers = await Promise.all(group.layers.map((layer, i) =>
      decodeLayer(layer, data.colors[i], data.n, matchColors, weightColors)));
    panels.push(new Panel(painter, { ...data, positions, faces, layers, hands }));
  }
  return panels;
}

// A panel on its own: the place under the pointer is highlighted and described.
function answerPointer(panel) {
  panel.hover = vertex => {
    panel.highlight(panel.position(vertex), 0.03 * panel.radius);
    panel.write(panel.describe(vertex));
  };
  panel.leave = () => { panel.highlight(null); panel.write(""); };
}

// Joins the first panel to the second: pointing at a place of one highlights its counterpart on the other.
function link([source, target], sourceOf) {
  target.matched = new Float32Array(3 * target.n);
  for (let v = 0; v < target.n; v++) target.matched.set(source.position(sourceOf[v]), 3 * v);
  const radius = 0.09 * source.radius;
  const highlight = (sourceVertex, targetRadius) => {
    source.highlight(source.position(sourceVertex), radius);
    target.highlight(source.position(sourceVertex), targetRadius);
  };
  const clear = () => {
    for (const panel of [source, target]) { panel.highlight(null); panel.write(""); panel.pointAt(-1); }
  };
  [source.leave, target.leave] = [clear, clear];
  source.hover = vertex => {
    source.write(source.describe(vertex));
    // A map need not reach every place of the source.
    const off = target.distanceToMatched(source.position(vertex));
    highlight(vertex, Math.max(radius, 1.4 * off));
    source.pointAt(-1);
    target.pointAt(target.nearestHighlighted());
    target.write(counterpartText(off < radius, target.nHighlighted()));
  };
  target.hover = vertex => {
    highlight(sourceOf[vertex], radius);
    target.pointAt(-1);
    source.pointAt(sourceOf[vertex]);
    target.write(`${target.describe(vertex)}, matched to source vertex ${sourceOf[vertex]}`);
    source.write(source.describe(sourceOf[vertex]));
  };
}

function counterpartText(isMatched, n) {
  if (!isMatched) return "nothing is matched to the place under the pointer; the nearest that is matched is highlighted";
  return `${n === 1 ? "1 vertex" : `${n} vertices`} matched to the place under the pointer`;
}

// Turns the other panels with the one that is turned, while the box is ticked.
function turnTogether(panels, checkbox) {
  const follow = (panel, mover) => {
    panel.yaw = panel.home.yaw + mover.yaw - mover.home.yaw;
    panel.pitch = clampPitch(panel.home.pitch + mover.pitch - mover.home.pitch);
    panel.zoom = mover.zoom;
    panel.moved();
  };
  for (const panel of panels) panel.turned = mover => {
    if (checkbox.checked) panels.filter(other => other !== mover).forEach(other => follow(other, mover));
  };
}

function button(content, onClick) {
  const made = element("button", content);
  made.type = "button";
  made.addEventListener("click", onClick);
  return made;
}

function factsList(facts) {
  const verdictClass = ({ name, value }) => name === "verdict" && VERDICTS.includes(value) ? `verdict ${value}` : "";
  return element("ul", facts.map(fact => element("li", [`${fact.name} `, element("b", fact.value, verdictClass(fact))])), "facts");
}

// What was assumed, folded away.
function notesList(notes) {
  if (!notes.length) return [];
  const title = notes.length > 1 ? `${notes.length} notes: what was found or assumed` : "1 note: what was found or assumed";
  return [element("details", [element("summary", title), element("ul", notes.map(note => element("li", note)))], "notes")];
}

// A colour, three numbers from 0 to 1, and what it stands for.
function swatch(color, text) {
  const made = element("i");
  made.style.background = `rgb(${color.map(c => Math.round(255 * c)).join(" ")})`;
  return element("span", [made, text]);
}

function legendItems(layer) {
  const items = layer.legend.filter(({ text }) => text)
    .map(({ color, text }) => color ? swatch(rgb(color).map(c => c / 255), text) : element("span", text));
  const bar = () => element("span", ["weight 0", element("i", null, "bar"), "1, counts from the mark on"]);
  return layer.kind === "weights" ? [bar(), ...items] : items;
}

// Buttons of the layers and the legend of the one that is shown.
function layerControls(layers, panels) {
  const legend = element("div", null, "legend");
  const show = i => {
    buttons.forEach((made, k) => made.setAttribute("aria-pressed", String(k === i)));
    legend.replaceChildren(...legendItems(layers[i]));
    panels.forEach(panel => panel.show(i));
  };
  const buttons = layers.map((layer, i) => button(layer.name, () => show(i)));
  return { buttons: buttons.length > 1 ? buttons : [], legend, show };
}

function cameraControls(panels) {
  const checkbox = element("input");
  checkbox.type = "checkbox";
  checkbox.checked = panels.length > 1;
  turnTogether(panels, checkbox);
  const together = panels.length > 1 ? [element("label", [checkbox, " turn together"])] : [];
  const again = button("start again", () => panels.forEach(panel => panel.reset()));
  return element("span", [...together, again], "right");
}

// A picture as a button that turns the panel to where it was taken from.
function pictureButton({ name, png, yaw, pitch }, panel) {
  const image = element("img");
  image.src = "data:image/png;base64," + png;
  image.alt = "";
  const made = button([image, name], () => { Object.assign(panel, { yaw, pitch }); panel.moved(); });
  made.title = "turn the object as it was seen";
  return made;
}

// The panels, with the controls of hands or of a motion beside them.
function figures(group, panels, hands) {
  if (!hands) return [element("div", panels.map(panel => panel.figure), "panels")];
  const controls = group.motion ? new MotionControls(panels[0], hands) : new HandControls(panels[0], hands);
  panels[0].controls = controls;
  const beside = element("div", [panels[0].figure, controls.element], "panels beside");
  return controls.below ? [beside, controls.below] : [beside];
}

async function addGroup(painter, group, weightColors) {
  const sourceOf = group.sourceOf && await decodeNumbers(group.sourceOf);
  const motion = group.motion && await Motion.decoded(group.motion);
  const hands = group.hands ? new Hands(group.hands) : motion;
  const panels = await decodePanels(painter, group, sourceOf, hands, weightColors);
  panels.forEach(answerPointer);
  if (sourceOf) link(panels, sourceOf);
  const { buttons, legend, show } = layerControls(group.layers, panels);
  document.getElementById("main").append(element("section", [
    element("h2", group.title),
    factsList(group.facts),
    ...notesList(group.notes),
    element("div", [...buttons, cameraControls(panels)], "controls"),
    legend,
    ...figures(group, panels, hands),
    element("div", group.pictures.map(picture => pictureButton(picture, panels[0])), "pictures"),
  ]));
  show(0);
  return panels;
}

function addFault(text) { document.getElementById("main").append(element("section", element("p", text, "fault"))); }

async function start() {
  if (typeof DecompressionStream === "undefined") { addFault(TOO_OLD); return []; }
  const painter = new Painter(), data = JSON.parse(document.getElementById("data").textContent), all = [];
  for (const group of data.groups) all.push(await addGroup(painter, group, data));
  return all;
}

startTheme(document.getElementById("theme"));
// The panels of each group, once all is shown.
window.semfmReady = start().catch(error => { addFault("This page is damaged: " + error.message); throw error; });
