// Reads the arrays of the page: zlib streams in base64.

async function decodeBytes(text) {
  const raw = atob(text), packed = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) packed[i] = raw.charCodeAt(i);
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// Whole numbers: differences to the number before, signs folded into the last bit, in four planes of bytes.
async function decodeNumbers(text) {
  const planes = await decodeBytes(text), n = planes.length / 4, out = new Uint32Array(n);
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
async function decodePositions({ positions, n, step }) {
  const steps = await decodeNumbers(positions), out = new Float32Array(steps.length);
  for (let k = 0; k < 3; k++) for (let v = 0; v < n; v++) out[3 * v + k] = step[k] * (steps[k * n + v] - 2 ** 19);
  return out;
}

// #rrggbb as three bytes.
function rgb(hex) { return [1, 3, 5].map(i => parseInt(hex.slice(i, i + 2), 16)); }

// Three bytes for each of n vertices.
function colorsOf(n, colorOf) {
  const colors = new Uint8Array(3 * n);
  for (let v = 0; v < n; v++) colors.set(colorOf(v), 3 * v);
  return colors;
}

// Colours of positions, x, y and z over the bounding box, as in `transfer.png`.
function positionColors(p, faces) {
  const [low, high] = boundsOf(p, faces), out = new Uint8ClampedArray(p.length);
  for (let i = 0; i < p.length; i++) {
    const k = i % 3, share = (p[i] - low[k]) / (high[k] - low[k] || 1);
    out[i] = Math.round(255 * (0.15 + 0.8 * share));
  }
  return out;
}
