// Drawing. One WebGL 2 context serves all panels of the page, since browsers allow a dozen or so: each
// panel is drawn on a hidden canvas and copied to its own.

const VERTEX_SHADER = `#version 300 es
in vec3 position; in vec3 normal; in vec3 color; in vec3 matched;
uniform mat4 clip; uniform mat3 turn; uniform vec4 spot;
out vec3 base; out vec3 direction; out float highlight; flat out uint id;
void main() {
  gl_Position = clip * vec4(position, 1.0);
  base = color; direction = turn * normal; id = uint(gl_VertexID) + 1u;
  vec3 off = matched - spot.xyz;
  highlight = spot.w > 0.0 ? max(0.0, 1.0 - dot(off, off) / (spot.w * spot.w)) : 0.0;
}`;
const SHADED = `#version 300 es
precision highp float;
in vec3 base; in vec3 direction; in float highlight; uniform float alpha; out vec4 color;
void main() {
  float light = 0.38 + 0.62 * abs(dot(normalize(direction), normalize(vec3(0.25, 0.35, 0.9))));
  color = vec4(mix(base, vec3(1.0, 0.82, 0.05), min(1.0, 1.6 * highlight)) * light * alpha, alpha);
}`;
// The number of a triangle's last vertex, plus one: what lies under the pointer.
const IDENTITY = `#version 300 es
precision highp float; precision highp int;
flat in uint id; out vec4 color;
void main() {
  color = vec4(id & 255u, (id >> 8) & 255u, (id >> 16) & 255u, (id >> 24) & 255u) / 255.0;
}`;
const ATTRIBUTES = ["position", "normal", "color", "matched"];

class Painter {
  constructor() {
    this.canvas = document.createElement("canvas");
    const gl = this.gl = this.canvas.getContext("webgl2", { antialias: true });
    if (!gl) return;
    this.shaded = this.program(SHADED);
    this.identity = this.program(IDENTITY);
    this.frame = gl.createFramebuffer();
    this.texture = gl.createTexture();
    this.depth = gl.createRenderbuffer();
    gl.enable(gl.DEPTH_TEST);
    this.canvas.addEventListener("webglcontextlost", event => { event.preventDefault(); this.lost = true; });
    this.canvas.addEventListener("webglcontextrestored", () => location.reload());
  }

