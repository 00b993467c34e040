// The 3-D view: scene, camera, overlay and pointer together, and what they show.

class View {
  constructor(data, settings, { lengths, changed, marks, section }) {
    this.data = data;
    this.settings = settings;
    this.lengths = lengths;
    this.changed = changed;
    this.marks = marks;
    this.section = section;
    this.picture = document.getElementById("picture");
    this.canvas = document.getElementById("canvas");
    this.readout = document.getElementById("readout");
    this.overlay = new Overlay(document.getElementById("overlay"));
    this.scene = new Scene(this.canvas, data);
    this.picker = new Picker(this.scene);
    this.camera = new Camera(data.bounds);
    if (section) Object.assign(section, { scene: this.scene, camera: this.camera });
    this.chosen = -1;
    this.pins = data.worst.map((w) => ({ ...w, point: sub(w.point, data.origin), foot: sub(w.foot ?? w.point, data.origin) }));
    this.framed = VIEWS.iso; // all is in view from here, whatever the size of the view, until something else is looked at
    this.camera.set(this.camera.fitted(this.framed, this.aspect));
    this.frames = 0;
    this.listen();
  }

  get width() { return this.canvas.clientWidth || 1; }
  get height() { return this.canvas.clientHeight || 1; }
  get aspect() { return this.width / this.height; }

