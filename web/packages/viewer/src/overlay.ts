// What lies over the picture as SVG: numbered places, distances and notes, the handle of a section, the axes, and a bar of
// known length.

import type { Camera } from "./camera";
import { add, type Vector } from "./vectors";

/** How lengths are written. */
export interface Lengths {
  /** With its unit. */
  alone(length: number, plus?: boolean): string;
  /** The largest length up to this one that is 1, 2 or 5 times a power of ten of its unit. */
  round(length: number): number;
}

/** A numbered place, relative to the origin. */
export interface Pin {
  point: Vector;
  /** The nearest place of the surface. */
  foot: Vector;
  /** Signed distance between them; places that have none are approached as if it were zero. */
  deviation: number;
  /** Its number or sign, and what stands beside it when it is chosen. */
  text: string;
  chosenText: string;
  /** What it is, for screen readers and as a tip, where it can be clicked. */
  label?: string;
  /** A finding of a check, not a distance. */
  finding?: boolean;
}

/** A distance between two places, or a note at one. */
export interface Mark {
  points: Vector[];
  label: string;
  distance: boolean;
}

/** What drags the plane of a section: an arrow along its normal. */
export interface Handle {
  place: Vector;
  normal: Vector;
}

/** What is over a picture of this size, in CSS pixels. */
export interface Overlaid {
  width: number;
  height: number;
  chosen: number;
  pinned: boolean;
  marks: Mark[];
  handle: Handle | null;
  lengths: Lengths;
  /** Whether a place is cut away. */
  gone: (place: Vector) => boolean;
}

/** In the document once per overlay, and in the pictures that are made of it. */
const STYLE = `
.viewer-overlay { --limit: #a3005c; --halo: #fff; position: absolute; inset: 0; width: 100%; height: 100%; pointer-events: none; }
.viewer-overlay[data-theme="dark"] { --limit: #ff86c3; --halo: #1d2227; }
@media print { .viewer-overlay { --limit: #a3005c; --halo: #fff; } }
.viewer-overlay text { fill: currentColor; font-size: 12px; font-variant-numeric: tabular-nums; }
.viewer-overlay .pin circle { fill: #fff; stroke: #14181d; stroke-width: 1.4; }
.viewer-overlay .pin circle:first-child { fill: #14181d; stroke: #fff; }
.viewer-overlay .pin path { stroke: #14181d; stroke-width: 1.4; }
.viewer-overlay .pin text { fill: #14181d; font-size: 11px; font-weight: 600; text-anchor: middle; }
.viewer-overlay .pin.finding circle:not(:first-child) { fill: #ffe7a8; }
.viewer-overlay .pin.live { pointer-events: all; cursor: pointer; }
.viewer-overlay .pin.live .target { fill: transparent; stroke: none; }
.viewer-overlay .pin.taken > * { opacity: 0; }
.viewer-overlay .behind { opacity: .35; }
.viewer-overlay .chosen circle { fill: none; stroke: var(--limit); stroke-width: 2.5; }
.viewer-overlay .chosen path { stroke: var(--limit); stroke-width: 2; }
.viewer-overlay .chosen rect { fill: #fff; stroke: #a3005c; stroke-width: 1.5; }
.viewer-overlay .chosen text { fill: #14181d; font-weight: 600; font-size: 13px; text-anchor: middle; }
.viewer-overlay .axes line { stroke-width: 2.5; stroke-linecap: round; }
.viewer-overlay .axes text { text-anchor: middle; font-weight: 600; }
.viewer-overlay .axes, .viewer-overlay .ruler { filter: drop-shadow(0 0 1px var(--halo)) drop-shadow(0 0 2px var(--halo)); }
.viewer-overlay .axis-x { stroke: #d33; } .viewer-overlay .axis-y { stroke: #2a8f3c; } .viewer-overlay .axis-z { stroke: #3a74e8; }
.viewer-overlay .ruler path { fill: none; stroke: currentColor; stroke-width: 1.5; }
.viewer-overlay .ruler text { text-anchor: middle; }
.viewer-overlay .mark path { stroke: var(--limit); stroke-width: 2; fill: none; }
.viewer-overlay .mark circle { fill: #fff; stroke: #a3005c; stroke-width: 2; }
.viewer-overlay .mark rect { fill: #fff; stroke: #a3005c; stroke-width: 1.2; }
.viewer-overlay .mark text { fill: #14181d; font-weight: 600; text-anchor: middle; }
.viewer-overlay .handle { pointer-events: all; cursor: move; touch-action: none; }
.viewer-overlay .handle circle { fill: #ffffffd0; stroke: #0b57b0; stroke-width: 2; }
.viewer-overlay .handle path { fill: none; stroke: #0b57b0; stroke-width: 2.4; stroke-linecap: round; }`;