  program(fragment) {
    const gl = this.gl, program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX_SHADER], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    ATTRIBUTES.forEach((name, place) => gl.bindAttribLocation(program, place, name));
    gl.linkProgram(program);
    const [clip, turn, spot, alpha] = ["clip", "turn", "spot", "alpha"].map(name => gl.getUniformLocation(program, name));
    return { program, clip, turn, spot, alpha };
  }

  // Puts a mesh's arrays on the graphics processor. Without colours it is drawn in one.
  load({ positions, colors, matched, faces }) {
    const gl = this.gl, vertices = gl.createVertexArray();
    gl.bindVertexArray(vertices);
    this.attribute("position", positions, gl.FLOAT, false);
    this.attribute("normal", smoothNormals(positions, faces), gl.FLOAT, false);
    const colorBuffer = colors && this.attribute("color", colors, gl.UNSIGNED_BYTE, true);
    if (matched) this.attribute("matched", matched, gl.FLOAT, false);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, faces, gl.STATIC_DRAW);
    return { vertices, colorBuffer, count: faces.length };
  }

  // Three numbers a vertex.
  attribute(name, array, type, normalised) {
    const gl = this.gl, buffer = gl.createBuffer(), place = ATTRIBUTES.indexOf(name);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, array, gl.STATIC_DRAW);
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, 3, type, normalised, 0, 0);
    return buffer;
  }

  recolor(loaded, colors) {
    this.gl.bindBuffer(this.gl.ARRAY_BUFFER, loaded.colorBuffer);
    this.gl.bufferData(this.gl.ARRAY_BUFFER, colors, this.gl.STATIC_DRAW);
  }

  // Draws a mesh and what stands beside it, and copies the picture to a canvas of width × height pixels,
  // which stays clear where nothing is.
  draw(loaded, view, canvas, width, height, items) {
    this.canvas.width = Math.max(this.canvas.width, width);
    this.canvas.height = Math.max(this.canvas.height, height);
    this.render(this.shaded, loaded, view, width, height);
    this.drawItems(items, view);
    const bottom = this.canvas.height - height, context = canvas.getContext("2d");
    context.clearRect(0, 0, width, height);
    context.drawImage(this.canvas, 0, bottom, width, height, 0, 0, width, height);
  }

  // Solid items as they are, then the translucent hands, then a table seen from below.
  drawItems(items, view) {
    items.filter(({ alpha }) => alpha === 1).forEach(item => this.drawItem(item, view));
    const glass = items.filter(({ alpha }) => alpha < 1);
    this.drawGlass(glass.filter(({ isTable }) => !isTable), view);
    this.drawGlass(glass.filter(({ isTable }) => isTable), view);
  }

  // Items that hide each other, so that each pixel is tinted once.
  drawGlass(items, view) {
    const gl = this.gl;
    gl.colorMask(false, false, false, false);
    items.forEach(item => this.drawItem(item, view));
    gl.colorMask(true, true, true, true);
    gl.depthFunc(gl.LEQUAL);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    items.forEach(item => this.drawItem(item, view));
    gl.disable(gl.BLEND);
    gl.depthFunc(gl.LESS);
  }

  // A shape of one colour at its place, a 3 × 4 matrix by rows.
  drawItem({ shape, place: m, color, alpha }, { clip, turn }) {
    const gl = this.gl;
    shape.loaded ||= this.load(shape);
    const model = [m[0], m[4], m[8], 0, m[1], m[5], m[9], 0, m[2], m[6], m[10], 0, m[3], m[7], m[11], 1];
    const rotation = [m[0], m[4], m[8], m[1], m[5], m[9], m[2], m[6], m[10]];
    gl.uniformMatrix4fv(this.shaded.clip, false, product(clip, model, 4));
    gl.uniformMatrix3fv(this.shaded.turn, false, product(turn, rotation, 3));
    gl.uniform4fv(this.shaded.spot, [0, 0, 0, 0]);
    gl.uniform1f(this.shaded.alpha, alpha);
    gl.bindVertexArray(shape.loaded.vertices);
    gl.vertexAttrib3f(ATTRIBUTES.indexOf("color"), ...color);
    gl.drawElements(gl.TRIANGLES, shape.loaded.count, gl.UNSIGNED_INT, 0);
  }

  // For each pixel, from the lower left, one more than a vertex of the triangle there; 0 for none.
  pick(loaded, view, width, height) {
    const gl = this.gl, bytes = new Uint8Array(4 * width * height);
    this.bindFrame(width, height);
    this.render(this.identity, loaded, view, width, height);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    return new Uint32Array(bytes.buffer);
  }

  // A frame of this size to be read from, in place of the canvas.
  bindFrame(width, height) {
    const gl = this.gl;
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.frame);
    gl.bindTexture(gl.TEXTURE_2D, this.texture);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, width, height, 0, gl.RGBA, gl.UNSIGNED_BYTE, null);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, this.texture, 0);
    gl.bindRenderbuffer(gl.RENDERBUFFER, this.depth);
    gl.renderbufferStorage(gl.RENDERBUFFER, gl.DEPTH_COMPONENT24, width, height);
    gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.RENDERBUFFER, this.depth);
  }

  // Draws a mesh and nothing behind it.
  render(program, loaded, { clip, turn, spot }, width, height) {
    const gl = this.gl;
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.useProgram(program.program);
    gl.uniformMatrix4fv(program.clip, false, clip);
    gl.uniformMatrix3fv(program.turn, false, turn);
    gl.uniform4fv(program.spot, spot);
    if (program.alpha) gl.uniform1f(program.alpha, 1);
    gl.bindVertexArray(loaded.vertices);
    gl.drawElements(gl.TRIANGLES, loaded.count, gl.UNSIGNED_INT, 0);
  }
}

// a · b of n × n matrices by columns.
function product(a, b, n) {
  const out = new Float32Array(n * n);
  for (let c = 0; c < n; c++) for (let r = 0; r < n; r++) {
    for (let k = 0; k < n; k++) out[n * c + r] += a[n * k + r] * b[n * c + k];
  }
  return out;
}

// Sums of the normals of the triangles around each vertex, each as long as twice its area, at length 1.
function smoothNormals(p, faces) {
  const normals = new Float32Array(p.length);
  for (let t = 0; t < faces.length; t += 3) {
    const a = 3 * faces[t], b = 3 * faces[t + 1], c = 3 * faces[t + 2];
    const ux = p[b] - p[a], uy = p[b + 1] - p[a + 1], uz = p[b + 2] - p[a + 2];
    const vx = p[c] - p[a], vy = p[c + 1] - p[a + 1], vz = p[c + 2] - p[a + 2];
    const nx = uy * vz - uz * vy, ny = uz * vx - ux * vz, nz = ux * vy - uy * vx;
    for (let k = 0; k < 3; k++) {
      const v = k === 0 ? a : k === 1 ? b : c;
      normals[v] += nx; normals[v + 1] += ny; normals[v + 2] += nz;
    }
  }
  for (let i = 0; i < normals.length; i += 3) {
    const length = Math.sqrt(normals[i] ** 2 + normals[i + 1] ** 2 + normals[i + 2] ** 2) || 1;
    normals[i] /= length; normals[i + 1] /= length; normals[i + 2] /= length;
  }
  return normals;
}
