// Hands at the object: one grasp after the other, with the terms of its score, or the best few together.
// Matrices are 3 × 4, rows one after the other. Data of a group: {parts: [{carrier, kind, positions,
// faces}], grasps: [{place, closed, open, width, opening, closingTurn, score, terms, contacts}], arrow, ball,
// table, colors, ranks, opacity, retreat, lift}: see `hands.rs`.

// What 1 means for each term of a score.
const TERMS = {
  approach: "the hand comes as it was demonstrated",
  bite: "the pads are filled along their length",
  centred: "the forces act in the middle of the pads",
  clearance: "the open hand keeps 1 cm from everything",
  closing: "the object does not turn while the pads close",
  contact: "each pad touches with 60 % of its face or more",
  epsilon: "the grip resists pushes and twists as well as two full pads",
  evenness: "the whole of both pads is pressed evenly",
  friction: "the contacts oppose each other exactly",
  gravity: "the weight asks for little of the torque that friction can hold",
  lever: "the grip is around the centre of mass",
  region: "all contact lies in the region",
  weight: "the object weighs little against what friction can hold",
};

// a · b for motions of 3 × 4.
function chain(a, b) {
  const out = [];
  for (let i = 0; i < 3; i++) for (let k = 0; k < 4; k++) {
    const r = 4 * i;
    out.push(a[r] * b[k] + a[r + 1] * b[4 + k] + a[r + 2] * b[8 + k] + (k === 3 ? a[r + 3] : 0));
  }
  return out;
}

function moved(m, [x, y, z]) {
  return [0, 4, 8].map(r => m[r] * x + m[r + 1] * y + m[r + 2] * z + m[r + 3]);
}

class Hands {
  constructor(data) {
    this.data = data;
    for (const shape of [...data.parts, data.arrow, data.ball, data.table]) if (shape) {
      shape.positions = new Float32Array(shape.positions);
      shape.faces = new Uint32Array(shape.faces);
    }
    this.at = 0;
    this.isOpen = false;
    this.isTogether = false;
    // The grasp over time, while it is shown so.
    this.grasping = null;
  }

  // How far the object is lifted, and how much smaller everything is drawn to make room for that.
  lift() { return this.grasping ? this.grasping.lift() : [0, 0, 0]; }
  get reduction() { return this.grasping ? 0.72 : 1; }

  // How many are drawn together: each has a colour of its own.
  get nTogether() { return Math.min(this.data.ranks.length, this.data.grasps.length); }

  // For each grasp, the corners of the boxes around the hand's parts: for the choice of scale.
  reach() {
    const boxes = this.data.parts.map(part => boundsOf(part.positions, part.faces));
    const corners = [0, 1, 2, 3, 4, 5, 6, 7];
    return this.data.grasps.map(grasp => this.data.parts.flatMap((part, i) => {
      const place = chain(grasp.place, grasp.closed[part.carrier]);
      return corners.map(c => moved(place, [0, 1, 2].map(k => boxes[i][c >> k & 1][k])));
    }));
  }

  // What is drawn beside the object: solid things, then translucent ones.
  items() {
    const { colors, grasps, table } = this.data, items = [];
    // The object stands still in the frame of the panel; lifted, it leaves the table below.
    const [dx, dy, dz] = this.lift(), tablePlace = [1, 0, 0, -dx, 0, 1, 0, -dy, 0, 0, 1, -dz];
    if (table) items.push({ shape: table, place: tablePlace, color: colors.table, alpha: 1, isTable: true });
    if (this.isTogether && !this.grasping) {
      for (let rank = this.nTogether - 1; rank >= 0; rank--) this.addHand(items, grasps[rank], this.data.ranks[rank]);
      return items;
    }
    const grasp = grasps[this.at];
    if (!this.grasping) items.push({ shape: this.data.arrow, place: grasp.place, color: colors.approach, alpha: 1 });
    if (!this.grasping || this.grasping.isTouching) for (const [x, y, z] of grasp.contacts) {
      items.push({ shape: this.data.ball, place: [1, 0, 0, x, 0, 1, 0, y, 0, 0, 1, z], color: colors.contact, alpha: 1 });
    }
    this.addHand(items, grasp, colors);
    return items;
  }

