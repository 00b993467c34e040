// Parts of the report that need no browser: packed lists, the histogram, sections.

import { deflateRawSync } from "node:zlib";
import { describe, expect, test } from "vitest";
import type { Vector } from "nurbskin-viewer";
import { cropped } from "../src/charts";
import { readData, unpack, unpackDirections, type Packed } from "../src/data";
import { alongCut, cutMesh, magnification, rangeAlong } from "../src/section";

describe("packed lists", () => {
  /** As packed.rs writes them: differences, zigzag, planes of bytes. */
  function packed(values: number[], width: number, order: number, step: number): Packed {
    const before = (k: number, back: number): number => values[k - back * width] ?? 0;
    const expected = (k: number): number => (order === 0 ? 0 : order === 1 ? before(k, 1) : 2 * before(k, 1) - before(k, 2));
    const rest = values.map((x, k) => (x - expected(k)) | 0).map((r) => (r << 1 ^ r >> 31) >>> 0);
    const planes = Uint8Array.from([0, 8, 16, 24].flatMap((shift) => rest.map((z) => z >>> shift & 255)));
    return { count: values.length / width, width, order, step, deflate: deflateRawSync(planes).toString("base64") };
  }

  test("come back as they were", async () => {
    const whole = [5, -7, 2 ** 31 - 2, -(2 ** 31) + 1, 0, 1, 2, 3, 1e6, -1e6];
    for (const order of [0, 1, 2]) for (const width of [1, 2]) {
      expect([...await unpack(packed(whole, width, order, 0), Int32Array) ?? []]).toEqual(whole);
      expect([...await unpack(packed([1, -(2 ** 31), 3, 4], width, order, 0.5), Float64Array) ?? []]).toEqual([0.5, NaN, 1.5, 2]);
    }
    expect(await unpack(packed([], 3, 0, 1), Float32Array)).toBeNull();
    expect(await unpack(undefined, Float32Array)).toBeNull();
  });

  test("of directions are unit vectors", async () => {
    const directions = await unpackDirections(packed([1, 0, 0, 0, 0, -1, 1, 1], 2, 1, 1));
    const expected = [1, 0, 0, 0, 0, 1, 0, -1, 0, 0, 0, -1];
    expect(directions).toHaveLength(expected.length);
    expected.forEach((x, k) => { expect(directions?.[k]).toBeCloseTo(x, 6); });
  });
});

test("units and signs are the same in sentences and in figures", async () => {
  const data = await readData(JSON.stringify({
    unit: "um", shown_in: [{ from: 0, factor: 1, symbol: "um" }], command: "nurbskin fit album.ply -t 50um",
    verdict: {
      verdict: "fail", reason: "2 points are outside +-50 um",
      reasons: [{ what: "outside +-50 um; the worst is +70.5 um", where: null, next: "allow 80 um" }],
    },
    tables: [{ title: "Check", rows: [["gap", "0.1 um"], ["x um", "3 umbrellas"]] }], details: ["moved by 3 um"],
  }));
  expect([data.unit, data.shown_in[0].symbol, data.command]).toEqual(["µm", "µm", "nurbskin fit album.ply -t 50um"]);
  expect(data.verdict?.reason).toBe("2 points are outside ±50 µm");
  expect(data.verdict?.reasons).toEqual([{ what: "outside ±50 µm; the worst is +70.5 µm", where: null, next: "allow 80 µm" }]);
  expect(data.tables[0].rows).toEqual([["gap", "0.1 µm"], ["x um", "3 umbrellas"]]);
  expect(data.details).toEqual(["moved by 3 µm"]);
});

test("the middle of a histogram counts what lies beyond it", () => {
  const histogram = { low: -5.5, high: 5.5, counts: [1, 2, 3, 4, 5, 6, 5, 4, 3, 2, 1], below: 7, above: 8 };
  const part = cropped(histogram, 2.6);
  expect([part.counts, part.below, part.above]).toEqual([[3, 4, 5, 6, 5, 4, 3], 10, 11]);
  expect(part.low).toBeCloseTo(-3.5, 12);
  expect(part.high).toBeCloseTo(3.5, 12);
  expect(cropped(histogram, 100).counts).toEqual(histogram.counts);
});

describe("sections", () => {
  // A sphere of triangles.
  const n = 40, positions: number[] = [], triangles: number[] = [];
  for (let j = 0; j <= n; j++) for (let i = 0; i < 2 * n; i++) {
    const [a, b] = [Math.PI * j / n, Math.PI * i / n];
    positions.push(10 * Math.sin(a) * Math.cos(b), 10 * Math.sin(a) * Math.sin(b), 10 * Math.cos(a));
    const k = (m: number, l: number): number => l * 2 * n + (m % (2 * n));
    if (j < n) triangles.push(k(i, j), k(i, j + 1), k(i + 1, j), k(i + 1, j), k(i, j + 1), k(i + 1, j + 1));
  }
  const mesh = {
    positions: Float64Array.from(positions), triangles: Uint32Array.from(triangles),
    normals: Float64Array.from(positions, (x) => x / 10),
    deviation: Float64Array.from(positions.filter((_, k) => k % 3 === 2), (z) => 0.01 * z),
  };

  test("of a sphere are closed circles of the radius that they should have", () => {
    for (const normal of [[1, 0, 0], [0, 0, 1], [0.6, 0, 0.8]] as Vector[]) {
      const [low, high] = rangeAlong(mesh, normal);
      expect(low < -9.9 && high > 9.9 && high <= 10 + 1e-9).toBe(true);
      for (const offset of [-7.013, 0.017, 4.5]) {
        const segments = cutMesh(mesh, normal, offset), { length, mean, bare } = alongCut(segments);
        const radius = Math.sqrt(100 - offset ** 2);
        expect(Math.abs(length / (2 * Math.PI * radius) - 1), `${length} at ${offset}`).toBeLessThan(0.01);
        expect(Math.abs(mean - 0.01 * offset * normal[2]), `${mean} at ${offset}`).toBeLessThan(2e-3);
        expect(bare).toBe(0);
        const ends = new Map<string, number>();
        for (const { point, normal: at } of segments.flat()) {
          expect(Math.abs(point[0] * normal[0] + point[1] * normal[1] + point[2] * normal[2] - offset)).toBeLessThan(1e-9);
          expect(at?.every((x, k) => Math.abs(x - (point[k] ?? NaN) / 10) < 1e-9)).toBe(true);
          ends.set(point.join(), (ends.get(point.join()) ?? 0) + 1);
        }
        expect([...ends.values()].every((count) => count % 2 === 0), "the curve is closed").toBe(true);
      }
    }
    expect(cutMesh(mesh, [1, 0, 0], 11)).toHaveLength(0);
  });

  test("show deviations about a fifteenth of the drawing long", () => {
    // 0.1 on a drawing of 20: 10 times enlarged; a tolerance counts, too.
    expect(magnification(cutMesh(mesh, [1, 0, 0], 0.017), 20, null)).toBe(10);
    expect(magnification(cutMesh(mesh, [1, 0, 0], 0.017), 20, 0.5)).toBe(2);
    expect(magnification([], 20, null)).toBe(1);
  });
});
