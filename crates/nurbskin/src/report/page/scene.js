// What is drawn, with WebGL 2. Nothing runs between frames: whoever changes something asks for the next one.

class Program {
  constructor(gl, vertex, fragment) {
    this.gl = gl;
    this.program = gl.createProgram();
    for (const [type, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(type);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(this.program, shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS) && !gl.isContextLost()) throw new Error(gl.getShaderInfoLog(shader));
    }
    gl.linkProgram(this.program);
    if (!gl.getProgramParameter(this.program, gl.LINK_STATUS) && !gl.isContextLost()) throw new Error(gl.getProgramInfoLog(this.program));
    this.uniforms = {};
    for (let i = 0; i < gl.getProgramParameter(this.program, gl.ACTIVE_UNIFORMS); i++) {
      const { name, type } = gl.getActiveUniform(this.program, i);
      this.uniforms[name] = { type, place: gl.getUniformLocation(this.program, name) };
    }
  }

  use(values) {
    const { gl } = this;
    gl.useProgram(this.program);
    for (const [name, { type, place }] of Object.entries(this.uniforms)) {
      const value = values[name] ?? 0;
      if (type === gl.FLOAT_MAT4) gl.uniformMatrix4fv(place, false, value);
      else if (type === gl.FLOAT_VEC4) gl.uniform4fv(place, value || [0, 0, 0, 0]);
      else if (type === gl.FLOAT_VEC3) gl.uniform3fv(place, value || [0, 0, 0]);
      else if (type === gl.FLOAT_VEC2) gl.uniform2fv(place, value || [0, 0]);
      else if (type === gl.FLOAT) gl.uniform1f(place, value);
      else gl.uniform1i(place, value);
    }
  }
}

// Pairs (value * weight, weight); a value that is no number weighs nothing.
function weighted(values) {
  const pairs = new Float32Array(2 * values.length);
  for (let i = 0; i < values.length; i++) {
    if (Number.isFinite(values[i])) [pairs[2 * i], pairs[2 * i + 1]] = [values[i], 1];
  }
  return pairs;
}

// The segments of polylines, or of those that are wanted, by their number.
function segmentsOf({ positions, lengths }, wanted = () => true) {
  const found = [];
  let start = 0;
  for (const [line, length] of lengths.entries()) {
    if (wanted(line)) for (let k = start; k + 1 < start + length && 3 * k + 6 <= positions.length; k++) found.push(positions.subarray(3 * k, 3 * k + 6));
    start += length;
  }
  const all = new Float32Array(6 * found.length);
  found.forEach((segment, k) => all.set(segment, 6 * k));
  return all;
}

// The mean deviation of the face of each vertex; null without deviations of several faces.
function byFace({ mesh, faces }) {
  if (!mesh?.faces || faces.length < 2 || !faces.some((f) => f.deviation?.count)) return null;
  return Float32Array.from(mesh.faces, (k) => (faces[k]?.deviation?.count ? faces[k].deviation.signed_mean : NaN));
}

// The plane beyond which nothing is drawn, as the shaders take it.
const cutOf = ({ section }) => (section?.on && section.away ? [...section.normal, section.offset] : [0, 0, 0, 0]);

class Scene {
  constructor(canvas, data) {
    this.gl = canvas.getContext("webgl2", { antialias: true, alpha: true });
    if (!this.gl) throw new Error("no WebGL 2");
    this.data = data;
    this.canvas = canvas;
    this.build();
  }

  build() {
    const { gl, data } = this;
    this.programs = {
      surface: new Program(gl, SURFACE_VERTEX, SURFACE_FRAGMENT),
      points: new Program(gl, POINT_VERTEX, POINT_FRAGMENT),
      lines: new Program(gl, LINE_VERTEX, LINE_FRAGMENT),
      pickSurface: new Program(gl, PICK_SURFACE_VERTEX, PICK_FRAGMENT),
      pickPoints: new Program(gl, PICK_POINT_VERTEX, PICK_FRAGMENT),
    };
    this.maps = Object.fromEntries(Object.keys(STOPS).map((name) => [name, this.texture(mapBytes(name))]));
    this.empty = gl.createVertexArray();
    this.lines = {};
    for (const [name, line] of Object.entries(data.lines)) if (line) this.lines[name] = this.segments(segmentsOf(line));
    this.buildEdges(data);
    if (data.lines.control_net) this.net = this.dots(data.lines.control_net.positions);
    if (data.poles.length) this.poles = this.dots(new Float32Array(data.poles.flat()));
    if (data.mesh) this.buildMesh(data.mesh);
    if (data.points) this.buildPoints(data.points);
    this.marked = null;
    this.curve = null;
    this.target = null;
  }

