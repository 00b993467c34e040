// The histogram, as SVG in the colours of the scale.

import { scaleColour, type Scale } from "nurbskin-viewer";
import type { Histogram } from "./data";
import { drawn, element } from "./dom";
import { count, percent, stepped, tickStep, ticks, type Lengths } from "./format";

/** The middle of a histogram, as far as `reach`; what lies beyond it is only counted. */
export function cropped({ low, high, counts, below, above }: Histogram, reach: number): Histogram {
  const width = (high - low) / counts.length, sum = (list: number[]): number => list.reduce((a, b) => a + b, 0);
  const cut = Math.max(0, Math.min((counts.length - 1) / 2 - 2, Math.floor((high - reach) / width)));
  return {
    low: low + cut * width, high: high - cut * width, counts: counts.slice(cut, counts.length - cut),
    below: below + sum(counts.slice(0, cut)), above: above + sum(counts.slice(counts.length - cut)),
  };
}

export function drawHistogram(into: HTMLElement, histogram: Histogram, { scale, lengths, tolerance, logarithmic }: {
  scale: Scale; lengths: Lengths; tolerance: number | null; logarithmic: boolean;
}): void {
  let { low, high, counts } = histogram;
  const { below, above } = histogram;
  // All are equal.
  if (!(high > low)) [low, high, counts] = [low - scale.high, low + scale.high, [0, counts.reduce((a, b) => a + b, 0), 0]];
  const { unit, factor, withUnit } = lengths, total = counts.reduce((a, b) => a + b, below + above);
  const wide = Math.max(260, Math.min(640, into.clientWidth || 340)), tall = 210;
  const left = 46, right = 12, top = 24, bottom = 40, side = 16;
  const from = left + (below ? side + 6 : 0), to = wide - right - (above ? side + 6 : 0), floor = tall - bottom;
  const largest = Math.max(...counts, below, above, 1);
  const share = (n: number): number => (logarithmic ? Math.log10(n + 1) / Math.log10(largest + 1) : n / largest);
  const up = (n: number): number => (n > 0 ? share(n) : 0) * (floor - top);
  const place = (x: number): number => from + (to - from) * (high > low ? (x - low) / (high - low) : 0.5);
  const width = (to - from) / counts.length, step = (high - low) / counts.length;
  const svg = drawn("svg", { viewBox: `0 0 ${wide} ${tall}`, role: "img", "aria-label":
    `Histogram of ${count(total)} signed deviations from ${withUnit(low, true)} to ${withUnit(high, true)}; `
      + `${count(below)} below and ${count(above)} above this range.` });
  const thin = (to - from) / counts.length < 3; // outlines would hide the colours
  const bar = (x: number, w: number, n: number, fill: string, title: string): void => {
    if (!n) return;
    const tall = Math.max(up(n), 1.5), corner = { x: x.toFixed(2), y: (floor - tall).toFixed(2) };
    const box = { ...corner, width: Math.max(w, 1.4).toFixed(2), height: tall.toFixed(2) };
    svg.append(drawn("rect", { ...box, fill, class: thin ? null : "bin" },
      drawn("title", {}, `${title}: ${count(n)} points, ${percent(n / total)}`)));
  };
  const heights = logarithmic
    ? [1, 10, 100, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8].filter((n) => n <= largest)
    : ticks(0, largest, 4).filter((n) => n >= 1 && n % 1 === 0);
  const shown = heights.length > 5 ? heights.filter((_, k) => k % 2 === 0) : heights;
  for (const n of shown) {
    const y = floor - up(n);
    svg.append(drawn("line", { x1: left, x2: wide - right, y1: y, y2: y, class: "rule" }),
      drawn("text", { x: left - 5, y: y + 4, "text-anchor": "end" }, short(n)));
  }
  counts.forEach((n, k) => {
    const title = `${withUnit(low + k * step, true)} to ${withUnit(low + (k + 1) * step, true)}`;
    bar(from + k * width, width, n, scaleColour(scale, low + (k + 0.5) * step), title);
  });
  bar(left, side, below, scaleColour(scale, low - step / 2), `below ${withUnit(low, true)}`);
  bar(wide - right - side, side, above, scaleColour(scale, high + step / 2), `above ${withUnit(high, true)}`);
  svg.append(drawn("line", { x1: left, x2: wide - right, y1: floor, y2: floor, class: "axis" }));
  if (below) svg.append(drawn("text", { x: left + side / 2, y: floor + 15, "text-anchor": "middle" }, "below"));
  if (above) svg.append(drawn("text", { x: wide - right - side / 2, y: floor + 15, "text-anchor": "middle" }, "above"));
  const room = (x: number): boolean => (!below || place(x) > left + 50) && (!above || place(x) < wide - right - 50);
  const range = [factor * low, factor * high] as const;
  // As many ticks as their labels leave room for, about 6.6 wide a character.
  const apart = (n: number): boolean => {
    const step = tickStep(...range, n), labels = ticks(...range, n).map((x) => stepped(step)(x, true).length);
    return (step / (range[1] - range[0])) * (to - from) >= 6.6 * Math.max(0, ...labels) + 6;
  };
  let about = Math.max(2, Math.floor((to - from) / 62));
  while (about > 2 && !apart(about)) about -= 1;
  const write = stepped(tickStep(...range, about));
  for (const x of ticks(...range, about).map((x) => x / factor).filter(room)) {
    svg.append(drawn("line", { x1: place(x), x2: place(x), y1: floor, y2: floor + 4, class: "axis" }));
    svg.append(drawn("text", { x: Math.min(Math.max(place(x), left), wide - 18), y: floor + 15, "text-anchor": "middle" },
      write(factor * x, true)));
  }
  const title = `signed deviation${unit ? `, ${unit}` : ""}`;
  svg.append(drawn("text", { x: (left + wide - right) / 2, y: tall - 6, "text-anchor": "middle" }, title));
  svg.append(drawn("text", { x: 2, y: 12 }, "points"));
  if (tolerance && tolerance <= Math.max(high, -low)) {
    for (const x of [-tolerance, tolerance].filter((x) => x >= low && x <= high)) {
      svg.append(drawn("line", { x1: place(x), x2: place(x), y1: top - 4, y2: floor, class: "limit" }));
      const text = `${x < 0 ? "\u2212" : "+"}tol.`;
      svg.append(drawn("text", { x: place(x), y: top - 8, "text-anchor": "middle", class: "limit-text" }, text));
    }
  }
  const outside = tolerance && tolerance > Math.max(high, -low);
  into.replaceChildren(svg, ...(outside
    ? [element("p", { class: "quiet" }, `The tolerance, ±${lengths.alone(tolerance, false, 5)}, lies outside this range.`)] : []));
}

/** A count in a few letters. */
export function short(n: number): string {
  return n >= 1e6 ? `${n / 1e6} M` : n >= 1e4 ? `${n / 1e3} k` : count(n);
}
