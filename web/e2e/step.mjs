// How far two STEP files of the same scan are apart.

/**
 * The command and the module compute the same steps with other sines, cosines and vectors: their last digits differ. Files
 * with the same entities whose numbers differ by less than `relative` of the largest count as the same surface.
 */
export function difference(a, b, relative = 1e-9) {
  if (a === b) return { same: true, words: "the same bytes" };
  const number = /[-+]?\d+\.\d*(?:E[-+]?\d+)?/g;
  if (a.replace(number, "#") !== b.replace(number, "#")) return { same: false, words: "other entities" };
  const left = a.match(number).map(Number), right = b.match(number).map(Number);
  const largest = Math.max(...left.map(Math.abs).filter(Number.isFinite));
  const apart = left.reduce((most, x, k) => Math.max(most, Math.abs(x - right[k])), 0);
  return { same: apart < relative * largest, words: `the same entities, numbers within ${(apart / largest).toExponential(1)} of the largest` };
}
