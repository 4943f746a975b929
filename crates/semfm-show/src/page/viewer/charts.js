// Small charts over time: one line a joint, the segments behind them, the chosen time across.

const SVG = "http://www.w3.org/2000/svg";
// Size in units of the drawing, and the space for numbers on the left and above.
const CHART = { width: 640, height: 150, left: 48, right: 8, top: 18, bottom: 20 };
// Most places of a line: more than a chart has pixels buys nothing.
const MOST_PLACES = 640;

// An element of a drawing.
function drawn(name, attributes, content) {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  if (content !== undefined) made.textContent = content;
  return made;
}

// A step of 1, 2 or 5 times a power of ten that divides a length into at most so many parts.
function roundStep(length, most) {
  const power = 10 ** Math.floor(Math.log10(length / most));
  return [1, 2, 5, 10].map(k => k * power).find(step => length / step <= most) || 10 * power;
}

// `lines`: [{name, color, dashed, values}], values at even times from 0 to `duration`; `segments`: [{name, start,
// end}]. `choose` is told a time where the chart is pointed at.
class Chart {
  constructor({ title, unit, duration, lines, segments, choose }) {
    this.duration = duration;
    const values = lines.flatMap(({ values }) => [...values]);
    const [low, high] = [Math.min(0, ...extent(values)), Math.max(0, ...extent(values))];
    const margin = 0.06 * (high - low) || 1;
    [this.low, this.high] = [low - margin, high + margin];
    this.cursor = drawn("line", { y1: CHART.top, y2: CHART.height - CHART.bottom, class: "cursor" });
    const svg = drawn("svg", { viewBox: `0 0 ${CHART.width} ${CHART.height}`, role: "img", "aria-label": `${title}, ${unit}` });
    svg.append(...this.segmentParts(segments), ...this.axisParts(), ...lines.map(line => this.line(line)), this.cursor);
    this.listen(svg, choose);
    this.element = element("figure", [element("figcaption", [element("b", title), element("span", unit)]), svg], "chart");
    this.show(0);
  }

  x(time) { return CHART.left + (time / (this.duration || 1)) * (CHART.width - CHART.left - CHART.right); }

  y(value) {
    const share = (value - this.low) / (this.high - this.low);
    return CHART.height - CHART.bottom - share * (CHART.height - CHART.top - CHART.bottom);
  }

  // A band for every other segment, and the names that have room.
  segmentParts(segments) {
    return segments.flatMap(({ name, start, end }, i) => {
      const [left, right] = [this.x(start), this.x(end)];
      const band = drawn("rect", { x: left, width: Math.max(0, right - left), y: CHART.top, height: CHART.height - CHART.top - CHART.bottom, class: i % 2 ? "band odd" : "band" });
      const label = drawn("text", { x: (left + right) / 2, y: CHART.top - 6, "text-anchor": "middle" }, right - left > 7 * name.length ? name : "");
      return [band, label];
    });
  }

  axisParts() {
    const parts = [], step = roundStep(this.high - this.low, 4), second = roundStep(this.duration || 1, 8);
    for (let value = Math.ceil(this.low / step) * step; value <= this.high; value += step) {
      parts.push(drawn("line", { x1: CHART.left, x2: CHART.width - CHART.right, y1: this.y(value), y2: this.y(value), class: "rule" }));
      parts.push(drawn("text", { x: CHART.left - 6, y: this.y(value) + 4, "text-anchor": "end" }, shortNumber(value, step)));
    }
    for (let time = 0; time <= this.duration + 1e-9; time += second) {
      parts.push(drawn("text", { x: this.x(time), y: CHART.height - 5, "text-anchor": "middle" }, `${shortNumber(time, second)} s`));
    }
    return parts;
  }

  line({ color, dashed, values }) {
    const n = values.length, step = Math.max(1, Math.ceil(n / MOST_PLACES)), places = [];
    const add = i => places.push(`${this.x(n > 1 ? i / (n - 1) * this.duration : 0).toFixed(1)},${this.y(values[i]).toFixed(1)}`);
    for (let i = 0; i < n; i += step) add(i);
    if ((n - 1) % step) add(n - 1);
    return drawn("polyline", { points: places.join(" "), stroke: color, class: "line", ...(dashed ? { "stroke-dasharray": "5 3" } : {}) });
  }

  // Pointing chooses the time, and so does a drag.
  listen(svg, choose) {
    const at = event => {
      const box = svg.getBoundingClientRect(), x = (event.clientX - box.left) / box.width * CHART.width;
      choose(Math.max(0, Math.min(1, (x - CHART.left) / (CHART.width - CHART.left - CHART.right))) * this.duration);
    };
    svg.addEventListener("pointerdown", event => {
      try { svg.setPointerCapture(event.pointerId); } catch { /* a pointer that is gone already */ }
      at(event);
    });
    svg.addEventListener("pointermove", event => { if (event.buttons) at(event); });
  }

  show(time) {
    for (const end of ["x1", "x2"]) this.cursor.setAttribute(end, this.x(time));
  }
}

function extent(values) {
  let low = Infinity, high = -Infinity;
  for (const x of values) { low = Math.min(low, x); high = Math.max(high, x); }
  return low > high ? [0, 0] : [low, high];
}

// With as many digits as a step asks for, and no minus before zero.
function shortNumber(value, step) {
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  return value.toFixed(digits).replace(/^-(0(\.0*)?)$/, "$1");
}
