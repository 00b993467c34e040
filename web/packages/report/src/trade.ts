// What control points buy, as SVG: deviation over control points, logarithms on both axes.

import { short } from "./charts";
import type { Trade, TradePoint } from "./data";
import { drawn, element } from "./dom";
import { count, exact, type Lengths } from "./format";

/** 1, 2 and 5 times powers of ten from low to high; only powers of ten where those are many. */
function decades(low: number, high: number): number[] {
  const found: number[] = [];
  for (let e = Math.floor(Math.log10(low)); e <= Math.log10(high); e += 1) {
    for (const m of [1, 2, 5]) found.push(Number(`${m}e${e}`));
  }
  const inside = found.filter((x) => x >= low && x <= high), tens = inside.filter((x) => String(x).replace(/[.0]/g, "")[0] === "1");
  return inside.length > 6 && tens.length > 1 ? tens : inside;
}

export function drawTrade(into: HTMLElement, { points, chosen, knee, neighbours }: Trade, { unit, factor, alone }: Lengths): void {
  const shown = points.filter((p) => p.control_points > 0 && p.p95 > 0 && p.max > 0);
  const wide = Math.max(260, Math.min(640, into.clientWidth || 340)), tall = 220;
  const left = 58, right = 14, top = 24, bottom = 40, floor = tall - bottom;
  const counts = shown.map((p) => p.control_points), heights = shown.flatMap((p) => [factor * p.p95, factor * p.max]);
  // The ends have room for their marks.
  const axis = (values: number[], from: number, to: number): { low: number; high: number; at: (x: number) => number } => {
    const low = Math.min(...values) / 1.15, high = Math.max(...values) * 1.15, over = Math.log(high / low);
    return { low, high, at: (x) => from + (to - from) * Math.log(x / low) / over };
  };
  const across = axis(counts, left, wide - right), up = axis(heights, floor, top);
  const x = (p: TradePoint): string => across.at(p.control_points).toFixed(2);
  const y = (value: number): string => up.at(factor * value).toFixed(2);
  const spoken = shown.map((p) => `${alone(p.p95)} for ${count(p.control_points)}`).join(", ");
  const svg = drawn("svg", { viewBox: `0 0 ${wide} ${tall}`, role: "img", "aria-label":
    `Deviation over control points: 95 % of the points within ${spoken}.` });
  for (const value of decades(up.low, up.high)) {
    svg.append(drawn("line", { x1: left, x2: wide - right, y1: up.at(value), y2: up.at(value), class: "rule" }),
      drawn("text", { x: left - 5, y: up.at(value) + 4, "text-anchor": "end" }, exact(value)));
  }
  svg.append(drawn("line", { x1: left, x2: wide - right, y1: floor, y2: floor, class: "axis" }));
  for (const n of decades(across.low, across.high)) {
    svg.append(drawn("line", { x1: across.at(n), x2: across.at(n), y1: floor, y2: floor + 4, class: "axis" }),
      drawn("text", { x: across.at(n), y: floor + 15, "text-anchor": "middle" }, short(n)));
  }
  svg.append(drawn("text", { x: (left + wide - right) / 2, y: tall - 6, "text-anchor": "middle" }, "control points"));
  svg.append(drawn("text", { x: 2, y: 12 }, `deviation${unit ? `, ${unit}` : ""}`));
  const path = (of: (p: TradePoint) => number): string => shown.map((p, k) => `${k ? "L" : "M"}${x(p)} ${y(of(p))}`).join("");
  svg.append(drawn("path", { d: path((p) => p.max), class: "largest" }), drawn("path", { d: path((p) => p.p95), class: "common" }));
  const told = (p: TradePoint): string => `${count(p.control_points)} control points: `
    + `95 % of the points within ${alone(p.p95)}, all within ${alone(p.max)}`;
  for (const p of shown) {
    const is = p.control_points === chosen ? "taken" : "met";
    svg.append(drawn("circle", { cx: x(p), cy: y(p.p95), r: is === "taken" ? 5 : 2.5, class: is }, drawn("title", {}, told(p))));
  }
  const at = shown.find((p) => p.control_points === knee);
  if (at) svg.append(drawn("circle", { cx: x(at), cy: y(at.p95), r: 8.5, class: "knee" }, drawn("title", {}, `knee, ${told(at)}`)));
  const key: [string, string][] = [["common", "95 % of the points"], ["largest", "largest"],
    ["taken", "this surface"], ...(at ? [["knee", "knee"] as [string, string]] : [])];
  const mark = (name: string): SVGElement => drawn("svg", { viewBox: "0 0 22 12", width: 22, height: 12, "aria-hidden": "true" },
    name === "common" || name === "largest"
      ? drawn("path", { d: "M1 6L21 6", class: name })
      : drawn("circle", { cx: 11, cy: 6, r: name === "knee" ? 5 : 4.5, class: name }));
  const bend = at && `From the knee at ${count(knee)} on, more control points buy less.`;
  const words = [neighbours && `${neighbours}.`, bend].filter(Boolean).join(" ");
  into.replaceChildren(svg, element("p", { class: "key quiet" },
    ...key.map(([name, text]) => element("span", {}, mark(name), text))),
    ...(words ? [element("p", { class: "quiet" }, words)] : []));
}