type Seen = (place: Vector) => [number, number] | null;

/** Widths of letters of the labels, about, in CSS pixels. */
const LETTER = 7.2, BOLD_LETTER = 8;

export class Overlay {
  /** Which of the pins are behind the surface. */
  hidden: boolean[] = [];
  private pins: { pin: Pin; group: SVGElement }[] = [];
  private readonly places = svg("g", {});
  private readonly rest = svg("g", {});

  constructor(readonly svg: SVGSVGElement) {
    const style = svgElement("style");
    style.textContent = STYLE;
    this.svg.classList.add("viewer-overlay");
    this.svg.replaceChildren(style, this.places, this.rest);
  }

  /** The numbered places; `clicked` is called for one that is clicked, where they can be. */
  setPins(pins: readonly Pin[], clicked: ((k: number) => void) | null): void {
    this.hidden = [];
    this.pins = pins.map((pin, k) => {
      const group = svg("g", { class: "pin" }, svg("circle", { r: 3 }), svg("path", { d: "M0 0L9 -13" }),
        svg("circle", { cx: 13, cy: -19, r: 9 }), svg("text", { x: 13, y: -15 }, pin.text));
      if (clicked) {
        group.append(svg("circle", { class: "target", cx: 11, cy: -16, r: 14 }), svg("title", {}, pin.label ?? pin.text));
        const attributes = { role: "button", tabindex: "0", "aria-label": pin.label ?? pin.text };
        for (const [name, value] of Object.entries(attributes)) group.setAttribute(name, value);
        group.addEventListener("click", () => { clicked(k); });
        group.addEventListener("keydown", (event) => {
          if (event.key !== "Enter" && event.key !== " ") return;
          event.preventDefault();
          clicked(k);
        });
      }
      return { pin, group };
    });
    this.live = !!clicked;
    this.places.replaceChildren(...this.pins.map(({ group }) => group));
  }
  private live = false;

  draw(camera: Camera, over: Overlaid): void {
    const { width, height, chosen, pinned, gone, lengths } = over, aspect = width / height;
    this.svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    const seen: Seen = (place) => {
      const { x, y, depth } = camera.project(place, aspect);
      return depth > 0 ? [(x + 1) / 2 * width, (1 - y) / 2 * height] : null;
    };
    this.pins.forEach(({ pin, group }, k) => {
      const place = pinned && !gone(pin.point) ? seen(pin.point) : null, taken = k === chosen;
      group.style.display = place && (!taken || this.live) ? "" : "none";
      const classes = ["pin", pin.finding && "finding", this.live && "live", taken ? "taken" : this.hidden[k] && "behind"];
      group.setAttribute("class", classes.filter(Boolean).join(" "));
      if (place) group.setAttribute("transform", `translate(${fixed(place)})`);
    });
    const pin = this.pins[chosen]?.pin;
    this.rest.replaceChildren(
      ...(pin && pinned ? chosenPin(pin, seen, width) : []), ...marksOf(over.marks, seen, width),
      ...handleOf(over.handle, camera, seen), axes(camera, height), ruler(camera, width, height, lengths),
    );
  }
}

const fixed = ([x, y]: readonly [number, number]): string => `${x.toFixed(1)} ${y.toFixed(1)}`;

