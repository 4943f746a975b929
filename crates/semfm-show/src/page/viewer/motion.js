// An arm that moves: bodies at their places over time, and the controls of the time. Data of a group: {duration,
// nSamples, lengthStep, rotationStep, jointStep, bodies: [{name, isTable, color, n, step, positions, faces,
// translations, rotations}], joints: [{name, unit, color, dashed, range, fastest, positions, velocities}], opening,
// segments: [{name, start, end}], tableNormal}: see `motion.rs`.

// Moments at which the whole of what moves is fitted into the picture.
const N_FITTED = 16;
// A slow replay runs at this share of the true speed.
const SLOW = 0.25;

// Signed whole numbers in steps.
async function decodeSteps(text, step) {
  return Float64Array.from(await decodeNumbers(text), x => (x | 0) * step);
}

class Motion {
  static async decoded(data) {
    const motion = new Motion();
    motion.data = data;
    motion.n = data.nSamples;
    motion.bodies = await Promise.all(data.bodies.map(async body => ({
      shape: { positions: await decodePositions(body), faces: await decodeNumbers(body.faces) },
      color: body.color,
      isTable: body.isTable,
      translations: await decodeSteps(body.translations, data.lengthStep),
      rotations: await decodeSteps(body.rotations, data.rotationStep),
    })));
    const { jointStep } = data;
    motion.joints = await Promise.all(data.joints.map(async joint => ({
      ...joint,
      positions: await decodeSteps(joint.positions, jointStep),
      velocities: await decodeSteps(joint.velocities, jointStep),
    })));
    motion.opening = await decodeSteps(data.opening, jointStep);
    motion.time = 0;
    return motion;
  }

  // The sample before a time, and the share of the way to the next.
  sample(time) {
    const at = Math.max(0, Math.min(1, time / (this.data.duration || 1))) * (this.n - 1);
    const i = Math.max(0, Math.min(this.n - 2, Math.floor(at)));
    return [i, this.n > 1 ? at - i : 0];
  }

  // A number of a list of samples at a time; `from` is where its samples begin.
  valueAt(values, time, from = 0) {
    const [i, share] = this.sample(time), a = values[from + i], b = values[from + Math.min(i + 1, this.n - 1)];
    return a + share * (b - a);
  }

  // Where a body is at a time, a 3 × 4 matrix by rows. Neighbouring rotations have one sign, so that their numbers
  // may be mixed.
  placeOf(body, time) {
    const [tx, ty, tz] = [0, 1, 2].map(k => this.valueAt(body.translations, time, k * this.n));
    const q = [0, 1, 2, 3].map(k => this.valueAt(body.rotations, time, k * this.n)), length = Math.hypot(...q) || 1;
    const [x, y, z, w] = q.map(part => part / length);
    return [
      1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w), tx,
      2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w), ty,
      2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y), tz,
    ];
  }

  // Corners of the boxes around all that moves, at moments spread over the motion: for the choice of scale.
  reach() {
    const corners = [];
    for (const body of this.bodies.filter(({ isTable }) => !isTable)) {
      const box = boundsOf(body.shape.positions, body.shape.faces);
      for (let i = 0; i < N_FITTED; i++) {
        const place = this.placeOf(body, this.data.duration * i / (N_FITTED - 1));
        for (let c = 0; c < 8; c++) corners.push(moved(place, [0, 1, 2].map(k => box[c >> k & 1][k])));
      }
    }
    return [corners];
  }

  // What is drawn beside what stands still.
  items() {
    return this.bodies.map(body => ({
      shape: body.shape, place: this.placeOf(body, this.time), color: body.color, alpha: 1, isTable: body.isTable,
    }));
  }
}

// The controls beside a panel that shows a motion: play, the time, the segments, where each joint is.
class MotionControls {
  constructor(panel, motion) {
    this.panel = panel;
    this.motion = motion;
    const { duration, segments } = motion.data;
    this.playButton = button("play", () => this.toggle());
    this.clock = element("output");
    this.slider = element("input");
    Object.assign(this.slider, { type: "range", min: "0", max: String(duration), step: "any", value: "0" });
    this.slider.setAttribute("aria-label", "time in seconds");
    this.slider.addEventListener("input", () => this.choose(Number(this.slider.value)));
    this.slider.addEventListener("keydown", event => this.sliderKey(event));
    this.segmentButtons = segments.map(({ name, start }) => button(name, () => this.choose(start)));
    this.slow = element("input");
    this.slow.type = "checkbox";
    this.rows = motion.joints.map(joint => this.jointRow(joint));
    this.opening = element("td");
    const head = element("tr", ["joint", "position", "speed"].map(name => element("th", name)));
    const fingers = element("tr", [element("th", "between the pads"), this.opening, element("td")]);
    this.element = element("aside", [
      element("h3", "Motion"),
      element("div", [this.playButton, this.clock], "steps"),
      this.slider,
      element("div", this.segmentButtons, "segments"),
      element("label", [this.slow, " a quarter of the speed"]),
      element("table", [head, ...this.rows.map(({ row }) => row), fingers]),
    ], "grasps motion");
    this.charts = this.makeCharts();
    this.below = element("div", this.charts.map(chart => chart.element), "charts");
    panel.hover = panel.leave = () => {};
    panel.figure.addEventListener("keydown", event => this.spaceKey(event));
    this.show(0);
  }