  listen() {
    steer(this.canvas, this.camera, {
      changed: () => { this.flight = this.framed = null; this.moved(); },
      hover: (x, y) => { this.pointer = [x, y]; this.ask("hovering", () => this.pointer && this.show(this.pointedAt(...this.pointer), ...this.pointer)); },
      leave: () => { this.pointer = null; this.readout.hidden = true; },
      focus: (x, y) => { const found = this.pick(x, y); if (!found) return; this.framed = null; this.fly({ ...this.camera.pose, target: found.local }); },
      key: (key) => this.key(key),
      tap: (x, y) => !!this.marks.tool && this.marks.tap(this.pick(x, y)),
    });
    this.dragging();
    new ResizeObserver(() => this.resized()).observe(this.picture);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.moved());
    this.canvas.addEventListener("webglcontextlost", (e) => { e.preventDefault(); this.lost = true; });
    this.canvas.addEventListener("webglcontextrestored", () => {
      this.lost = false;
      this.scene.build();
      this.section?.changed();
      this.picker = new Picker(this.scene);
      this.choose(this.chosen, false);
    });
    addEventListener("beforeprint", () => this.print());
  }

  // The handle of the section's plane: it follows the pointer along the normal, or up and down where this points at the eye.
  dragging() {
    const { svg } = this.overlay, section = this.section;
    let last = null;
    svg.addEventListener("pointerdown", (e) => {
      if (!e.target.closest(".handle")) return;
      e.preventDefault();
      svg.setPointerCapture(e.pointerId);
      last = [e.clientX, e.clientY];
    });
    svg.addEventListener("pointermove", (e) => {
      if (!last) return;
      const step = [e.clientX - last[0], e.clientY - last[1]], long = 0.01 * this.camera.height, { normal } = section.state;
      const [a, b] = [section.handle, add(section.handle, normal, long)].map((p) => this.camera.project(p, this.aspect));
      const way = [(b.x - a.x) / 2 * this.width, -(b.y - a.y) / 2 * this.height], size = Math.hypot(...way);
      last = [e.clientX, e.clientY];
      section.shift(size < 1 ? -step[1] / this.height * this.camera.height : long * (step[0] * way[0] + step[1] * way[1]) / size ** 2);
    });
    for (const name of ["pointerup", "pointercancel"]) svg.addEventListener(name, () => { last = null; });
  }

  // The page gets its final layout only after the first frame, and windows change.
  resized() {
    if (this.framed) {
      this.flight = null;
      this.camera.set(this.camera.fitted(this.framed, this.aspect));
    }
    this.moved();
  }

  key(key) {
    const view = { f: "fit", F: "fit", Home: "fit", 0: "iso", 1: "front", 2: "back", 3: "left", 4: "right", 5: "top", 6: "bottom" }[key];
    if (view) this.look(view);
    else if (key === "p" || key === "P") this.project(!this.camera.perspective);
    else if (key === "Escape") this.marks.tool ? this.marks.choose(null) : this.choose(-1);
    else if (key === "Enter") {
      const [x, y] = [this.width / 2, this.height / 2], found = this.pick(x, y);
      this.show(found, x, y);
      document.getElementById("said").textContent = found ? this.lines(found).map((line) => line.join(" ")).join(", ") : "Nothing in the middle of the view.";
    } else return false;
    return true;
  }

  // Does `what` once before the next frame, however often it is asked for.
  ask(name, what) {
    if (this[name]) return;
    this[name] = requestAnimationFrame(() => { this[name] = 0; what(); });
  }

  moved() {
    this.picker.stale = true;
    this.readout.hidden = true;
    this.ask("drawing", () => this.draw());
  }

  draw() {
    if (this.lost) return;
    const pixel = Math.min(devicePixelRatio || 1, 2), [w, h] = [this.width, this.height].map((x) => Math.max(1, Math.round(x * pixel)));
    if (this.canvas.width !== w || this.canvas.height !== h) [this.canvas.width, this.canvas.height] = [w, h];
    const dark = matchMedia("(prefers-color-scheme: dark)").matches;
    this.scene.render(this.camera, { ...this.settings, pixel, dark });
    this.drawOverlay();
    this.frames++;
    clearTimeout(this.settling);
    if (this.settings.layers.worst && !this.flight) this.settling = setTimeout(() => this.settle(), 120);
    else this.settling = 0;
  }

  drawOverlay() {
    this.overlay.draw(this.camera, {
      width: this.width, height: this.height, chosen: this.chosen, lengths: this.lengths,
      pins: this.settings.layers.worst ? this.pins : [],
      marks: this.shownMarks(),
      gone: (p) => { const [x, y, z, offset] = cutOf(this.settings); return x * p[0] + y * p[1] + z * p[2] - offset > 0; },
      handle: this.section?.handle && { place: this.section.handle, normal: this.section.state.normal },
    });
  }

  shownMarks() {
    const local = (p) => sub(p, this.data.origin), { items, first } = this.marks;
    const found = items.map((item, k) => ({ points: item.points.map(local), label: this.marks.label(item, k), distance: item.kind === "distance" }));
    return first ? [...found, { points: [local(first)], label: "from here", distance: false }] : found;
  }

  // Whether nothing is about to change.
  get resting() { return !this.drawing && !this.settling && !this.flight; }

  // Numbers of places behind the surface fade once the view rests.
  settle() {
    this.settling = 0;
    const before = this.overlay.hidden.join();
    this.overlay.hidden = this.pins.map((pin) => {
      const { x, y, depth } = this.camera.project(pin.point, this.aspect);
      const found = depth > 0 && this.pick((x + 1) / 2 * this.width, (1 - y) / 2 * this.height, 0);
      return !!found && found.kind === "surface" && this.camera.project(found.local, this.aspect).depth < depth - this.settings.lift;
    });
    if (this.overlay.hidden.join() !== before) this.drawOverlay();
  }

  // What is at a place of the canvas in CSS pixels: a point of the scan or a place of the surface, or null.
  pick(x, y, radius) {
    if (this.lost) return null;
    const { mesh, points, origin, faces } = this.data, found = this.picker.at(this.camera, this.settings, x, y, radius);
    const face = (k) => (faces.length ? faces[k]?.name || `${k}` : undefined);
    if (found?.point !== undefined && points) {
      const i = found.point, local = Array.from(points.positions.subarray(3 * i, 3 * i + 3));
      const parameters = points.parameters?.subarray(2 * i, 2 * i + 2);
      return {
        kind: "point", index: points.index?.[i] ?? i, local, position: add(local, origin), deviation: points.deviation?.[i],
        u: parameters?.[0], v: parameters?.[1], face: points.faces ? face(points.faces[i]) : undefined, state: STATES[points.state[i]],
      };
    }
    if (found?.triangle === undefined || !mesh) return null;
    const ray = this.camera.ray(2 * x / this.width - 1, 1 - 2 * y / this.height, this.aspect), on = weightsOn(mesh, found.triangle, ray);
    return {
      kind: "surface", local: on.position, position: add(on.position, origin),
      deviation: mesh.deviation ? blend(on, mesh.deviation) : undefined,
      u: mesh.parameters ? blend(on, mesh.parameters, 2, 0) : undefined, v: mesh.parameters ? blend(on, mesh.parameters, 2, 1) : undefined,
      face: mesh.faces ? face(mesh.faces[on.corners[0]]) : undefined,
      mean: mesh.mean ? blend(on, mesh.mean) : undefined, gaussian: mesh.gaussian ? blend(on, mesh.gaussian) : undefined,
    };
  }

  // What is picked, with the nearest edge where the colours of edges are shown.
  pointedAt(x, y) {
    const found = this.pick(x, y);
    if (found && this.settings.mode === "jumps" && this.settings.layers.edges) found.edge = this.edgeAt(x, y, found.local);
    return found;
  }

  // The edge within a few pixels of a place of the canvas and as near as what is seen there, as lines of a read-out.
  edgeAt(x, y, near) {
    const { lines: { edges }, joins, bounds } = this.data, p = edges?.positions ?? [], reach = 8;
    let best = reach, found = null, start = 0;
    for (const [k, length] of (edges?.lengths ?? []).entries()) {
      let before = null;
      for (let i = 3 * start; i < 3 * (start + length); i += 3) {
        const place = [p[i], p[i + 1], p[i + 2]], at = this.camera.project(place, this.aspect);
        const pixel = at.depth > 0 ? [(at.x + 1) / 2 * this.width, (1 - at.y) / 2 * this.height, place] : null;
        if (before && pixel && Math.hypot(...sub(place, near)) < 0.1 * bounds.size) {
          const [dx, dy] = [pixel[0] - before[0], pixel[1] - before[1]], t = ((x - before[0]) * dx + (y - before[1]) * dy) / (dx * dx + dy * dy || 1);
          const s = Math.min(Math.max(t, 0), 1), far = Math.hypot(x - before[0] - s * dx, y - before[1] - s * dy);
          if (far < best) [best, found] = [far, joins[k]];
        }
        before = pixel;
      }
      start += length;
    }
    if (!found) return null;
    const angle = Number.isFinite(jumpOf(found)) ? [["normals turn by", `${found.bound === null ? "about" : "at most"} ${exact(jumpOf(found), 2)}°`]] : [];
    return [["edge", `${found.edge}, ${found.kind === "open" ? "border" : found.kind ?? "several faces"}`], ...angle];
  }

  // A read-out as pairs of name and text.
  lines(found) {
    const { unit, bounds } = this.data, place = formatter(bounds.diagonal, 6), parameter = formatter(1, 5), { mode } = this.settings;
    const of = unit ? ` ${unit}` : "", lines = [found.kind === "point" ? ["Point", count(found.index)] : ["Surface", ""]];
    if (found.deviation !== undefined) {
      lines.push(["deviation", Number.isFinite(found.deviation) ? this.lengths.alone(found.deviation, true) : found.kind === "point" ? "none" : "no data under it"]);
    }
    ["x", "y", "z"].forEach((name, k) => lines.push([name, place(found.position[k]) + of]));
    if (Number.isFinite(found.u)) lines.push(["u, v", `${parameter(found.u)}, ${parameter(found.v)}`]);
    if (found.face !== undefined && this.data.faces.length > 1) lines.push(["face", found.face]);
    if (found.state) lines.push(["state", found.state]);
    if (mode === "jumps" && found.edge) lines.push(...found.edge);
    if (["mean", "gaussian"].includes(mode) && found[mode] !== undefined) {
      const { scale } = this.settings;
      lines.push([scale.title.toLowerCase(), `${formatter(scale.high, 3)(found[mode], true)} ${scale.unit}`]);
    }
    return lines;
  }

  show(found, x, y) {
    this.readout.hidden = !found;
    if (!found) return;
    const scale = this.settings.scale, swatch = scale && Number.isFinite(found[this.settings.mode]) ? scaleColour(scale, found[this.settings.mode]) : null;
    const rows = this.lines(found).map(([name, text]) => element("div", {}, element("dt", {}, name), element("dd", {}, text)));
    if (swatch) rows[0].append(element("i", { style: `background:${swatch}` }));
    this.readout.replaceChildren(...rows);
    const [w, h] = [this.readout.offsetWidth, this.readout.offsetHeight];
    this.readout.style.left = `${Math.max(4, x + 16 + w > this.width ? x - w - 16 : x + 16)}px`;
    this.readout.style.top = `${Math.min(Math.max(4, y - h / 2), Math.max(4, this.height - h - 4))}px`;
  }

  look(name) {
    this.framed = name === "fit" ? this.camera.rotation : VIEWS[name];
    this.fly(this.camera.fitted(this.framed, this.aspect));
  }
  project(perspective) {
    this.camera.perspective = perspective;
    this.framed = null;
    document.getElementById("perspective").setAttribute("aria-pressed", perspective);
    this.moved();
  }

  // Moves the camera to a pose; the promise is kept when it is there.
  fly(pose) {
    const from = this.camera.pose, still = matchMedia("(prefers-reduced-motion: reduce)").matches, begun = performance.now();
    return new Promise((done) => {
      const step = this.flight = () => {
        if (this.flight !== step) return done();
        const t = still ? 1 : Math.min(1, (performance.now() - begun) / 450), e = t * t * (3 - 2 * t);
        if (t === 1) this.flight = null;
        this.camera.set(t === 1 ? pose : {
          rotation: between(from.rotation, pose.rotation, e), target: mix(from.target, pose.target, e),
          height: from.height * (pose.height / from.height) ** e,
        });
        this.moved();
        if (t === 1) requestAnimationFrame(() => done());
        else requestAnimationFrame(step);
      };
      step();
    });
  }

  // Marks a worst place and goes there; -1 for none.
  choose(k, go = true) {
    this.chosen = k;
    const pin = this.pins[k];
    this.scene.mark(pin?.point ?? null, pin?.foot);
    this.changed(k);
    if (!pin || !go) return void this.moved();
    document.getElementById("said").textContent = `Worst place ${k + 1}: ${this.lengths.alone(pin.deviation, true)}`;
    return this.approach(pin);
  }

  // Goes to a place of the file's coordinates and marks it.
  visit(place) {
    const point = sub(place, this.data.origin), near = 1e-6 * this.data.bounds.diagonal;
    const known = this.pins.findIndex((pin) => Math.hypot(...sub(pin.point, point)) < near);
    if (known >= 0) return this.choose(known);
    this.choose(-1, false);
    this.scene.mark(point, point);
    document.getElementById("said").textContent = `At ${place.join(", ")}`;
    return this.approach({ point, foot: point, deviation: 0 });
  }

  approach(pin) {
    this.framed = null;
    this.picture.scrollIntoView({ block: "nearest" });
    const normal = this.normalAt(pin), { size } = this.data.bounds;
    // Aslant, so that the line between point and foot is seen from the side.
    let over = sub(Z, normal.map((x) => x * normal[2]));
    if (Math.hypot(...over) < 0.2) over = sub(X, normal.map((x) => x * normal[0]));
    const from = add(normal.map((x) => 0.72 * x), unit(over), -0.35), across = unit(cross(normal, unit(over)));
    const near = Math.min(Math.max(18 * Math.abs(pin.deviation || 0), 0.03 * size), 0.6 * size);
    // However far apart, both ends of the line are seen.
    const height = Math.max(near, 2.4 * Math.hypot(...sub(pin.point, pin.foot)) / Math.min(1, this.aspect));
    return this.fly({ rotation: lookFrom(add(from, across, 0.6), Z), target: mix(pin.point, pin.foot, 0.5), height });
  }

  normalAt({ point, foot, deviation }) {
    const { mesh } = this.data, away = sub(point, foot);
    if (mesh?.normals) {
      let best = Infinity, found = 0;
      for (let i = 0; i < mesh.positions.length; i += 3) {
        const d = (mesh.positions[i] - foot[0]) ** 2 + (mesh.positions[i + 1] - foot[1]) ** 2 + (mesh.positions[i + 2] - foot[2]) ** 2;
        if (d < best) [best, found] = [d, i];
      }
      return unit(Array.from(mesh.normals.subarray(found, found + 3)));
    }
    return Math.hypot(...away) > 0 ? unit(away).map((x) => x * Math.sign(deviation || 1)) : this.camera.axes[2];
  }

  // The view on a canvas of its own, `fine` times as fine as the screen.
  rendered(fine, dark, width = this.width, height = this.height, settings = this.settings) {
    const { canvas } = this, [w, h] = [canvas.width, canvas.height];
    [canvas.width, canvas.height] = [width * fine, height * fine].map(Math.round);
    this.scene.render(this.camera, { ...settings, pixel: fine, dark });
    const copy = element("canvas", { width: canvas.width, height: canvas.height });
    copy.getContext("2d").drawImage(canvas, 0, 0);
    [canvas.width, canvas.height] = [w, h];
    return copy;
  }
  // As the address of a PNG of this size, on white.
  picture64(width, height, settings) {
    return this.rendered(1, false, width, height, settings).toDataURL("image/png");
  }

  print() {
    if (this.lost) return;
    document.getElementById("snapshot").src = this.rendered(Math.max(1, 1800 / this.width), false).toDataURL("image/png");
    this.picture.style.setProperty("--aspect", `${this.width} / ${this.height}`);
    printViews(this, document.getElementById("print-views"));
    this.marks.print();
    this.draw();
  }
}
