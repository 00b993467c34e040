// Checks the numbers of the pages' axes and legends: no input makes a list without end.
//
//   node format.mjs

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";

const source = readFileSync(new URL("../../crates/nurbskin/src/report/page/format.js", import.meta.url), "utf8");
const { ticks, tickStep } = new Function(`${source}; return { ticks, tickStep };`)();

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
console.log("ok     axes and legends");