  // For each unit that occurs, a chart of positions and one of speeds.
  makeCharts() {
    const { duration, segments } = this.motion.data;
    const units = [...new Set(this.motion.joints.map(({ unit }) => unit))];
    return units.flatMap(unit => {
      const joints = this.motion.joints.filter(joint => joint.unit === unit);
      const chart = (title, unit, key) => new Chart({
        title, unit, duration, segments,
        lines: joints.map(joint => ({ ...joint, values: joint[key] })),
        choose: time => this.choose(time),
      });
      return [chart("positions", unit, "positions"), chart("speeds", `${unit}/s`, "velocities")];
    });
  }

  // A row of the table: the joint in its colour, where it is, how fast, and a bar of the speed it may have.
  jointRow({ name, color }) {
    const mark = element("i"), position = element("td"), speed = element("td");
    mark.style.background = color;
    return { row: element("tr", [element("th", [mark, name]), position, speed]), position, speed };
  }

  // Space plays and stops, wherever the focus is in the panel.
  spaceKey(event) {
    if (event.key !== " ") return;
    event.preventDefault();
    this.toggle();
  }

  // A twentieth of the motion would be too coarse a step for a key.
  sliderKey(event) {
    const steps = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1, PageDown: -10, PageUp: 10 };
    if (event.key === " ") { this.spaceKey(event); return; }
    if (!(event.key in steps)) return;
    event.preventDefault();
    this.choose(this.motion.time + 0.02 * steps[event.key]);
  }

  get isPlaying() { return Boolean(this.frame); }

  toggle() { if (this.isPlaying) this.stop(); else this.play(); }

  // From the chosen time, or from the start where that is the end.
  play() {
    if (this.motion.time >= this.motion.data.duration) this.show(0);
    let before = performance.now();
    const step = now => {
      const passed = (now - before) / 1e3 * (this.slow.checked ? SLOW : 1);
      before = now;
      this.show(this.motion.time + Math.max(0, passed));
      if (this.motion.time >= this.motion.data.duration) this.stop();
      else this.frame = requestAnimationFrame(step);
    };
    this.frame = requestAnimationFrame(step);
    this.playButton.textContent = "pause";
  }

  stop() {
    cancelAnimationFrame(this.frame);
    this.frame = 0;
    this.playButton.textContent = "play";
  }

  // Stops and shows a time.
  choose(time) {
    this.stop();
    this.show(time);
  }

  show(time) {
    const { motion } = this, { duration, segments } = motion.data;
    motion.time = Math.max(0, Math.min(duration, time));
    const after = segments.findLastIndex(({ start }) => start <= motion.time + 1e-9), at = Math.max(0, after);
    const text = `${motion.time.toFixed(2)} of ${duration.toFixed(2)} s`;
    this.clock.textContent = text;
    this.slider.value = String(motion.time);
    this.slider.setAttribute("aria-valuetext", `${text}, ${segments[at].name}`);
    this.segmentButtons.forEach((made, i) => made.setAttribute("aria-pressed", String(i === at)));
    motion.joints.forEach((joint, j) => this.showJoint(joint, this.rows[j]));
    this.opening.textContent = `${(1e3 * motion.valueAt(motion.opening, motion.time)).toFixed(1)} mm`;
    this.charts.forEach(chart => chart.show(motion.time));
    this.panel.write(`${segments[at].name}, ${motion.time.toFixed(2)} s`);
    this.panel.draw();
  }

  showJoint(joint, { position, speed }) {
    const { motion } = this, q = motion.valueAt(joint.positions, motion.time), v = motion.valueAt(joint.velocities, motion.time);
    const turns = joint.unit === "rad";
    position.textContent = turns ? `${(180 / Math.PI * q).toFixed(1)}°` : `${(1e3 * q).toFixed(1)} mm`;
    const percent = joint.fastest ? ` (${Math.round(100 * Math.abs(v) / joint.fastest)} %)` : "";
    speed.textContent = (turns ? `${(180 / Math.PI * v).toFixed(0)}°/s` : `${(1e3 * v).toFixed(0)} mm/s`) + percent;
    const limits = joint.range && joint.range.map(x => turns ? `${(180 / Math.PI * x).toFixed(0)}°` : `${(1e3 * x).toFixed(0)} mm`);
    position.title = limits ? `from ${limits[0]} to ${limits[1]}` : "";
  }
}