function chosenPin({ point, chosenText: text }: Pin, seen: Seen, width: number): SVGElement[] {
  const place = seen(point);
  if (!place) return [];
  const wide = BOLD_LETTER * text.length + 14, x = place[0] + 18 + wide > width ? -18 - wide : 18;
  return [svg("g", { class: "chosen", transform: `translate(${fixed(place)})` },
    svg("circle", { r: 11 }), svg("path", { d: x > 0 ? "M11 0H18" : "M-11 0H-18" }),
    svg("rect", { x, y: -12, width: wide, height: 24, rx: 5 }),
    svg("text", { x: x + wide / 2, y: 5 }, text))];
}

function marksOf(marks: readonly Mark[], seen: Seen, width: number): SVGElement[] {
  return marks.flatMap(({ points, label, distance }) => {
    const ends = points.map(seen).filter((place) => place !== null), [first, last] = [ends[0], ends[ends.length - 1]];
    if (!first || !last || ends.length < points.length) return [];
    const [x, y] = distance ? [(first[0] + last[0]) / 2, (first[1] + last[1]) / 2] : first, wide = LETTER * label.length + 14;
    const left = distance ? x - wide / 2 : x + 14 + wide > width ? x - 14 - wide : x + 14, top = distance ? y - 30 : y - 34;
    const path = distance ? `M${ends.map(fixed).join("L")}` : `M${x} ${y}L${left < x ? left + wide : left} ${top + 20}`;
    return [svg("g", { class: "mark" }, svg("path", { d: path }),
      ...ends.map(([cx, cy]) => svg("circle", { cx: cx.toFixed(1), cy: cy.toFixed(1), r: 4 })),
      svg("rect", { x: left.toFixed(1), y: top.toFixed(1), width: wide, height: 22, rx: 4 }),
      svg("text", { x: (left + wide / 2).toFixed(1), y: (top + 15).toFixed(1) }, label))];
  });
}

function handleOf(handle: Handle | null, camera: Camera, seen: Seen): SVGElement[] {
  const from = handle && seen(handle.place), to = handle && seen(add(handle.place, handle.normal, 0.01 * camera.height));
  if (!from || !to) return [];
  // Up and down where it points at the eye.
  const way = [to[0] - from[0], to[1] - from[1]] as const;
  const angle = Math.hypot(...way) < 1 ? -90 : Math.atan2(way[1], way[0]) * 180 / Math.PI;
  return [svg("g", { class: "handle", transform: `translate(${fixed(from)}) rotate(${angle.toFixed(1)})` },
    svg("circle", { r: 15 }), svg("path", { d: "M-26 0H26M-19 -6L-26 0L-19 6M19 -6L26 0L19 6" }))];
}

function axes(camera: Camera, height: number): SVGElement {
  const [right, up, back] = camera.axes, group = svg("g", { class: "axes", transform: `translate(42 ${height - 42})` });
  const ends = ([0, 1, 2] as const).map((k) => ({ name: "xyz".charAt(k), x: 27 * right[k], y: -27 * up[k], z: back[k] }))
    .sort((a, b) => a.z - b.z);
  for (const { name, x, y } of ends) {
    group.append(svg("line", { x2: x, y2: y, class: `axis-${name}` }), svg("text", { x: x * 1.4, y: y * 1.4 + 4 }, name));
  }
  return group;
}

/** True in the plane of the middle of the view. */
function ruler(camera: Camera, width: number, height: number, lengths: Lengths): SVGElement {
  const model = lengths.round(camera.height / height * Math.min(140, width / 4)), pixels = model / camera.height * height;
  const x = 96, y = height - 22;
  return svg("g", { class: "ruler" }, svg("path", { d: `M${x} ${y - 5}v5h${pixels.toFixed(1)}v-5` }),
    svg("text", { x: x + pixels / 2, y: y - 7 }, lengths.alone(model)));
}

function svgElement(name: string): SVGElement {
  return document.createElementNS("http://www.w3.org/2000/svg", name);
}

function svg(name: string, attributes: Record<string, string | number>, ...children: (Node | string)[]): SVGElement {
  const made = svgElement(name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, String(value));
  made.append(...children);
  return made;
}
