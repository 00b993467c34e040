// What is under the pointer: triangles and points are drawn once per view with their numbers as colours, and read back. It
// takes one picture, whatever their number.

import { BufferAttribute, BufferGeometry, Mesh, NearestFilter, Points, Scene, WebGLRenderTarget, type WebGLRenderer } from "three";
import type { Camera, Ray } from "./camera";
import type { Triangles } from "./drawing";
import { PICK_FRAGMENT, PICK_POINT_VERTEX, PICK_SURFACE_VERTEX, POINT, TRIANGLE } from "./shaders";
import { materialOf, supportOf, type Settings, type Stage } from "./stage";
import { add, at, cross, dot, scaled, sub, type Vector } from "./vectors";

/** Least size of a point that is pointed at, in CSS pixels. */
const LEAST_DOT = 3;

export class Picker {
  /** Whether the view has changed since the numbers were drawn. */
  stale = true;
  private readonly scene = new Scene();
  private readonly target = new WebGLRenderTarget(1, 1, { magFilter: NearestFilter, minFilter: NearestFilter });
  private readonly dots = { dot_size: { value: 1 }, lift: { value: 0 } };
  private mesh: Mesh | null = null;
  private points: Points | null = null;

  constructor(private readonly stage: Stage) {}

  /** The point nearest to a pixel within `radius`, else the triangle at it. */
  at(
    renderer: WebGLRenderer, camera: Camera, settings: Settings, [width, height]: [number, number], x: number, y: number,
    radius: number,
  ): { point: number } | { triangle: number } | null {
    if (!(width > 0 && height > 0 && x >= 0 && y >= 0 && x < width && y < height)) return null;
    const other = this.target.width !== width || this.target.height !== height;
    if (this.stale || other) this.draw(renderer, camera, settings, width, height);
    // The part of the square about the place that is in the picture; its rows go upwards.
    const column = Math.floor(x), row = height - 1 - Math.floor(y);
    const left = Math.max(0, column - radius), low = Math.max(0, row - radius);
    const wide = Math.min(width - 1, column + radius) - left + 1, tall = Math.min(height - 1, row + radius) - low + 1;
    const pixels = new Uint8Array(4 * wide * tall);
    renderer.readRenderTargetPixels(this.target, left, low, wide, tall, pixels);
    let best = Infinity, point: number | null = null, triangle: number | null = null;
    for (let k = 0; k < wide * tall; k++) {
      const [red = 0, green = 0, blue = 0, kind = 0] = pixels.subarray(4 * k, 4 * k + 4);
      const far = (left + k % wide - column) ** 2 + (low + Math.floor(k / wide) - row) ** 2, number = red | green << 8 | blue << 16;
      if (kind === POINT && far < best && far <= radius * radius) [best, point] = [far, number];
      if (kind === TRIANGLE && far === 0) triangle = number;
    }
    return point !== null ? { point } : triangle !== null ? { triangle } : null;
  }

  dispose(): void {
    this.target.dispose();
    this.mesh?.geometry.dispose();
  }

  /** Draws the numbers, one pixel for each CSS pixel. */
  private draw(renderer: WebGLRenderer, camera: Camera, settings: Settings, width: number, height: number): void {
    this.build();
    this.target.setSize(width, height);
    this.stage.prepare(camera, settings, { width, height, pixel: 1 });
    if (this.mesh) this.mesh.visible = settings.layers.surface;
    if (this.points) this.points.visible = settings.layers.points;
    this.dots.lift.value = settings.lift;
    this.dots.dot_size.value = Math.max(LEAST_DOT, this.stage.pointSize(camera, settings, height));
    renderer.setRenderTarget(this.target);
    renderer.render(this.scene, camera.forRenderer(width / height));
    renderer.setRenderTarget(null);
    this.stale = false;
  }

  /** At the first question: many views are never pointed at. */
  private build(): void {
    const { shared, cloud, drawing: { mesh } } = this.stage;
    if (mesh && !this.mesh) {
      const geometry = new BufferGeometry();
      geometry.setAttribute("position", new BufferAttribute(cornersOf(mesh), 4));
      this.mesh = new Mesh(geometry, materialOf(PICK_SURFACE_VERTEX, PICK_FRAGMENT, { ...shared, lift: { value: 0 } }));
      this.mesh.frustumCulled = false;
      this.scene.add(this.mesh);
    }
    if (cloud && !this.points) {
      this.points = new Points(cloud, materialOf(PICK_POINT_VERTEX, PICK_FRAGMENT, { ...shared, ...this.dots }));
      this.points.frustumCulled = false;
      this.scene.add(this.points);
    }
  }
}

/** Corners with their support: each triangle has its own, as its number comes from theirs. */
function cornersOf(mesh: Triangles): Float32Array<ArrayBuffer> {
  const { positions, triangles } = mesh, support = supportOf(mesh), corners = new Float32Array(4 * triangles.length);
  for (let k = 0; k < triangles.length; k++) {
    const v = triangles[k] ?? 0;
    for (let i = 0; i < 3; i++) corners[4 * k + i] = positions[3 * v + i] ?? 0;
    corners[4 * k + 3] = (support[v] ?? 0) / 255;
  }
  return corners;
}

/** A place on a triangle: weights of its corners that add up to 1. */
export interface OnTriangle {
  corners: Vector;
  weights: Vector;
  place: Vector;
}

/** Where a line of sight meets the plane of a triangle, clamped into it. */
export function weightsOn(
  { positions, triangles }: Pick<Triangles, "positions" | "triangles">, triangle: number, ray: Ray,
): OnTriangle {
  const corners = at(triangles, triangle);
  const a = at(positions, corners[0]), b = at(positions, corners[1]), c = at(positions, corners[2]);
  const ab = sub(b, a), ac = sub(c, a), p = cross(ray.direction, ac), det = dot(ab, p);
  let u = 1 / 3, v = 1 / 3;
  if (Math.abs(det) > 0) {
    const t = sub(ray.from, a);
    u = dot(t, p) / det;
    v = dot(ray.direction, cross(t, ab)) / det;
  }
  const clamped = (w: number): number => Math.min(Math.max(w, 0), 1), all: Vector = [clamped(1 - u - v), clamped(u), clamped(v)];
  const weights = scaled(all, 1 / (all[0] + all[1] + all[2] || 1));
  return { corners, weights, place: add(add(scaled(a, weights[0]), b, weights[1]), c, weights[2]) };
}

/** A value between the corners, as the shaders have it: corners without one do not count, NaN where they weigh most. */
export function blend({ corners, weights }: OnTriangle, values: ArrayLike<number>, stride = 1, offset = 0): number {
  let sum = 0, all = 0;
  for (const k of [0, 1, 2] as const) {
    const x = values[stride * corners[k] + offset] ?? NaN;
    if (Number.isFinite(x)) [sum, all] = [sum + weights[k] * x, all + weights[k]];
  }
  return all >= 0.5 ? sum / all : NaN;
}
