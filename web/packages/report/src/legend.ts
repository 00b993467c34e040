// The legend of a scale: its colours, ticks, the tolerance, what lies beyond it, and what grey and the points' marks mean.

import { BEYOND, gradientOf, type Scale } from "nurbskin-viewer";
import { drawn, element, type Attributes } from "./dom";
import { stepped, tickStep, ticks, type Form, type Lengths } from "./format";

/** A scale with its words. */
export interface Titled extends Scale {
  title: string;
  note?: string;
  /** The unit of the numbers, and the factor to it from the data. */
  unit: string;
  factor?: number;
  /** Of the ticks, from the data. */
  offset?: number;
  /** About zero: it has colours beyond its ends. */
  symmetric?: boolean;
  format: Form;
  alone?: Lengths["alone"];
  tolerance?: number | null;
}

/** A bar of the colours, `lying` or standing. */
function scaleBar(scale: Titled, lying: boolean, length: number): SVGElement {
  const thick = 18, gap = 9, cap = 12, text = 8, along = length - 2 * (cap + gap);
  const symmetric = scale.symmetric ?? false;
  const share = (x: number): number => (scale.high > scale.low ? (x - scale.low) / (scale.high - scale.low) : 0.5);
  const place = (x: number): number => cap + gap + along * share(x);
  const side = lying ? 8 : 24; // room for the tolerance
  // One drawing for both directions: `a` runs from the low to the high end, `b` across.
  const box = (a: number, size: number, b: number, wide: number, rest: Attributes): SVGElement => lying
    ? drawn("rect", { x: a, y: b, width: size, height: wide, ...rest })
    : drawn("rect", { x: b, y: length - a - size, width: wide, height: size, ...rest });
  const stroke = (a: number, b: number, to: number, rest: Attributes): SVGElement => lying
    ? drawn("line", { x1: a, x2: a, y1: b, y2: to, ...rest })
    : drawn("line", { y1: length - a, y2: length - a, x1: b, x2: to, ...rest });
  const label = (a: number, content: string, rest: Attributes = {}): SVGElement => lying
    ? drawn("text", { x: a, y: side + thick + 16, "text-anchor": "middle", ...rest }, content)
    : drawn("text", { y: length - a + 4, x: side + thick + text, ...rest }, content);
  const svg = drawn("svg", {
    class: "bar", role: "img", width: lying ? length : side + thick + 74, height: lying ? side + thick + 36 : length,
    "aria-label": `Colour scale from ${scale.format(scale.low, true)} to ${scale.format(scale.high, true)} ${scale.unit}`,
  });
  const stops = gradientOf(scale).map(([offset, colour]) => drawn("stop", { offset, "stop-color": colour }));
  const axis = lying ? { x1: 0, x2: 1, y1: 0, y2: 0 } : { x1: 0, x2: 0, y1: 1, y2: 0 };
  svg.append(drawn("defs", {}, drawn("linearGradient", { id: "scale-colours", ...axis }, ...stops)));
  svg.append(box(cap + gap, along, side, thick, { fill: "url(#scale-colours)", class: "outlined" }));
  const beyond = BEYOND[scale.map];
  if (symmetric) {
    svg.append(box(0.5, cap - 1, side, thick, { fill: beyond.below, class: "outlined" }),
      box(length - cap + 0.5, cap - 1, side, thick, { fill: beyond.above, class: "outlined" }));
    if (!lying) svg.append(label(cap / 2, "beyond"), label(length - cap / 2, "beyond"));
    else svg.append(label(cap / 2, "beyond", { y: side + thick + 31, "text-anchor": "start", x: 0 }),
      label(length, "beyond", { y: side + thick + 31, "text-anchor": "end" }));
  }
  const { offset = 0, factor = 1 } = scale, [low, high] = [factor * (scale.low + offset), factor * (scale.high + offset)];
  const range = [low, high, lying ? 3 : 6] as const, write = stepped(tickStep(...range));
  const ending = (x: number): boolean => Math.min(place(x) - place(scale.low), place(scale.high) - place(x)) < (lying ? 50 : 14);
  const inner = ticks(...range).map((x): [number, string] => [x / factor - offset, write(x, symmetric)])
    .filter(([x]) => !ending(x));
  // All of one value: it is said once, beside its colour in the middle.
  const ends = scale.high > scale.low ? [scale.low, scale.high] : [scale.low];
  for (const [x, text] of [...inner, ...ends.map((x): [number, string] => [x, scale.format(x, symmetric)])]) {
    svg.append(stroke(place(x), side + thick, side + thick + 5, { class: "tick" }), label(place(x), text));
  }
  const tolerance = scale.tolerance;
  if (tolerance && tolerance <= scale.high) {
    for (const x of [-tolerance, tolerance]) {
      const a = place(x), at = lying ? `M${a} ${side}l-5 -8h10z` : `M${side} ${length - a}l-8 -5v10z`;
      svg.append(stroke(a, side, side + thick, { class: "limit" }), drawn("path", { d: at, class: "limit-mark" }));
      if (!lying) svg.append(drawn("text", { x: 0, y: length - a + 4, class: "limit-text" }, `${x < 0 ? "\u2212" : "+"}t`));
    }
  }
  return svg;
}

/** Pairs of a class, or of a colour, and what it means. */
export type Swatch = [string, string];

export function drawLegend(into: HTMLElement, { scale, note, swatches, lying }: {
  scale: Titled | null; note: string; swatches: Swatch[]; lying: boolean;
}): void {
  const parts: Node[] = [];
  if (scale) {
    parts.push(element("p", { class: "legend-title" }, element("strong", {}, scale.title), scale.unit ? `, ${scale.unit}` : ""));
    if (scale.note) parts.push(element("p", { class: "quiet" }, scale.note));
    const wide = Math.max(200, into.clientWidth - 24);
    const tall = Math.min(320, Math.max(170, (into.parentElement?.clientHeight ?? 0) - 250));
    parts.push(scaleBar(scale, lying, lying ? wide : tall));
    const t = scale.tolerance, { alone } = scale;
    if (t && alone) parts.push(element("p", { class: "quiet" },
      t <= scale.high ? `\u25B6 t = tolerance, ${alone(t, false, 5)}`
      : `The tolerance, ±${alone(t, false, 5)}, is beyond the scale.`));
  }
  if (note) parts.push(element("p", { class: "quiet" }, note));
  for (const [kind, text] of swatches) parts.push(element("p", { class: "swatch" },
    element("i", kind.startsWith("#") ? { class: "line", style: `background:${kind}` } : { class: kind }), text));
  into.replaceChildren(...parts);
}
