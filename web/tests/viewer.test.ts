import { describe, expect, test } from "vitest";
import { around, colourOf, coloursOf, mapAt, parse, spread } from "../packages/viewer/src/colours";
import { distanceFor, pieces } from "../packages/viewer/src/geometry";

describe("colours", () => {
  test("are white in the middle, and their own beyond the scale and without data", () => {
    const scale = around(0.1);
    expect(colourOf(scale, 0)).toEqual(parse("#f7f7f4"));
    expect(colourOf(scale, -0.1)).toEqual(parse("#0b2a66"));
    expect(colourOf(scale, 0.1)).toEqual(parse("#741019"));
    expect(colourOf(scale, 0.1001)).toEqual(parse("#ffdd00"));
    expect(colourOf(scale, -0.1001)).toEqual(parse("#00d8e6"));
    expect(colourOf(scale, NaN)).toEqual(parse("#8b9097"));
    expect(mapAt(-5)).toEqual(mapAt(0));
    expect([...coloursOf([0, NaN], scale)]).toEqual([247, 247, 244, 139, 144, 151]);
  });

  test("have a scale that a few wild values do not take", () => {
    const values = Array.from({ length: 1000 }, (_, k) => k / 1000);
    values[0] = 1e9;
    expect(spread(values).high).toBeLessThan(1);
    const { low, high } = spread([-1, -0.5, 0, 0.2, NaN]);
    expect(low).toBe(-high);
    expect(spread([NaN])).toEqual(around(1));
    const flat = spread([3, 3, 3]);
    expect(flat.low).toBeLessThan(flat.high);
  });
});

describe("geometry", () => {
  test("pieces of polylines do not join one to the next", () => {
    const lines = { positions: new Float32Array(15), lengths: [3, 2] };
    expect([...pieces(lines)]).toEqual([0, 1, 1, 2, 3, 4]);
    expect(pieces({ positions: new Float32Array(0), lengths: [1, 0] }).length).toBe(0);
  });

  test("a sphere fills the narrow side of the view", () => {
    expect(distanceFor(1, 60, 1)).toBeCloseTo(2, 12);
    expect(distanceFor(1, 60, 0.5)).toBeGreaterThan(distanceFor(1, 60, 1));
    expect(distanceFor(1, 60, 2)).toBeCloseTo(2, 12);
  });
});
