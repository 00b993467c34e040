// Checks the numbers of the pages: lengths are as the program's messages have them, and of axes and legends no input makes a list without end.
//
//   node format.mjs

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";

const source = readFileSync(new URL("../../crates/nurbskin/src/report/page/format.js", import.meta.url), "utf8");
const { ticks, tickStep, lengthsLike, percent } = new Function(`${source}; return { ticks, tickStep, lengthsLike, percent };`)();

assert.deepEqual(ticks(0, 10, 5), [0, 2, 4, 6, 8, 10]);
assert.deepEqual(ticks(-1, 1, 4), [-1, -0.5, 0, 0.5, 1]);
assert.deepEqual(ticks(5, 5, 6), [5]);
assert.deepEqual(ticks(0, 0, 6), [0]);
assert.deepEqual([ticks(NaN, 1, 6), ticks(0, NaN, 6), ticks(-Infinity, 1, 6), ticks(2, 1, 6)], [[], [], [], []]);
const odd = [0, -0, 5, -5, 1e6, 1e6 + 1e-10, 1e-300, 5e-324, 1e300, -1e300, 1.7e308, Infinity, -Infinity, NaN, undefined];
for (const low of odd) for (const high of odd) for (const about of [6, 2, 1, 0, -1, NaN, Infinity]) {
  const found = ticks(low, high, about), step = tickStep(low, high, about);
  assert(found.length <= 20 && found.every(Number.isFinite), `${low} to ${high}, ${about}: ${found}`);
  assert(step >= 0 && Number.isFinite(step), `${low} to ${high}, ${about}: step ${step}`);
}

// As Unit::Metre.shown_in() has them.
const metres = [["mm", 0, 1e3], ["nm", Number.MIN_VALUE, 1e9], ["um", 1e-7, 1e6], ["mm", 1e-4, 1e3], ["m", 1, 1], ["km", 1e3, 1e-3]].map(([symbol, from, factor]) => ({ symbol, from, factor }));
const lengths = lengthsLike(metres, 5.39e-5);
assert.deepEqual([0, 5.394e-5, -5.394e-5, 1e-3, 0.9996, 1234.5, NaN].map((x) => lengths.alone(x, true)), ["0 mm", "+53.9 um", "\u221253.9 um", "+1 mm", "+1 m", "+1.23 km", "– mm"]);
assert.deepEqual([lengths.unit, lengths.aligned(5.394e-5), lengths.aligned(1.3e-3, true), lengths.withUnit(0)], ["um", "53.9", "+1300.0", "0.0 um"]);
assert.deepEqual([lengths.alone(2.734e-4, false, 5), lengths.size([0.1958, 0.0791, 0.0381])], ["0.2734 mm", "196 × 79.1 × 38.1 mm"]);
assert.deepEqual(lengthsLike([{ from: 0, factor: 1, symbol: "" }], 0.1).alone(1234.56), "1235");

assert.deepEqual([0, 0.010717, 0.5, 0.9, 0.995, 0.99999, 1].map(percent), ["0 %", "1.07 %", "50 %", "90 %", "99.5 %", "99.999 %", "100 %"]);

console.log("ok     lengths, shares, axes and legends");
