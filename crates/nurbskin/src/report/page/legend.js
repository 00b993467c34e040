// The legend of a scale: its colours, ticks, the tolerance, what lies beyond it, and what grey and the points' marks mean.

// `scale`: map, low, high, offset of the ticks, symmetric, title, unit, factor from the data to it, format, tolerance or null; `lying` or standing.
function scaleBar(scale, lying, length) {
  const thick = 18, gap = 9, cap = 12, text = 8, along = length - 2 * (cap + gap);
  const place = (x) => cap + gap + along * (scale.high > scale.low ? (x - scale.low) / (scale.high - scale.low) : 0.5);
  const side = lying ? 8 : 24; // room for the tolerance
  // One drawing for both directions: `a` runs from the low to the high end, `b` across.
  const box = (a, size, b, wide, rest) => lying
    ? element("rect", { x: a, y: b, width: size, height: wide, ...rest })
    : element("rect", { x: b, y: length - a - size, width: wide, height: size, ...rest });
  const stroke = (a, b, to, rest) => lying
    ? element("line", { x1: a, x2: a, y1: b, y2: to, ...rest })
    : element("line", { y1: length - a, y2: length - a, x1: b, x2: to, ...rest });
  const label = (a, content, rest = {}) => lying
    ? element("text", { x: a, y: side + thick + 16, "text-anchor": "middle", ...rest }, content)
    : element("text", { y: length - a + 4, x: side + thick + text, ...rest }, content);
  const svg = element("svg", {
    class: "bar", role: "img", width: lying ? length : side + thick + 74, height: lying ? side + thick + 36 : length,
    "aria-label": `Colour scale from ${scale.format(scale.low, true)} to ${scale.format(scale.high, true)} ${scale.unit}`,
  });
  const stops = gradientOf(scale).map(([offset, colour]) => element("stop", { offset, "stop-color": colour }));
  const axis = lying ? { x1: 0, x2: 1, y1: 0, y2: 0 } : { x1: 0, x2: 0, y1: 1, y2: 0 };
  svg.append(element("defs", {}, element("linearGradient", { id: "scale-colours", ...axis }, ...stops)));
  svg.append(box(cap + gap, along, side, thick, { fill: "url(#scale-colours)", class: "outlined" }));
  const beyond = BEYOND[scale.map];
  if (scale.symmetric) {
    svg.append(box(0.5, cap - 1, side, thick, { fill: beyond.below, class: "outlined" }), box(length - cap + 0.5, cap - 1, side, thick, { fill: beyond.above, class: "outlined" }));
    if (!lying) svg.append(label(cap / 2, "beyond"), label(length - cap / 2, "beyond"));
    else svg.append(label(cap / 2, "beyond", { y: side + thick + 31, "text-anchor": "start", x: 0 }), label(length, "beyond", { y: side + thick + 31, "text-anchor": "end" }));
  }
  const { offset = 0, factor = 1 } = scale, range = [factor * (scale.low + offset), factor * (scale.high + offset), lying ? 3 : 6], write = stepped(tickStep(...range));
  const ending = (x) => Math.min(place(x) - place(scale.low), place(scale.high) - place(x)) < (lying ? 50 : 14);
  const inner = ticks(...range).map((x) => [x / factor - offset, write(x, scale.symmetric)]).filter(([x]) => !ending(x));
  // All of one value: it is said once, beside its colour in the middle.
  const ends = scale.high > scale.low ? [scale.low, scale.high] : [scale.low];
  for (const [x, text] of [...inner, ...ends.map((x) => [x, scale.format(x, scale.symmetric)])]) {
    svg.append(stroke(place(x), side + thick, side + thick + 5, { class: "tick" }), label(place(x), text));
  }
  const tolerance = scale.tolerance;
  if (tolerance && tolerance <= scale.high) {
    for (const x of [-tolerance, tolerance]) {
      const a = place(x), at = lying ? `M${a} ${side}l-5 -8h10z` : `M${side} ${length - a}l-8 -5v10z`;
      svg.append(stroke(a, side, side + thick, { class: "limit" }), element("path", { d: at, class: "limit-mark" }));
      if (!lying) svg.append(element("text", { x: 0, y: length - a + 4, class: "limit-text" }, `${x < 0 ? "\u2212" : "+"}t`));
    }
  }
  return svg;
}

// `swatches` are pairs of a class, or of a colour, and what it means.
function drawLegend(into, { scale, note, swatches, lying }) {
  const parts = [];
  if (scale) {
    parts.push(element("p", { class: "legend-title" }, element("strong", {}, scale.title), scale.unit ? `, ${scale.unit}` : ""));
    if (scale.note) parts.push(element("p", { class: "quiet" }, scale.note));
    parts.push(scaleBar(scale, lying, lying ? Math.max(200, into.clientWidth - 24) : Math.min(320, Math.max(170, into.parentElement.clientHeight - 250))));
    const t = scale.tolerance;
    if (t) parts.push(element("p", { class: "quiet" }, t <= scale.high ? `\u25B6 t = tolerance, ${scale.alone(t, false, 5)}` : `The tolerance, ±${scale.alone(t, false, 5)}, is beyond the scale.`));
  }
  if (note) parts.push(element("p", { class: "quiet" }, note));
  for (const [kind, text] of swatches) parts.push(element("p", { class: "swatch" }, element("i", kind.startsWith("#") ? { class: "line", style: `background:${kind}` } : { class: kind }), text));
  into.replaceChildren(...parts);
}
