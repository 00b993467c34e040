import { describe, expect, test } from "vitest";
import { Camera, VIEWS, lookFrom } from "../packages/viewer/src/camera";
import { TEXELS, around, gradientOf, jumpClass, mapAt, mapBytes, parse, scaleColour, spread } from "../packages/viewer/src/colours";
import { boundsOf, segmentsOf, weighted, type Bounds } from "../packages/viewer/src/drawing";
import { blend, weightsOn } from "../packages/viewer/src/picking";
import { size, sub, type Vector } from "../packages/viewer/src/vectors";

describe("colours", () => {
  test("are white in the middle, and their own beyond the scale and without data", () => {
    const scale = around(0.1);
    expect(scaleColour(scale, 0)).toBe("rgb(247 247 244)");
    expect(scaleColour(scale, -0.1)).toBe("rgb(11 42 102)");
    expect(scaleColour(scale, 0.1)).toBe("rgb(116 16 25)");
    expect(scaleColour(scale, 0.1001)).toBe("#ffdd00");
    expect(scaleColour(scale, -0.1001)).toBe("#00d8e6");
    expect(scaleColour(scale, NaN)).toBe("#8b9097");
    expect(mapAt("diverging", -5)).toEqual(mapAt("diverging", 0));
    expect(mapAt("diverging", 1)).toEqual(parse("#741019"));
  });

  test("are green within the tolerance and only there, whatever the range", () => {
    const green = (colour: string): boolean => {
      const [r = 0, g = 0, b = 0] = (/\d+ \d+ \d+/.exec(colour)?.[0] ?? "").split(" ").map(Number);
      return g > r && g > b;
    };
    for (const high of [1, 1.5, 40]) {
      const scale = { map: "tolerance", low: -high, high, band: 1 } as const;
      for (const x of [-1, -0.999, -0.5, -1e-9, 0, 0.3, 0.9, 1]) expect(green(scaleColour(scale, x)), `${x} of ${high}`).toBe(true);
      for (const x of [-1.001, 1.001, 1.2, -high, high].filter((x) => Math.abs(x) > 1 && Math.abs(x) <= high)) {
        expect(green(scaleColour(scale, x)), `${x} of ${high}`).toBe(false);
      }
      expect([scaleColour(scale, 2 * high), scaleColour(scale, -2 * high)]).toEqual(["#ff4fd8", "#00e5ff"]);
      const stops = gradientOf(scale).map(([share]) => share);
      expect(stops.every((share, k) => share >= 0 && share <= 1 && (!k || share >= (stops[k - 1] ?? 0))), "stops are in order")
        .toBe(true);
    }
  });

  test("of the shaders are those of the legend", () => {
    const texel = (bytes: Uint8Array, i: number): string => `rgb(${[...bytes.subarray(4 * i, 4 * i + 3)].join(" ")})`;
    const plain = mapBytes("diverging"), parts = mapBytes("tolerance");
    expect([plain.length, parts.length]).toEqual([4 * TEXELS, 4 * TEXELS]);
    expect(texel(plain, 0)).toBe(scaleColour(around(1), -1));
    expect(texel(plain, 255)).toBe(scaleColour(around(1), 1));
    const scale = { map: "tolerance", low: -3, high: 3, band: 1 } as const;
    expect([0, 86, 169, 255].map((i) => texel(parts, i))).toEqual([-3, -1, 1, 3].map((x) => scaleColour(scale, x)));
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

  test("of edges are in classes of their angle", () => {
    const join = { kind: "smooth", sampled: null, bound: null };
    expect([0, 0.01, 0.0100001, 0.1, 0.3, 0.5, 0.9, 7].map((bound) => jumpClass({ ...join, bound })))
      .toEqual([0, 0, 1, 2, 3, 3, 4, 5]);
    expect(jumpClass({ ...join, sampled: 0.02 })).toBe(1);
    expect(jumpClass(join)).toBe(-1);
  });
});

describe("drawings", () => {
  const lines = { positions: Float32Array.from({ length: 15 }, (_, k) => k), lengths: [3, 2] };

  test("have segments that do not join one polyline to the next", () => {
    expect([...segmentsOf(lines)]).toEqual([0, 1, 2, 3, 4, 5, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14]);
    expect([...segmentsOf(lines, (line) => line === 1)]).toEqual([9, 10, 11, 12, 13, 14]);
    expect(segmentsOf({ positions: new Float32Array(3), lengths: [1, 0] })).toHaveLength(0);
  });

  test("give values without a number no weight", () => {
    expect([...weighted([2, NaN, -3])]).toEqual([2, 1, 0, 0, -3, 1]);
  });

  test("have bounds that points which are not used, and stray ones beside a surface, do not widen", () => {
    const positions = new Float32Array(300).map((_, k) => (k % 3 === 0 ? Math.floor(k / 3) / 99 : 0)), state = new Uint8Array(100);
    positions[0] = -50;
    state[0] = 3;
    const points = { positions, state, values: {} };
    expect(boundsOf({ mesh: null, points, lines: {} }).low[0]).toBeCloseTo(1 / 99, 6);
    state[0] = 0;
    const mesh = { positions: new Float32Array([0, 0, 0, 1, 0, 0, 0, 1, 0]), triangles: new Uint32Array([0, 1, 2]),
      normals: null, values: {} };
    const bounds = boundsOf({ mesh, points, lines: {} });
    expect([bounds.low, bounds.high]).toEqual([[0, 0, 0], [1, 1, 0]]);
    expect(bounds.size).toBeCloseTo(Math.SQRT2, 6);
    expect(bounds.reach).toBeGreaterThan(50);
    expect(boundsOf({ mesh: null, points: null, lines: {} }).outline).toHaveLength(0);
  });
});

describe("cameras", () => {
  const corners: Vector[] = [0, 1, 2, 3, 4, 5, 6, 7].map((k) => [k & 1 ? 3 : -3, k & 2 ? 2 : -2, k & 4 ? 1 : -1]);
  const bounds: Bounds = { low: [-3, -2, -1], high: [3, 2, 1], centre: [0, 0, 0], diagonal: 7.5, size: 7.5, reach: 3.8,
    outline: corners };

  test("show all from every side, with perspective and without", () => {
    for (const perspective of [true, false]) for (const rotation of Object.values(VIEWS)) for (const aspect of [0.5, 1, 2]) {
      const camera = new Camera(bounds);
      camera.perspective = perspective;
      camera.set(camera.fitted(rotation, aspect));
      const places = corners.map((corner) => camera.project(corner, aspect));
      const most = Math.max(...places.flatMap(({ x, y }) => [Math.abs(x), Math.abs(y)]));
      expect(most < 1 && most > 0.5, `${most}`).toBe(true);
    }
  });

  test("keep the place under the pointer when they zoom", () => {
    const camera = new Camera(bounds), place: Vector = [...camera.target];
    camera.perspective = false;
    camera.pan(0.1, -0.2);
    const before = camera.project(place, 1);
    camera.zoom(0.5, before.x / 2, before.y / 2);
    const after = camera.project(place, 1);
    expect(after.x).toBeCloseTo(before.x, 9);
    expect(after.y).toBeCloseTo(before.y, 9);
  });

  test("look along a line of sight, and from where they shall", () => {
    const camera = new Camera(bounds);
    for (const perspective of [true, false]) {
      camera.perspective = perspective;
      const { from, direction } = camera.ray(0.3, -0.4, 1.5);
      const along: Vector = [from[0] + 5 * direction[0], from[1] + 5 * direction[1], from[2] + 5 * direction[2]];
      const { x, y } = camera.project(along, 1.5);
      expect([x, y]).toEqual([expect.closeTo(0.3, 9), expect.closeTo(-0.4, 9)]);
    }
    camera.rotation = lookFrom([1, 2, 2], [0, 0, 1]);
    expect(size(sub(camera.axes[2], [1 / 3, 2 / 3, 2 / 3]))).toBeLessThan(1e-12);
    camera.rotation = lookFrom([0, 0, 1], [0, 0, 1]);
    expect(size(sub(camera.axes[2], [0, 0, 1]))).toBeLessThan(1e-12);
  });

  test("turn about the target", () => {
    const camera = new Camera(bounds), before = camera.project(camera.target, 1);
    camera.orbit(0.7, -0.3);
    camera.roll(0.2);
    const { x, y, depth } = camera.project(camera.target, 1);
    expect(Math.hypot(x - before.x, y - before.y, depth - before.depth)).toBeLessThan(1e-9);
  });
});

test("a place on a triangle has the values of its corners by their weights", () => {
  const mesh = { positions: new Float32Array([0, 0, 0, 4, 0, 0, 0, 4, 0]), triangles: new Uint32Array([0, 1, 2]) };
  const on = weightsOn(mesh, 0, { from: [1, 2, 9], direction: [0, 0, -1] });
  expect(on.place).toEqual([1, 2, 0]);
  expect(on.weights).toEqual([0.25, 0.25, 0.5]);
  expect(blend(on, [4, 8, 2])).toBe(4);
  // Corners without a value do not count, and where they weigh most there is none.
  expect(blend(on, [NaN, 8, 2])).toBe(4);
  expect(blend(on, [4, 8, NaN])).toBe(6);
  expect(blend(on, [NaN, 8, NaN])).toBeNaN();
  // A line of sight past the triangle ends on its side.
  expect(weightsOn(mesh, 0, { from: [-1, 2, 9], direction: [0, 0, -1] }).place[0]).toBe(0);
});