  // Edges by how their faces join: sharp ones are feature lines, smooth ones are in classes of their angle, too.
  buildEdges({ lines: { edges }, joins }) {
    if (!edges) return;
    const some = (wanted) => {
      const all = segmentsOf(edges, (k) => wanted(joins[k]));
      return all.length ? this.segments(all) : null;
    };
    this.lines.edges = some((join) => join?.kind !== "sharp");
    this.lines.features = some((join) => join?.kind === "sharp");
    this.lines.others = some((join) => !["smooth", "sharp"].includes(join?.kind));
    this.jumps = JUMPS.map((_, k) => some((join) => join?.kind === "smooth" && jumpClass(join) === k));
  }

  buildMesh(mesh) {
    const { gl } = this, count = mesh.positions.length / 3;
    const support = Uint8Array.from({ length: count }, (_, i) => (mesh.deviation && !Number.isFinite(mesh.deviation[i]) ? 0 : 255));
    this.mesh = { array: gl.createVertexArray(), count: mesh.triangles.length };
    gl.bindVertexArray(this.mesh.array);
    this.attribute(0, mesh.positions, 3);
    if (mesh.normals) this.attribute(1, mesh.normals, 3);
    this.attribute(3, support, 1, true);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, mesh.triangles, gl.STATIC_DRAW);
    const sets = { deviation: mesh.deviation, mean: mesh.mean, gaussian: mesh.gaussian, faces: mesh.faces, by_face: byFace(this.data) };
    this.mesh.values = Object.fromEntries(Object.entries(sets).filter(([, v]) => v).map(([k, v]) => [k, this.buffer(weighted(v))]));
    // Each triangle has corners of its own, as its number comes from theirs.
    const corners = new Float32Array(4 * mesh.triangles.length);
    mesh.triangles.forEach((v, k) => {
      for (let i = 0; i < 3; i++) corners[4 * k + i] = mesh.positions[3 * v + i];
      corners[4 * k + 3] = support[v] / 255;
    });
    this.corners = gl.createVertexArray();
    gl.bindVertexArray(this.corners);
    this.buffer(corners);
    for (const [place, size, offset] of [[0, 3, 0], [3, 1, 12]]) {
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, size, gl.FLOAT, false, 16, offset);
    }
  }

  buildPoints(points) {
    this.points = this.dots(points.positions);
    this.attribute(3, points.state, 1);
    const { low, high } = boxOf(placesOf(points)), heights = new Float32Array(points.count);
    for (let i = 0; i < points.count; i++) heights[i] = points.positions[3 * i + 2];
    this.points.values = { height: this.buffer(weighted(heights)) };
    if (points.deviation) this.points.values.deviation = this.buffer(weighted(points.deviation));
    // About the distance of neighbours, were they spread over two sides of the box.
    const [a, b, c] = high.map((x, k) => x - low[k]).sort((p, q) => q - p);
    this.points.spacing = Math.sqrt((a * b + a * c + b * c || a * a || 1) / points.count);
  }

  texture(bytes) {
    const { gl } = this, made = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, made);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, 256, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
    return made;
  }
  buffer(values) {
    const { gl } = this, made = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, made);
    gl.bufferData(gl.ARRAY_BUFFER, values, gl.STATIC_DRAW);
    return made;
  }
  attribute(place, values, size, normalised = false) {
    const { gl } = this;
    this.buffer(values);
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, size, values instanceof Uint8Array ? gl.UNSIGNED_BYTE : gl.FLOAT, normalised, 0, 0);
  }
  dots(positions) {
    const array = this.gl.createVertexArray();
    this.gl.bindVertexArray(array);
    this.attribute(0, positions, 3);
    return { array, count: positions.length / 3 };
  }
  segments(all) {
    const { gl } = this, array = gl.createVertexArray();
    gl.bindVertexArray(array);
    this.buffer(all);
    for (const [place, offset] of [[0, 0], [1, 12]]) {
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, 3, gl.FLOAT, false, 24, offset);
      gl.vertexAttribDivisor(place, 1);
    }
    return { array, count: all.length / 6 };
  }

  // The place that is marked: a point, its foot and the line between, relative to the origin; null for none.
  mark(point, foot) {
    this.marked = point && {
      line: this.segments(new Float32Array([...point, ...foot])),
      point: this.dots(new Float32Array(point)), foot: this.dots(new Float32Array(foot)),
    };
  }

  // The curve of a section, as segments; null for none.
  section(segments) {
    if (this.curve) this.gl.deleteVertexArray(this.curve.array);
    this.curve = segments?.length ? this.segments(segments) : null;
  }

  // The colours of a scale of the settings, as uniforms.
  scale({ scale }) {
    const { gl } = this;
    gl.bindTexture(gl.TEXTURE_2D, this.maps[scale?.map ?? "diverging"]);
    const beyond = BEYOND[scale?.map ?? "diverging"];
    return { map: 0, band: scale?.band ?? 0, low: scale?.low ?? 0, high: scale?.high ?? 1, below: rgb(beyond.below), above: rgb(beyond.above), none: rgb(NO_DATA) };
  }
  value(values) {
    const { gl } = this;
    if (!values) return void gl.disableVertexAttribArray(2);
    gl.bindBuffer(gl.ARRAY_BUFFER, values);
    gl.enableVertexAttribArray(2);
    gl.vertexAttribPointer(2, 2, gl.FLOAT, false, 0, 0);
  }
  // In CSS pixels: about the distance of the points, seen from where the camera is.
  pointSize(camera, settings, height) {
    const close = this.points.spacing / camera.height * height * (this.mesh ? 0.6 : 1.2);
    return Math.min(Math.max(close, this.mesh ? 3 : 1.6), 9) * 2 ** settings.pointSize;
  }

  // `settings`: mode, scale, layers, stripes, pointSize, lift; pixel: of the canvas, in one CSS pixel; dark.
  render(camera, settings) {
    const { gl, canvas, programs } = this, { layers } = settings, ink = INK[settings.dark ? "dark" : "light"];
    const pixel = settings.pixel, screen = [canvas.width, canvas.height];
    const { view, projection } = camera.matrices(screen[0] / screen[1]);
    const common = { view, projection, screen, pixel, perspective: camera.perspective, cut: cutOf(settings), ...this.scale(settings) };
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, ...screen);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    if (this.mesh && layers.surface) {
      const mode = { zebra: 2, faces: 3 }[settings.mode] ?? (this.mesh.values[settings.mode] ? 1 : 0);
      gl.bindVertexArray(this.mesh.array);
      this.value(this.mesh.values[settings.mode]);
      const hatched = ["deviation", "plain", "by_face"].includes(settings.mode);
      programs.surface.use({ ...common, mode, hatched, unsupported: layers.unsupported, plain: ink.surface, stripes: settings.stripes });
      gl.drawElements(gl.TRIANGLES, this.mesh.count, gl.UNSIGNED_INT, 0);
    }
    const lift = settings.lift;
    const coloured = settings.mode === "jumps";
    for (const [layer, name, width] of LINES) {
      const line = coloured && name === "edges" ? this.lines.others : this.lines[name];
      if (layers[layer] && line) this.drawLine(line, { ...common, plain: ink[name], width: width * pixel, lift });
    }
    if (coloured && layers.edges) this.jumps.forEach((line, k) => line && this.drawLine(line, { ...common, plain: rgb(JUMPS[k][1]), width: 4.5 * pixel, lift }));
    if (this.curve) this.drawLine(this.curve, { ...common, cut: 0, plain: ink.section, width: 3 * pixel, lift: 2 * lift });
    if (layers.net && this.net) this.drawDots(this.net, { ...common, plain: ink.control_net, size: 5 * pixel, lift });
    if (layers.seams && this.poles) this.drawDots(this.poles, { ...common, plain: ink.seams, size: 11 * pixel, lift: 2 * lift });
    if (layers.points && this.points) {
      const values = this.points.values[settings.mode], d = camera.distance;
      const size = this.pointSize(camera, settings, canvas.height / pixel) * pixel, { diagonal } = this.data.bounds;
      this.drawDots(this.points, {
        ...common, coloured: !!values, plain: ink.points, rejected: rgb(REJECTED), size, lift,
        least: 5 * pixel, rejects: layers.rejected, ...(this.mesh ? {} : { fade: [d - 0.3 * diagonal, d + 0.6 * diagonal] }),
      }, values);
    }
    if (this.marked) {
      gl.disable(gl.DEPTH_TEST);
      this.drawLine(this.marked.line, { ...common, plain: ink.mark, width: 3 * pixel });
      this.drawDots(this.marked.foot, { ...common, plain: ink.foot, size: 9 * pixel });
      this.drawDots(this.marked.point, { ...common, plain: ink.mark, size: 11 * pixel });
    }
    gl.bindVertexArray(null);
  }

  drawLine(line, uniforms) {
    this.programs.lines.use(uniforms);
    this.gl.bindVertexArray(line.array);
    this.gl.drawArraysInstanced(this.gl.TRIANGLE_STRIP, 0, 4, line.count);
  }
  drawDots(dots, uniforms, values) {
    this.programs.points.use({ fade: [1e30, 2e30], ...uniforms });
    this.gl.bindVertexArray(dots.array);
    this.value(values);
    this.gl.drawArrays(this.gl.POINTS, 0, dots.count);
  }
}

// Layer, lines, width in CSS pixels.
const LINES = [["iso", "iso_curves", 1.1], ["edges", "edges", 2], ["features", "features", 3.4], ["seams", "seams", 2.4], ["net", "control_net", 1.2]];
const INK = {
  light: { surface: "#b9c4d0", edges: "#15181c", features: "#7a1fa2", section: "#000000", seams: "#b0128c", iso_curves: "#4b5a6b", control_net: "#0a7d4b", points: "#22303f", mark: "#d6006c", foot: "#111111" },
  dark: { surface: "#aab6c4", edges: "#f2f5f8", features: "#e58cff", section: "#ffffff", seams: "#ff7ad9", iso_curves: "#22303f", control_net: "#35d08b", points: "#ffe9b0", mark: "#ff4fa3", foot: "#ffffff" },
};
for (const inks of Object.values(INK)) for (const name in inks) inks[name] = rgb(inks[name]);
