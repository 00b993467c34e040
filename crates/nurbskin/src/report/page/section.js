// A section: a plane through the surface, the curve in which it cuts it, and the deviation along that curve as whiskers.

// Normal, and the directions to the right and upwards of the drawing, by the name of the plane.
const PLANES = {
  x: { normal: [1, 0, 0], right: [0, 1, 0], up: [0, 0, 1] },
  y: { normal: [0, 1, 0], right: [1, 0, 0], up: [0, 0, 1] },
  z: { normal: [0, 0, 1], right: [1, 0, 0], up: [0, 1, 0] },
};

// The segments in which a plane cuts the triangles: both ends of each with their place, deviation and normal.
function cutMesh(mesh, normal, offset) {
  const { positions: p, triangles, normals, deviation } = mesh, found = [];
  const height = (v) => normal[0] * p[3 * v] + normal[1] * p[3 * v + 1] + normal[2] * p[3 * v + 2] - offset;
  for (let t = 0; t < triangles.length; t += 3) {
    const corners = [triangles[t], triangles[t + 1], triangles[t + 2]], heights = corners.map(height);
    const over = heights.map((h) => h >= 0);
    if (over[0] === over[1] && over[1] === over[2]) continue;
    const ends = [];
    for (let k = 0; k < 3; k++) {
      const m = (k + 1) % 3;
      if (over[k] === over[m]) continue;
      // From the lower number on, so that neighbours find the same place.
      const [a, b, ha, hb] = corners[k] < corners[m] ? [corners[k], corners[m], heights[k], heights[m]] : [corners[m], corners[k], heights[m], heights[k]];
      const s = ha / (ha - hb), at = (list, width, i) => list[width * a + i] + s * (list[width * b + i] - list[width * a + i]);
      ends.push({
        point: [0, 1, 2].map((i) => at(p, 3, i)), normal: normals ? [0, 1, 2].map((i) => at(normals, 3, i)) : null,
        deviation: deviation ? at(deviation, 1, 0) : NaN,
      });
    }
    if (ends.length === 2) found.push(ends);
  }
  return found;
}

// The range of the offsets of a plane that cuts the surface.
function rangeAlong({ positions }, normal) {
  let low = Infinity, high = -Infinity;
  for (let i = 0; i + 2 < positions.length; i += 3) {
    const h = normal[0] * positions[i] + normal[1] * positions[i + 1] + normal[2] * positions[i + 2];
    if (h < low) low = h;
    if (h > high) high = h;
  }
  return [low, high];
}

// The figures of the deviation along a cut, by length.
function alongCut(segments) {
  let length = 0, bare = 0, sum = 0, low = Infinity, high = -Infinity;
  for (const [a, b] of segments) {
    const long = Math.hypot(...sub(b.point, a.point)), d = (a.deviation + b.deviation) / 2;
    length += long;
    if (Number.isFinite(d)) {
      sum += long * d;
      low = Math.min(low, a.deviation, b.deviation);
      high = Math.max(high, a.deviation, b.deviation);
    } else bare += long;
  }
  return { length, bare, mean: sum / (length - bare), low, high };
}

// The largest 1, 2 or 5 times a power of ten with which deviations are drawn a fifteenth of the drawing long.
function magnification(segments, extent, tolerance) {
  const sizes = segments.flat().map(({ deviation }) => Math.abs(deviation)).filter(Number.isFinite).sort((a, b) => a - b);
  const common = Math.max(sizes[Math.floor(0.95 * sizes.length)] ?? 0, Math.min(tolerance ?? 0, 3 * (sizes.at(-1) ?? 0)));
  return common > 0 ? nice(extent / 15 / common) : 1;
}

// Whiskers about this many times across the drawing.
const WHISKERS = 110;

