// The report on paper: the view as it is, finer and on white, the part from four sides, and nothing folded.

import type { Viewer } from "nurbskin-viewer";
import { byId, element } from "./dom";

const SIDES = [["iso", "Isometric"], ["front", "Front"], ["left", "Left"], ["top", "Top"]] as const;
/** Pixels of the view across the paper, and of the picture of a side. */
const ACROSS = 1800, SIDE = [900, 675] as const;

export function print(viewer: Viewer): void {
  const { width, height } = viewer;
  byId<HTMLImageElement>("snapshot").src = viewer.rendered(Math.max(1, ACROSS / width), { dark: false }).toDataURL("image/png");
  byId("picture").style.setProperty("--aspect", `${width} / ${height}`);
  const pictures = viewer.from(SIDES.map(([name]) => name), ...SIDE);
  byId("print-views").replaceChildren(...SIDES.map(([, text], k) =>
    element("figure", {}, element("img", { src: pictures[k], alt: "" }), element("figcaption", {}, text))));
  viewer.draw();
}

/** Unfolds the cards that are folded, which nobody can do on paper; returns what folds them again. */
export function unfold(): () => void {
  const folded = [...document.querySelectorAll<HTMLDetailsElement>("details.card:not([open])")];
  for (const card of folded) card.open = true;
  return () => { for (const card of folded) card.open = false; };
}
