// From the arrays of a scene to the arrays of the renderer.

/** Polylines end to end. */
export interface Polylines {
  positions: Float32Array;
  lengths: number[];
}

/** Pairs of indices, one for each piece of the polylines. */
export function pieces(lines: Polylines): Uint32Array<ArrayBuffer> {
  const count = lines.lengths.reduce((sum, length) => sum + Math.max(0, length - 1), 0);
  const pairs = new Uint32Array(2 * count);
  let first = 0, k = 0;
  for (const length of lines.lengths) {
    for (let i = 0; i + 1 < length; i++) {
      pairs[k++] = first + i;
      pairs[k++] = first + i + 1;
    }
    first += length;
  }
  return pairs;
}

/** Distance from the centre at which a sphere fills a view of this angle (degrees) and aspect. */
export function distanceFor(radius: number, angle: number, aspect: number): number {
  const half = (angle * Math.PI) / 360;
  const narrow = Math.min(half, Math.atan(Math.tan(half) * aspect));
  return radius / Math.sin(narrow);
}
