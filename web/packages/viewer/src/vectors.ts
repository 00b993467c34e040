// Vectors of three numbers, for what is computed once per place; the renderer has its own.

export type Vector = [number, number, number];

export const X: Vector = [1, 0, 0], Y: Vector = [0, 1, 0], Z: Vector = [0, 0, 1];

/** a + s b. */
export const add = (a: Vector, b: Vector, s = 1): Vector => [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]];
export const sub = (a: Vector, b: Vector): Vector => add(a, b, -1);
export const scaled = (a: Vector, s: number): Vector => [s * a[0], s * a[1], s * a[2]];
export const dot = (a: Vector, b: Vector): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a: Vector, b: Vector): Vector =>
  [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export const size = (a: Vector): number => Math.hypot(a[0], a[1], a[2]);
/** Of length 1; the zero vector stays. */
export const unit = (a: Vector): Vector => scaled(a, 1 / (size(a) || 1));
/** From a at t = 0 to b at t = 1. */
export const mix = (a: Vector, b: Vector, t: number): Vector => add(a, sub(b, a), t);

/** The vector `k` of a list of numbers. */
export const at = (list: ArrayLike<number>, k: number): Vector => [list[3 * k] ?? 0, list[3 * k + 1] ?? 0, list[3 * k + 2] ?? 0];
