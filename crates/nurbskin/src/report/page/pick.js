// What is under the pointer: triangles and points are drawn once per view with their numbers as colours, and read back.

class Picker {
  constructor(scene) {
    this.scene = scene;
    this.stale = true;
  }

  // Draws the numbers, one pixel for each CSS pixel.
  draw(camera, settings, width, height) {
    const { scene } = this, { gl, programs } = scene, { layers } = settings;
    if (!this.frame || this.width !== width || this.height !== height || !gl.isFramebuffer(this.frame)) this.resize(width, height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.frame);
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    const common = { ...camera.matrices(width / height), unsupported: layers.unsupported, cut: cutOf(settings) };
    if (scene.mesh && layers.surface) {
      programs.pickSurface.use(common);
      gl.bindVertexArray(scene.corners);
      gl.drawArrays(gl.TRIANGLES, 0, scene.mesh.count);
    }
    if (scene.points && layers.points) {
      programs.pickPoints.use({ ...common, lift: settings.lift, rejects: layers.rejected, size: Math.max(3, scene.pointSize(camera, settings, height)) });
      gl.bindVertexArray(scene.points.array);
      gl.drawArrays(gl.POINTS, 0, scene.points.count);
    }
    gl.bindVertexArray(null);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    this.stale = false;
  }

  resize(width, height) {
    const { gl } = this.scene;
    Object.assign(this, { width, height, frame: gl.createFramebuffer() });
    gl.deleteRenderbuffer(this.colour ?? null);
    gl.deleteRenderbuffer(this.depth ?? null);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.frame);
    for (const [name, format, place] of [["colour", gl.RGBA8, gl.COLOR_ATTACHMENT0], ["depth", gl.DEPTH_COMPONENT24, gl.DEPTH_ATTACHMENT]]) {
      this[name] = gl.createRenderbuffer();
      gl.bindRenderbuffer(gl.RENDERBUFFER, this[name]);
      gl.renderbufferStorage(gl.RENDERBUFFER, format, width, height);
      gl.framebufferRenderbuffer(gl.FRAMEBUFFER, place, gl.RENDERBUFFER, this[name]);
    }
  }

  // The point nearest to a pixel within `radius`, else the triangle at it: { point } or { triangle } or null.
  at(camera, settings, x, y, radius = 5) {
    const { gl, canvas } = this.scene, width = canvas.clientWidth, height = canvas.clientHeight;
    if (!(width > 0 && height > 0 && x >= 0 && y >= 0 && x < width && y < height)) return null;
    if (this.stale || this.width !== width || this.height !== height) this.draw(camera, settings, width, height);
    const side = 2 * radius + 1, pixels = new Uint8Array(4 * side * side);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.frame);
    gl.readPixels(Math.floor(x) - radius, height - 1 - Math.floor(y) - radius, side, side, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    let best = Infinity, found = null;
    for (let k = 0; k < side * side; k++) {
      const kind = pixels[4 * k + 3], far = (k % side - radius) ** 2 + (Math.floor(k / side) - radius) ** 2;
      const number = pixels[4 * k] | pixels[4 * k + 1] << 8 | pixels[4 * k + 2] << 16;
      if (kind === 170 && far < best && far <= radius * radius) [best, found] = [far, { point: number }];
      if (kind === 85 && far === 0 && !found) found = { triangle: number };
    }
    return found;
  }
}

// Where a line of sight meets the plane of a triangle, as weights of its corners, clamped into it.
function weightsOn(mesh, triangle, ray) {
  const corners = [0, 1, 2].map((k) => mesh.triangles[3 * triangle + k]);
  const [a, b, c] = corners.map((v) => Array.from(mesh.positions.subarray(3 * v, 3 * v + 3)));
  const ab = sub(b, a), ac = sub(c, a), p = cross(ray.direction, ac), det = dot(ab, p);
  let u = 1 / 3, v = 1 / 3;
  if (Math.abs(det) > 0) {
    const t = sub(ray.from, a);
    u = dot(t, p) / det;
    v = dot(ray.direction, cross(t, ab)) / det;
  }
  const weights = [1 - u - v, u, v].map((w) => Math.min(Math.max(w, 0), 1)), sum = weights[0] + weights[1] + weights[2] || 1;
  return { corners, weights: weights.map((w) => w / sum), position: [0, 1, 2].map((k) => (a[k] * weights[0] + b[k] * weights[1] + c[k] * weights[2]) / sum) };
}

// A value between the corners, as the shaders have it: corners without one do not count, NaN where they weigh most.
function blend({ corners, weights }, values, stride = 1, offset = 0) {
  let sum = 0, all = 0;
  corners.forEach((v, k) => {
    const x = values[stride * v + offset];
    if (Number.isFinite(x)) [sum, all] = [sum + weights[k] * x, all + weights[k]];
  });
  return all >= 0.5 ? sum / all : NaN;
}
