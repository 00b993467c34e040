// Scans to try, from the virtual scanner of the library.

import type { SimulateOptions } from "nurbskin";

/** An example on the first page. */
export interface Example {
  name: string;
  title: string;
  about: string;
  shape: string;
  options: SimulateOptions;
}

export const EXAMPLES: Example[] = [
  { name: "face.ply", title: "A face", about: "10 031 points with noise", shape: "face", options: { noise: 0.05, shuffled: true } },
  { name: "blade.ply", title: "A turbine blade", about: "8 000 points", shape: "blade", options: { points: 8000, noise: 0.01, shuffled: true } },
  { name: "panel.ply", title: "A panel with two holes", about: "8 000 points, cut off at the holes", shape: "saddle", options: { points: 8000, holes: 2, shuffled: true } },
  { name: "pot.ply", title: "A pot", about: "6 000 points, turned on a lathe", shape: "pot", options: { points: 6000, noise: 0.05, shuffled: true } },
  { name: "torus.ply", title: "A ring", about: "6 000 points, closed both ways", shape: "torus", options: { points: 6000, shuffled: true } },
  { name: "tee.ply", title: "A pipe tee", about: "mesh of 8 000 points, three openings", shape: "tee", options: { points: 8000, mesh: true } },
];
