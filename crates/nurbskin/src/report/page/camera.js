// A camera that turns about a target. Vectors are arrays of 3, rotations are quaternions [x, y, z, w], matrices are
// columns first as WebGL wants them.

const add = (a, b, s = 1) => [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]];
const sub = (a, b) => add(a, b, -1);
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => a.map((x) => x / (Math.hypot(...a) || 1));
const mix = (a, b, t) => a.map((x, k) => x + (b[k] - x) * t);

function turn(axis, angle) {
  const s = Math.sin(angle / 2);
  return [axis[0] * s, axis[1] * s, axis[2] * s, Math.cos(angle / 2)];
}
function compose(a, b) {
  const v = add(add(cross(a, b), b, a[3]), a, b[3]);
  const q = [...v, a[3] * b[3] - dot(a, b)], length = Math.hypot(...q);
  return q.map((x) => x / length);
}
function rotate(q, v) {
  const t = cross(q, v).map((x) => 2 * x);
  return add(add(v, t, q[3]), cross(q, t));
}
function between(a, b, t) {
  let c = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
  if (c < 0) [b, c] = [b.map((x) => -x), -c];
  if (c > 0.9999) return compose(mix(a, b, t), [0, 0, 0, 1]);
  const angle = Math.acos(c), s = Math.sin(angle);
  return a.map((x, k) => (x * Math.sin((1 - t) * angle) + b[k] * Math.sin(t * angle)) / s);
}
// The rotation of a camera that looks from `direction`, with `up` upwards.
function lookFrom(direction, up) {
  const z = unit(direction);
  let x = cross(up, z);
  if (Math.hypot(...x) < 1e-3) x = cross([0, 1, 0], z);
  if (Math.hypot(...x) < 1e-3) x = [1, 0, 0];
  x = unit(x);
  const y = cross(z, x);
  // Shepperd's method, by the largest of the four.
  const [m, trace] = [[x, y, z], x[0] + y[1] + z[2]];
  if (trace > 0) {
    const s = 2 * Math.sqrt(trace + 1);
    return [(y[2] - z[1]) / s, (z[0] - x[2]) / s, (x[1] - y[0]) / s, s / 4];
  }
  const i = x[0] > y[1] ? (x[0] > z[2] ? 0 : 2) : y[1] > z[2] ? 1 : 2, j = (i + 1) % 3, k = (i + 2) % 3;
  const s = 2 * Math.sqrt(Math.max(1e-12, 1 + m[i][i] - m[j][j] - m[k][k])), q = [0, 0, 0, (m[j][k] - m[k][j]) / s];
  q[i] = s / 4; q[j] = (m[j][i] + m[i][j]) / s; q[k] = (m[k][i] + m[i][k]) / s;
  return q;
}

const X = [1, 0, 0], Z = [0, 0, 1], QUARTER = Math.PI / 2;
const FRONT = turn(X, QUARTER);
const VIEWS = {
  iso: compose(turn(Z, Math.PI / 4), turn(X, Math.atan(Math.SQRT2))),
  front: FRONT, back: compose(turn(Z, Math.PI), FRONT),
  left: compose(turn(Z, -QUARTER), FRONT), right: compose(turn(Z, QUARTER), FRONT),
  top: [0, 0, 0, 1], bottom: turn(X, Math.PI),
};
const TAN = Math.tan((14 * Math.PI) / 180); // half of the angle of view

class Camera {
  constructor(bounds) {
    this.bounds = bounds;
    this.rotation = VIEWS.iso;
    this.target = bounds.centre;
    this.height = bounds.diagonal; // of the view, in the plane of the target
    this.perspective = true;
  }

  get axes() { return [X, [0, 1, 0], Z].map((a) => rotate(this.rotation, a)); }
  get distance() { return this.height / 2 / TAN; }
  get pose() { return { rotation: this.rotation, target: this.target, height: this.height }; }

  // The pose that shows all from a direction, in the middle.
  fitted(rotation, aspect) {
    const axes = [X, [0, 1, 0], Z].map((a) => rotate(rotation, a)), { outline, centre, diagonal } = this.bounds;
    const seen = outline.map((p) => axes.map((a) => dot(a, p))), ends = [0, 1].map(() => [Infinity, -Infinity]);
    for (const p of seen) for (const k of [0, 1]) ends[k] = [Math.min(ends[k][0], p[k]), Math.max(ends[k][1], p[k])];
    const [x, y] = ends.map(([a, b]) => (a <= b ? (a + b) / 2 : 0));
    let need = 0;
    for (const p of seen) need = Math.max(need, Math.max(Math.abs(p[1] - y), Math.abs(p[0] - x) / aspect) + (this.perspective ? TAN * p[2] : 0));
    return { rotation, target: add(add(centre, axes[0], x), axes[1], y), height: 2.14 * need || diagonal };
  }

  set(pose) {
    const { diagonal } = this.bounds;
    this.rotation = pose.rotation;
    this.target = pose.target;
    this.height = Math.min(Math.max(pose.height, 1e-5 * diagonal), 30 * diagonal);
  }