// Draws a cut in its plane: the surface, the tolerance, and whiskers whose length is the deviation, `times` enlarged.
function drawSection(into, segments, { right, up }, { scale, lengths, tolerance, times }) {
  const flat = segments.map((ends) => ends.map(({ point, normal, deviation }) => {
    const across = normal ? [dot(normal, right), dot(normal, up)] : [0, 0], size = Math.hypot(...across);
    return { x: dot(point, right), y: dot(point, up), d: deviation, n: size > 0.2 ? across.map((c) => c / size) : null };
  }));
  const xs = flat.flat().map((e) => e.x), ys = flat.flat().map((e) => e.y);
  const ends = (list) => list.reduce(([a, b], x) => [Math.min(a, x), Math.max(b, x)], [Infinity, -Infinity]);
  const [[x0, x1], [y0, y1]] = [ends(xs), ends(ys)], extent = Math.max(x1 - x0, y1 - y0) || 1;
  const factor = magnification(segments, extent, tolerance) * times;
  const wide = Math.max(280, Math.min(900, into.clientWidth || 640)), room = 46, tallest = 420;
  const pixel = Math.min((wide - 2 * room) / ((x1 - x0) || extent), (tallest - 2 * room) / ((y1 - y0) || extent));
  const tall = Math.max(120, (y1 - y0) * pixel + 2 * room), left = (wide - (x1 - x0) * pixel) / 2;
  const at = (x, y) => `${(left + (x - x0) * pixel).toFixed(1)} ${(tall - room - (y - y0) * pixel).toFixed(1)}`;
  const off = (e, d) => (e.n && Number.isFinite(d) ? at(e.x + factor * d * e.n[0], e.y + factor * d * e.n[1]) : null);
  const line = (of) => flat.map(([a, b]) => [of(a), of(b)]).filter(([a, b]) => a && b).map(([a, b]) => `M${a}L${b}`).join("");
  const told = `Section with ${count(flat.length)} segments; whiskers are the deviation, ${exact(factor, 3)} times enlarged.`;
  const svg = element("svg", { viewBox: `0 0 ${wide} ${tall.toFixed(0)}`, role: "img", "aria-label": told });
  const banded = tolerance && factor * tolerance <= extent / 12; // or it would leave the drawing
  if (banded) for (const side of [-1, 1]) svg.append(element("path", { d: line((e) => off(e, side * tolerance)), class: "band" }));
  const cells = new Set(), cell = extent / WHISKERS;
  for (const [a, b] of flat) {
    const e = { x: (a.x + b.x) / 2, y: (a.y + b.y) / 2, d: (a.d + b.d) / 2, n: a.n }, key = `${Math.floor(e.x / cell)} ${Math.floor(e.y / cell)}`;
    const tip = off(e, e.d);
    if (!tip || cells.has(key)) continue;
    cells.add(key);
    svg.append(element("path", { d: `M${at(e.x, e.y)}L${tip}`, stroke: scale ? scaleColour(scale, e.d) : "currentColor", class: "whisker" },
      element("title", {}, lengths.alone(e.d, true))));
  }
  svg.append(element("path", { d: line((e) => off(e, e.d)), class: "tips" }), element("path", { d: line((e) => at(e.x, e.y)), class: "cut" }));
  const bar = lengths.round(90 / pixel);
  svg.append(element("g", { class: "ruler" }, element("path", { d: `M12 ${tall - 17}v5h${(bar * pixel).toFixed(1)}v-5` }),
    element("text", { x: 12 + bar * pixel / 2, y: tall - 20 }, lengths.alone(bar))));
  into.replaceChildren(svg);
  return { factor, banded };
}

// The section of a view and its controls.
class Section {
  constructor(data, settings, lengths, moved) {
    Object.assign(this, { data, settings, lengths, moved });
    this.by = (id) => document.getElementById(id);
    settings.section = { on: false, away: true, plane: "x", ...PLANES.x, share: 0.5, offset: 0, times: 1 };
    const on = (id, event, what) => this.by(id).addEventListener(event, what);
    on("section", "click", () => this.turn(!this.state.on));
    on("section-plane", "change", (e) => this.choose(e.target.value));
    on("section-place", "input", (e) => this.place(Number(e.target.value) / 1000));
    on("section-times", "input", (e) => { this.state.times = 2 ** Number(e.target.value); this.ask(); });
    on("section-away", "change", (e) => { this.state.away = e.target.checked; this.moved(); });
    on("section-flip", "click", () => this.flip());
  }

