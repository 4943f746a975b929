// One grasp over time: the open hand comes from behind, its fingers close, hand and object are lifted. It shows where
// everything goes as it was planned; no force is in it.

const PHASES = ["comes", "closes", "lifts"];
// Seconds of each phase.
const PHASE_SECONDS = 1.1;

// Begins and ends at rest.
function smooth(share) { return share * share * (3 - 2 * share); }

// Between two motions of 3 × 4: columns mixed, then made orthonormal again (Gram and Schmidt).
function mixed(a, b, share) {
  const m = a.map((x, i) => x + share * (b[i] - x)), column = k => [m[k], m[4 + k], m[8 + k]];
  const scale = Math.hypot(...[0, 4, 8].map(r => a[r]));
  const unit = v => v.map(x => x / (Math.hypot(...v) || 1));
  const x = unit(column(0)), along = dot(x, column(1));
  const y = unit(column(1).map((value, k) => value - along * x[k]));
  const z = [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]];
  return [0, 1, 2].flatMap(k => [scale * x[k], scale * y[k], scale * z[k], m[4 * k + 3]]);
}

class Grasping {
  // `data` is that of the hands; `moment` goes from 0 to the number of phases.
  constructor(data) {
    this.data = data;
    this.moment = 0;
  }

  share(phase) { return smooth(Math.max(0, Math.min(1, this.moment - phase))); }

  // How far hand and object are lifted, in the panel's frame.
  lift() { return this.data.lift.map(x => x * this.share(2)); }

  // Where the hand is: behind the grasp until it has come.
  place(grasp) {
    const back = (1 - this.share(0)) * this.data.retreat, m = [...grasp.place];
    for (const r of [0, 4, 8]) m[r + 3] -= back * m[r + 2];
    return m;
  }

  poses(grasp) { return grasp.open.map((open, i) => mixed(open, grasp.closed[i], this.share(1))); }

  get isTouching() { return this.moment >= 1.95; }
}

// The buttons that show a grasp over time; still pictures only, where the reader wants less motion.
class GraspingControls {
  constructor(panel, hands) {
    this.panel = panel;
    this.hands = hands;
    this.playButton = button("play", () => { if (this.frame) this.stop(); else this.play(); });
    this.stills = PHASES.map((name, i) => button(name, () => { this.stop(); this.show(i + 1); }));
    const less = matchMedia("(prefers-reduced-motion: reduce)").matches;
    const note = element("p", "The hand comes, closes and lifts as planned; forces are not simulated here.");
    const buttons = element("div", [...(less ? [] : [this.playButton]), ...this.stills], "segments");
    this.element = element("div", [buttons, note], "grasping");
  }

  show(moment) {
    const { hands } = this;
    hands.grasping ||= new Grasping(hands.data);
    hands.grasping.moment = moment;
    const phase = Math.max(0, Math.ceil(moment) - 1);
    this.stills.forEach((made, i) => made.setAttribute("aria-pressed", String(i === phase)));
    this.panel.moved();
  }

  play() {
    let before = performance.now();
    this.show(0);
    this.playButton.textContent = "pause";
    const step = now => {
      const moment = this.hands.grasping.moment + Math.max(0, now - before) / 1e3 / PHASE_SECONDS;
      before = now;
      this.show(Math.min(PHASES.length, moment));
      if (moment < PHASES.length) this.frame = requestAnimationFrame(step);
      else this.stop();
    };
    this.frame = requestAnimationFrame(step);
  }

  stop() {
    cancelAnimationFrame(this.frame);
    this.frame = 0;
    this.playButton.textContent = "play";
  }

  // Back to the hand at the grasp.
  leave() {
    this.stop();
    this.hands.grasping = null;
    this.stills.forEach(made => made.setAttribute("aria-pressed", "false"));
  }
}