  addHand(items, grasp, colors) {
    const moving = this.grasping, place = moving ? moving.place(grasp) : grasp.place;
    const poses = moving ? moving.poses(grasp) : this.isOpen ? grasp.open : grasp.closed;
    for (const part of this.data.parts) {
      items.push({ shape: part, place: chain(place, poses[part.carrier]), color: colors[part.kind], alpha: this.data.opacity });
    }
  }
}

// The controls beside a panel that shows hands, and what is known of the grasp that is shown.
class HandControls {
  constructor(panel, hands) {
    this.panel = panel;
    this.hands = hands;
    const { grasps } = hands.data;
    this.title = element("output");
    this.numbers = element("dl");
    this.terms = element("div", null, "terms");
    this.bars = grasps.map((grasp, i) => this.scoreBar(grasp, i));
    const steps = [button("‹ previous", () => this.step(-1)), this.title, button("next ›", () => this.step(1))];
    this.grasping = new GraspingControls(panel, hands);
    const few = `the best ${hands.nTogether} together, the better the darker`;
    this.element = element("aside", [
      element("h3", "Grasps, best first"),
      element("div", grasps.length > 1 ? steps : [this.title], "steps"),
      element("div", grasps.length > 1 ? this.bars : [], "all"),
      this.checkbox("hand open, as it comes", on => { hands.isOpen = on; }),
      ...(hands.nTogether > 1 ? [this.checkbox(few, on => { hands.isTogether = on; })] : []),
      this.grasping.element, this.numbers, this.terms, this.legend(),
    ], "grasps");
    this.show(0);
  }

  scoreBar({ score }, i) {
    const bar = element("i"), made = button(bar, () => this.show(i));
    bar.style.height = `${Math.max(4, 100 * score)}%`;
    made.setAttribute("aria-label", `grasp ${i}, score ${score.toFixed(2)}`);
    made.title = `grasp ${i}, score ${score.toFixed(2)}`;
    return made;
  }

  checkbox(text, answer) {
    const box = element("input");
    box.type = "checkbox";
    box.addEventListener("change", () => { this.grasping.leave(); answer(box.checked); this.panel.moved(); });
    return element("label", [box, ` ${text}`]);
  }

  legend() {
    const { colors, table } = this.hands.data;
    const names = { palm: "hand", finger: "finger", pad: "pad", contact: "contact", approach: "approach", table: "table" };
    const items = Object.entries(names).filter(([kind]) => kind !== "table" || table);
    return element("div", items.map(([kind, name]) => swatch(colors[kind], name)), "legend");
  }

  step(by) {
    const n = this.bars.length;
    this.show((this.hands.at + by + n) % n);
  }

  show(i) {
    const grasp = this.hands.data.grasps[i], millimetres = x => `${(1e3 * x).toFixed(1)} mm`;
    this.hands.at = i;
    this.grasping.leave();
    this.title.textContent = `grasp ${i}, of 0 to ${this.bars.length - 1}`;
    this.bars.forEach((bar, k) => bar.setAttribute("aria-pressed", String(k === i)));
    const numbers = [["score", grasp.score.toFixed(3)], ["between the pads", millimetres(grasp.width)], ["on the way in", millimetres(grasp.opening)], ["turn while closing", `${(180 / Math.PI * grasp.closingTurn).toFixed(1)}°`]];
    this.numbers.replaceChildren(...numbers.flatMap(([name, value]) => [element("dt", name), element("dd", value)]));
    this.terms.replaceChildren(...grasp.terms.flatMap(([name, value]) => this.term(name, value)));
    this.panel.moved();
  }

  term(name, value) {
    const bar = element("i"), label = element("span", name);
    bar.style.width = `${100 * value}%`;
    label.title = TERMS[name] ? `1: ${TERMS[name]}` : "";
    return [label, element("div", bar), element("b", value.toFixed(2))];
  }
}