  get state() { return this.settings.section; }

  turn(on) {
    this.state.on = on;
    this.by("section").setAttribute("aria-pressed", on);
    this.by("section-tools").hidden = this.by("section-plot").hidden = !on;
    if (on) this.choose(this.state.plane);
    else this.changed();
  }
  // A plane by its name; `view` faces the camera.
  choose(name) {
    const axes = this.camera?.axes;
    Object.assign(this.state, { plane: name }, name === "view" && axes ? { right: axes[0], up: axes[1], normal: axes[2] } : PLANES[name]);
    this.by("section-plane").value = name;
    this.range = rangeAlong(this.data.mesh, this.state.normal);
    this.place(this.state.share);
  }
  // What is cut away is on the other side from now on.
  flip() {
    const { normal, right, share } = this.state;
    Object.assign(this.state, { normal: normal.map((x) => -x), right: right.map((x) => -x) });
    this.range = rangeAlong(this.data.mesh, this.state.normal);
    this.place(1 - share);
  }
  // At a share of the range.
  place(share) {
    // Not on the very ends, nor where the vertices of a symmetric part lie.
    this.state.share = Math.min(Math.max(share, 0), 1);
    const [low, high] = this.range, inside = Math.min(Math.max(this.state.share, 1e-4), 1 - 1e-4) + 1.7e-5;
    this.state.offset = low + inside * (high - low);
    this.by("section-place").value = Math.round(1000 * this.state.share);
    this.changed();
  }
  // By a distance along the normal, as the handle is dragged.
  shift(distance) {
    const [low, high] = this.range;
    this.place(this.state.share + distance / ((high - low) || 1));
  }

  changed() {
    const { on, normal, offset } = this.state;
    this.segments = on ? cutMesh(this.data.mesh, normal, offset) : [];
    this.scene?.section(on ? new Float32Array(this.segments.flatMap(([a, b]) => [...a.point, ...b.point])) : null);
    this.ask();
    this.moved();
  }
  // Where the plane is held: in the middle of the cut.
  get handle() {
    if (!this.state.on) return null;
    const { normal, offset } = this.state, { centre } = this.data.bounds;
    return add(centre, normal, offset - dot(normal, centre));
  }

  ask() {
    if (this.asked) return;
    this.asked = requestAnimationFrame(() => { this.asked = 0; this.draw(); });
  }
  draw() {
    if (!this.state.on) return;
    const { data, lengths, segments } = this, into = this.by("section-plot"), { normal, offset, plane } = this.state;
    const chart = into.querySelector(".chart"), words = into.querySelector("p");
    const along = offset + dot(normal, data.origin), name = plane === "view" ? "view plane" : `${plane} =`;
    const where = plane === "view" ? "" : formatter(data.bounds.diagonal, 5)(normal[{ x: 0, y: 1, z: 2 }[plane]] < 0 ? -along : along);
    this.by("section-where").textContent = `${name} ${where}${where && data.unit ? ` ${data.unit}` : ""}`;
    if (!segments.length) {
      chart.replaceChildren();
      words.textContent = "The plane does not cut the surface.";
      return;
    }
    const { factor, banded } = drawSection(chart, segments, this.state, { scale: this.scale, lengths, tolerance: data.tolerance, times: this.state.times });
    const { length, bare, mean, low, high } = alongCut(segments), known = Number.isFinite(mean);
    words.textContent = `Cut of ${lengths.alone(length)}. ` + (known
      ? `Along it d is from ${lengths.alone(low, true)} to ${lengths.alone(high, true)}, ${lengths.alone(mean, true)} on the average. Whiskers: the deviation of the points around, ${exact(factor, 3)} times enlarged`
        + `${banded ? "; dashed: the tolerance" : ""}.${bare > 0.005 * length ? ` ${percent(bare / length)} of it is without data.` : ""}`
      : "No deviation is known along it.");
  }
}
