// Drawing. One WebGL 2 context serves all panels of the page, since browsers allow a dozen or so: each
// panel is drawn on a canvas nobody sees and copied to its own.

const VERTEX = `#version 300 es
in vec3 position; in vec3 normal; in vec3 color; in vec3 key;
uniform mat4 clip; uniform mat3 turn; uniform vec4 spot;
out vec3 shade; out vec3 tilt; out float lit; flat out uint id;
void main() {
  gl_Position = clip * vec4(position, 1.0);
  shade = color; tilt = turn * normal; id = uint(gl_VertexID) + 1u;
  vec3 off = key - spot.xyz;
  lit = spot.w > 0.0 ? max(0.0, 1.0 - dot(off, off) / (spot.w * spot.w)) : 0.0;
}`;
const FRAGMENT = `#version 300 es
precision highp float;
in vec3 shade; in vec3 tilt; in float lit; out vec4 color;
void main() {
  float light = 0.38 + 0.62 * abs(dot(normalize(tilt), normalize(vec3(0.25, 0.35, 0.9))));
  color = vec4(mix(shade, vec3(1.0, 0.82, 0.05), min(1.0, 1.6 * lit)) * light, 1.0);
}`;
// The number of a triangle's last vertex, plus one: what lies under the pointer.
const IDENTITY = `#version 300 es
precision highp float; precision highp int;
flat in uint id; out vec4 color;
void main() {
  color = vec4(id & 255u, (id >> 8) & 255u, (id >> 16) & 255u, (id >> 24) & 255u) / 255.0;
}`;

class Painter {
  constructor() {
    this.canvas = document.createElement("canvas");
    const gl = this.gl = this.canvas.getContext("webgl2", { antialias: true });
    if (!gl) return;
    this.looks = this.program(FRAGMENT);
    this.numbers = this.program(IDENTITY);
    this.frame = gl.createFramebuffer();
    this.texture = gl.createTexture();
    this.depth = gl.createRenderbuffer();
    gl.enable(gl.DEPTH_TEST);
    this.canvas.addEventListener("webglcontextlost", event => { event.preventDefault(); this.lost = true; });
    this.canvas.addEventListener("webglcontextrestored", () => location.reload());
  }

  program(fragment) {
    const gl = this.gl, program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text); gl.compileShader(shader); gl.attachShader(program, shader);
    }
    ["position", "normal", "color", "key"].forEach((name, place) => gl.bindAttribLocation(program, place, name));
    gl.linkProgram(program);
    const places = ["clip", "turn", "spot"].map(name => gl.getUniformLocation(program, name));
    return { program, places };
  }

  // Puts a mesh's arrays on the graphics processor.
  load(mesh) {
    const gl = this.gl, vertices = gl.createVertexArray();
    gl.bindVertexArray(vertices);
    const attribute = (place, array, type, normalised) => {
      const buffer = gl.createBuffer();
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.bufferData(gl.ARRAY_BUFFER, array, gl.STATIC_DRAW);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, 3, type, normalised, 0, 0);
      return buffer;
    };
    attribute(0, mesh.positions, gl.FLOAT, false);
    attribute(1, smoothNormals(mesh.positions, mesh.faces), gl.FLOAT, false);
    const colors = attribute(2, mesh.colors, gl.UNSIGNED_BYTE, true);
    attribute(3, mesh.keys, gl.FLOAT, false);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, mesh.faces, gl.STATIC_DRAW);
    return { vertices, colors, count: mesh.faces.length };
  }

  recolor(loaded, colors) {
    this.gl.bindBuffer(this.gl.ARRAY_BUFFER, loaded.colors);
    this.gl.bufferData(this.gl.ARRAY_BUFFER, colors, this.gl.STATIC_DRAW);
  }

  run({ program, places }, loaded, { clip, turn, spot }) {
    const gl = this.gl;
    gl.useProgram(program);
    gl.uniformMatrix4fv(places[0], false, clip);
    gl.uniformMatrix3fv(places[1], false, turn);
    gl.uniform4fv(places[2], spot);
    gl.bindVertexArray(loaded.vertices);
    gl.drawElements(gl.TRIANGLES, loaded.count, gl.UNSIGNED_INT, 0);
  }

  // Draws a mesh and copies the picture to a canvas of width × height pixels.
  draw(loaded, view, canvas, width, height) {
    const gl = this.gl;
    this.canvas.width = Math.max(this.canvas.width, width);
    this.canvas.height = Math.max(this.canvas.height, height);
    gl.viewport(0, 0, width, height);
    gl.clearColor(1, 1, 1, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    this.run(this.looks, loaded, view);
    canvas.getContext("2d").drawImage(this.canvas, 0, this.canvas.height - height, width, height, 0, 0, width, height);
  }

  // For each pixel, from the lower left, one more than a vertex of the triangle there; 0 for none.
  pick(loaded, view, width, height) {
    const gl = this.gl;
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.frame);
    gl.bindTexture(gl.TEXTURE_2D, this.texture);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, width, height, 0, gl.RGBA, gl.UNSIGNED_BYTE, null);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, this.texture, 0);
    gl.bindRenderbuffer(gl.RENDERBUFFER, this.depth);
    gl.renderbufferStorage(gl.RENDERBUFFER, gl.DEPTH_COMPONENT24, width, height);
    gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.RENDERBUFFER, this.depth);
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    this.run(this.numbers, loaded, view);
    const bytes = new Uint8Array(4 * width * height);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    return new Uint32Array(bytes.buffer);
  }
}

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
