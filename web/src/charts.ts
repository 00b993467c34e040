// Two small charts: deviation over control points, and the histogram of deviations.

import type { Scene, ShownUnit } from "nurbskin";
import { drawn } from "./dom";
import { grouped, lengthWords } from "./words";

const WIDTH = 340, HEIGHT = 150, LEFT = 70, BOTTOM = 24, TOP = 8, RIGHT = 10;

/** Places from 0 to 1 of positive values on a logarithmic axis; all in the middle where they are one. */
export function logarithmic(values: number[]): number[] {
  const logs = values.map((value) => Math.log(Math.max(value, Number.MIN_VALUE)));
  const low = Math.min(...logs), high = Math.max(...logs);
  return logs.map((log) => (high > low ? (log - low) / (high - low) : 0.5));
}

/** The curve of p95 over control points, with one point chosen. */
export function tradeChart(trade: NonNullable<Scene["trade"]>, units: ShownUnit[], chosen: number): SVGElement {
  const { points } = trade;
  const across = logarithmic(points.map((p) => p.control_points)).map((x) => LEFT + x * (WIDTH - LEFT - RIGHT));
  const up = logarithmic(points.map((p) => p.p95)).map((y) => HEIGHT - BOTTOM - y * (HEIGHT - BOTTOM - TOP));
  const first = points[0], last = points[points.length - 1];
  const svg = drawn("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, width: "100%", role: "img", "aria-label": "Distance of 95 % of the points over the number of control points" });
  svg.append(
    drawn("line", { class: "axis", x1: LEFT, x2: WIDTH - RIGHT, y1: HEIGHT - BOTTOM, y2: HEIGHT - BOTTOM }),
    drawn("line", { class: "axis", x1: LEFT, x2: LEFT, y1: TOP, y2: HEIGHT - BOTTOM }),
    drawn("polyline", { class: "curve", points: across.map((x, k) => `${x},${up[k] ?? 0}`).join(" ") }),
  );
  svg.append(...points.map((_, k) => drawn("circle", { class: k === chosen ? "chosen" : "dot", cx: across[k] ?? 0, cy: up[k] ?? 0, r: k === chosen ? 6 : 3 })));
  if (first && last) {
    svg.append(
      drawn("text", { x: LEFT - 6, y: TOP + 8, "text-anchor": "end" }, lengthWords(units, first.p95)),
      drawn("text", { x: LEFT - 6, y: HEIGHT - BOTTOM, "text-anchor": "end" }, lengthWords(units, last.p95)),
      drawn("text", { x: LEFT, y: HEIGHT - 8 }, grouped(String(first.control_points))),
      drawn("text", { x: WIDTH - RIGHT, y: HEIGHT - 8, "text-anchor": "end" }, `${grouped(String(last.control_points))} control points`),
    );
  }
  return svg;
}

/** The histogram of signed deviations; the band within the tolerance behind it. */
export function histogramChart(histogram: NonNullable<Scene["histogram"]>, units: ShownUnit[], tolerance: number | null): SVGElement {
  const { low, high, counts } = histogram;
  const most = Math.max(1, ...counts);
  const width = (WIDTH - 2 * RIGHT) / counts.length, tall = HEIGHT - BOTTOM - TOP;
  const at = (value: number): number => RIGHT + ((value - low) / (high - low)) * (WIDTH - 2 * RIGHT);
  const outside = histogram.below + histogram.above;
  const svg = drawn("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, width: "100%", role: "img", "aria-label": `Histogram of the signed distances from ${lengthWords(units, low)} to ${lengthWords(units, high)}${outside ? `, ${outside} points beyond` : ""}` });
  if (tolerance !== null && high > low) {
    const from = at(Math.max(-tolerance, low)), to = at(Math.min(tolerance, high));
    svg.append(drawn("rect", { class: "band", x: from, width: Math.max(0, to - from), y: TOP, height: tall }));
  }
  counts.forEach((count, k) => {
    const height = (count / most) * tall;
    svg.append(drawn("rect", { class: "bar", x: RIGHT + k * width, width: Math.max(0.5, width - 0.6), y: TOP + tall - height, height }));
  });
  svg.append(
    drawn("line", { class: "axis", x1: RIGHT, x2: WIDTH - RIGHT, y1: HEIGHT - BOTTOM, y2: HEIGHT - BOTTOM }),
    drawn("text", { x: RIGHT, y: HEIGHT - 8 }, lengthWords(units, low)),
    drawn("text", { x: WIDTH / 2, y: HEIGHT - 8, "text-anchor": "middle" }, "0"),
    drawn("text", { x: WIDTH - RIGHT, y: HEIGHT - 8, "text-anchor": "end" }, lengthWords(units, high)),
  );
  return svg;
}
