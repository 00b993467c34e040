// The numbers of the report: lengths are as the program's messages have them, and of axes and legends no input makes a list
// without end.

import { expect, test } from "vitest";
import { lengthsLike, percent, tickStep, ticks } from "../src/format";

test("ticks are the multiples of a step, for any range few", () => {
  expect(ticks(0, 10, 5)).toEqual([0, 2, 4, 6, 8, 10]);
  expect(ticks(-1, 1, 4)).toEqual([-1, -0.5, 0, 0.5, 1]);
  expect(ticks(5, 5, 6)).toEqual([5]);
  expect(ticks(0, 0, 6)).toEqual([0]);
  expect([ticks(NaN, 1, 6), ticks(0, NaN, 6), ticks(-Infinity, 1, 6), ticks(2, 1, 6)]).toEqual([[], [], [], []]);
  const odd = [0, -0, 5, -5, 1e6, 1e6 + 1e-10, 1e-300, 5e-324, 1e300, -1e300, 1.7e308, Infinity, -Infinity, NaN,
    undefined as unknown as number];
  for (const low of odd) for (const high of odd) for (const about of [6, 2, 1, 0, -1, NaN, Infinity]) {
    const found = ticks(low, high, about), step = tickStep(low, high, about), what = `${low} to ${high}, ${about}`;
    expect(found.length <= 20 && found.every(Number.isFinite), `${what}: ${found.join()}`).toBe(true);
    expect(step >= 0 && Number.isFinite(step), `${what}: step ${step}`).toBe(true);
  }
});

test("lengths are in the unit that fits them", () => {
  // As Unit::Metre.shown_in() has them.
  const units: [string, number, number][] = [["mm", 0, 1e3], ["nm", Number.MIN_VALUE, 1e9], ["um", 1e-7, 1e6], ["mm", 1e-4, 1e3],
    ["m", 1, 1], ["km", 1e3, 1e-3]];
  const lengths = lengthsLike(units.map(([symbol, from, factor]) => ({ symbol, from, factor })), 5.39e-5);
  expect([0, 5.394e-5, -5.394e-5, 1e-3, 0.9996, 1234.5, NaN].map((x) => lengths.alone(x, true)))
    .toEqual(["0 mm", "+53.9 um", "\u221253.9 um", "+1 mm", "+1 m", "+1.23 km", "– mm"]);
  expect([lengths.unit, lengths.aligned(5.394e-5), lengths.aligned(1.3e-3, true), lengths.withUnit(0)])
    .toEqual(["um", "53.9", "+1300.0", "0.0 um"]);
  expect([lengths.alone(2.734e-4, false, 5), lengths.size([0.1958, 0.0791, 0.0381])])
    .toEqual(["0.2734 mm", "196 × 79.1 × 38.1 mm"]);
  expect(lengthsLike([{ from: 0, factor: 1, symbol: "" }], 0.1).alone(1234.56)).toBe("1235");
});

test("shares are never rounded up to all", () => {
  expect([0, 0.010717, 0.5, 0.9, 0.995, 0.99999, 1].map(percent))
    .toEqual(["0 %", "1.07 %", "50 %", "90 %", "99.5 %", "99.999 %", "100 %"]);
});