  orbit(dx, dy) {
    const over = this.axes[1][2] < 0 ? -1 : 1; // upside down, the hand still leads
    this.rotation = compose(compose(turn(Z, -dx * over), this.rotation), turn(X, -dy));
  }
  roll(angle) { this.rotation = compose(this.rotation, turn(Z, angle)); }
  // By shares of the height of the view.
  pan(dx, dy) {
    const [right, up] = this.axes;
    this.target = add(add(this.target, right, -dx * this.height), up, -dy * this.height);
  }
  // About a place of the view, in heights from its middle.
  zoom(factor, x = 0, y = 0) {
    const before = this.height;
    this.set({ ...this.pose, height: before * factor });
    const [right, up] = this.axes, moved = before - this.height;
    this.target = add(add(this.target, right, x * moved), up, y * moved);
  }

  matrices(aspect) {
    const axes = this.axes, d = this.distance, [x, y, z] = axes;
    const eye = add(this.target, z, d);
    const view = [x[0], y[0], z[0], 0, x[1], y[1], z[1], 0, x[2], y[2], z[2], 0, ...axes.map((a) => -dot(a, eye)), 1];
    const middle = dot(z, sub(eye, this.bounds.centre)), reach = 1.05 * this.bounds.reach;
    let far = middle + reach, near = middle - reach, projection;
    if (this.perspective) {
      far = Math.max(far, d);
      near = Math.max(near, far / 20000, Math.min(d / 50, far / 2));
      const f = 1 / TAN;
      projection = [f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0, 2 * far * near / (near - far), 0];
    } else {
      const h = 2 / this.height;
      projection = [h / aspect, 0, 0, 0, 0, h, 0, 0, 0, 0, 2 / (near - far), 0, 0, 0, (far + near) / (near - far), 1];
    }
    return { view, projection, eye };
  }

  // Where a place is seen: x and y in -1..=1 of the view, and how far in front of the eye.
  project(p, aspect) {
    const v = sub(p, this.target), [x, y, z] = this.axes.map((a) => dot(a, v));
    const depth = this.distance - z, half = this.perspective ? TAN * depth : this.height / 2;
    return { x: x / (half * aspect), y: y / half, depth };
  }

  // The line of sight through x and y in -1..=1 of the view.
  ray(x, y, aspect) {
    const [right, up, back] = this.axes, half = this.height / 2;
    const through = add(add(this.target, right, x * half * aspect), up, y * half);
    const from = this.perspective ? add(this.target, back, this.distance) : add(through, back, this.distance);
    return { from, direction: unit(sub(through, from)) };
  }
}

// Mouse, fingers and keys on an element; `changed` after every motion of the camera, `hover(x, y)` when it is pointed at.
// and `tap(x, y)` when it is clicked.
function steer(element, camera, { changed, hover, leave, focus, key, tap }) {
  const down = new Map();
  const at = (e) => { const box = element.getBoundingClientRect(); return [e.clientX - box.left, e.clientY - box.top]; };
  let moved = 0;
  element.addEventListener("pointerdown", (e) => {
    element.setPointerCapture(e.pointerId);
    down.set(e.pointerId, at(e));
    moved = 0;
    leave();
  });
  element.addEventListener("pointermove", (e) => {
    const now = at(e), before = down.get(e.pointerId);
    if (!before) return hover(...now);
    const height = element.clientHeight, [dx, dy] = [now[0] - before[0], now[1] - before[1]];
    moved += Math.hypot(dx, dy);
    if (down.size === 2) {
      const other = [...down].find(([id]) => id !== e.pointerId)[1];
      const far = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]) || 1;
      camera.pan(dx / 2 / height, -dy / 2 / height);
      camera.zoom(far(before) / far(now));
    } else if (e.shiftKey || e.buttons & 6) camera.pan(dx / height, -dy / height);
    else camera.orbit((Math.PI * dx) / height, (Math.PI * dy) / height);
    down.set(e.pointerId, now);
    changed();
  });
  const up = (e) => { if (down.delete(e.pointerId) && moved < 4 && e.type === "pointerup" && !(e.button === 0 && tap(...at(e)))) hover(...at(e)); };
  for (const name of ["pointerup", "pointercancel"]) element.addEventListener(name, up);
  element.addEventListener("pointerleave", (e) => e.pointerType !== "touch" && leave());
  element.addEventListener("contextmenu", (e) => e.preventDefault());
  element.addEventListener("dblclick", (e) => focus(...at(e)));
  element.addEventListener("wheel", (e) => {
    e.preventDefault();
    const [x, y] = at(e), h = element.clientHeight, lines = e.deltaMode === 1 ? 30 : 1;
    const step = Math.min(Math.max(e.deltaY * lines, -300), 300);
    camera.zoom(Math.exp(step / 500), (x - element.clientWidth / 2) / h, (h / 2 - y) / h);
    changed();
  }, { passive: false });
  element.addEventListener("keydown", (e) => {
    if (e.ctrlKey || e.metaKey || e.altKey) return;
    const [dx, dy] = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[e.key] ?? [0, 0];
    if (dx || dy) e.shiftKey ? camera.pan(dx / 20, -dy / 20) : camera.orbit(dx / 12, dy / 12);
    else if (e.key === "+" || e.key === "=") camera.zoom(0.85);
    else if (e.key === "-") camera.zoom(1 / 0.85);
    else if (e.key === "[" || e.key === "]") camera.roll(e.key === "[" ? 1 / 12 : -1 / 12);
    else return void (key(e.key) && e.preventDefault());
    e.preventDefault();
    changed();
  });
}
