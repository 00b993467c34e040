// What lies over the picture as SVG: the numbers of the worst places, the axes, and a bar of known length.

class Overlay {
  constructor(svg) {
    this.svg = svg;
    this.hidden = []; // worst places behind the surface
  }

  // `gone(place)`: whether a place is cut away.
  draw(camera, { width, height, pins, chosen, lengths, marks, handle, gone }) {
    const aspect = width / height, parts = [];
    this.svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    const seen = (p) => {
      const { x, y, depth } = camera.project(p, aspect);
      return depth > 0 ? [(x + 1) / 2 * width, (1 - y) / 2 * height] : null;
    };
    pins.forEach((pin, k) => {
      const at = seen(pin.point);
      if (!at || k === chosen || gone(pin.point)) return;
      const group = element("g", { class: this.hidden[k] ? "pin behind" : "pin", transform: `translate(${at.map((x) => x.toFixed(1)).join(" ")})` });
      group.append(element("circle", { r: 3 }), element("path", { d: "M0 0L9 -13" }), element("circle", { cx: 13, cy: -19, r: 9 }), element("text", { x: 13, y: -15 }, `${k + 1}`));
      parts.push(group);
    });
    if (pins[chosen]) {
      const at = seen(pins[chosen].point);
      if (at) {
        const text = `${chosen + 1}: ${lengths.alone(pins[chosen].deviation, true)}`, wide = 8 * text.length + 14;
        const x = at[0] + 18 + wide > width ? -18 - wide : 18;
        parts.push(element("g", { class: "chosen", transform: `translate(${at.map((v) => v.toFixed(1)).join(" ")})` },
          element("circle", { r: 11 }), element("path", { d: x > 0 ? "M11 0H18" : "M-11 0H-18" }), element("rect", { x, y: -12, width: wide, height: 24, rx: 5 }),
          element("text", { x: x + wide / 2, y: 5 }, text)));
      }
    }
    parts.push(...this.marks(marks, seen, width), ...this.handle(handle, camera, seen));
    parts.push(this.axes(camera, height), this.ruler(camera, width, height, lengths));
    this.svg.replaceChildren(...parts);
  }

  // Distances and notes: { points, label, distance }, relative to the origin.
  marks(marks, seen, width) {
    return marks.flatMap(({ points, label, distance }) => {
      const ends = points.map(seen);
      if (ends.some((at) => !at)) return [];
      const [x, y] = distance ? [0, 1].map((i) => (ends[0][i] + ends[1][i]) / 2) : ends[0], wide = 7.2 * label.length + 14;
      const left = distance ? x - wide / 2 : x + 14 + wide > width ? x - 14 - wide : x + 14, top = distance ? y - 30 : y - 34;
      return [element("g", { class: "mark" }, element("path", { d: distance ? `M${ends.map((at) => at.map((v) => v.toFixed(1)).join(" ")).join("L")}` : `M${x} ${y}L${left < x ? left + wide : left} ${top + 20}` }),
        ...ends.map(([cx, cy]) => element("circle", { cx: cx.toFixed(1), cy: cy.toFixed(1), r: 4 })),
        element("rect", { x: left.toFixed(1), y: top.toFixed(1), width: wide, height: 22, rx: 4 }), element("text", { x: (left + wide / 2).toFixed(1), y: (top + 15).toFixed(1) }, label))];
    });
  }

  // What drags the plane of a section: an arrow along its normal.
  handle(handle, camera, seen) {
    if (!handle) return [];
    const at = seen(handle.place), to = seen(add(handle.place, handle.normal, 0.01 * camera.height));
    if (!at || !to) return [];
    const way = [to[0] - at[0], to[1] - at[1]], angle = Math.hypot(...way) < 1 ? -90 : Math.atan2(way[1], way[0]) * 180 / Math.PI;
    return [element("g", { class: "handle", transform: `translate(${at.map((v) => v.toFixed(1)).join(" ")}) rotate(${angle.toFixed(1)})` },
      element("circle", { r: 15 }), element("path", { d: "M-26 0H26M-19 -6L-26 0L-19 6M19 -6L26 0L19 6" }))];
  }

  axes(camera, height) {
    const [right, up, back] = camera.axes, group = element("g", { class: "axes", transform: `translate(42 ${height - 42})` });
    const ends = [0, 1, 2].map((k) => ({ k, x: 27 * right[k], y: -27 * up[k], z: back[k] })).sort((a, b) => a.z - b.z);
    for (const { k, x, y } of ends) {
      group.append(element("line", { x2: x, y2: y, class: `axis-${"xyz"[k]}` }), element("text", { x: x * 1.4, y: y * 1.4 + 4 }, "xyz"[k]));
    }
    return group;
  }

  // True in the plane of the middle of the view.
  ruler(camera, width, height, lengths) {
    const model = lengths.round(camera.height / height * Math.min(140, width / 4)), pixels = model / camera.height * height;
    const x = 96, y = height - 22, label = lengths.alone(model);
    return element("g", { class: "ruler" }, element("path", { d: `M${x} ${y - 5}v5h${pixels.toFixed(1)}v-5` }), element("text", { x: x + pixels / 2, y: y - 7 }, label));
  }
}
