// What a reader takes along: the picture, the points as CSV, and a copy of the page with the marks on it.

import type { Viewer } from "nurbskin-viewer";
import type { Data } from "./data";
import { byId, element, within } from "./dom";
import type { Item } from "./marks";

/** Offers a file. */
export function save(name: string, content: Blob | string, type = ""): void {
  const address = URL.createObjectURL(content instanceof Blob ? content : new Blob([content], { type }));
  const link = element("a", { href: address, download: name });
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => { URL.revokeObjectURL(address); }, 10_000);
}

/** A file name of the title: its letters and digits, without an extension. */
export function fileName(title: string, ending: string): string {
  const stem = (title || "report").replace(/\.[a-z0-9]{1,5}$/i, "").replace(/[^\p{L}\p{N}._-]+/gu, "-").replace(/^-+|-+$/g, "");
  return `${stem.slice(0, 80) || "report"}${ending}`;
}

/** An SVG of the page as a picture; its styles are those of the page. */
async function pictureOfSvg(svg: SVGElement, width: number, height: number, dark: boolean): Promise<HTMLImageElement> {
  const copy = svg.cloneNode(true) as SVGElement, style = document.createElementNS("http://www.w3.org/2000/svg", "style");
  copy.setAttribute("xmlns", "http://www.w3.org/2000/svg");
  copy.setAttribute("width", String(width));
  copy.setAttribute("height", String(height));
  copy.setAttribute("style", `color: ${dark ? "#e9edf1" : "#14181d"}; font: 12px system-ui, "Liberation Sans", Arial, sans-serif`);
  style.textContent = within(document, "style").textContent;
  copy.prepend(style);
  copy.querySelector(".handle")?.remove();
  const image = new Image();
  image.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(new XMLSerializer().serializeToString(copy))}`;
  await image.decode();
  return image;
}

/** The view with what lies over it, its title and its legend, as PNG. */
export async function savePicture(viewer: Viewer, data: Data): Promise<void> {
  const fine = 2, beside = 170, above = 44, { width, height, settings: { dark } } = viewer;
  const sheet = element("canvas", { width: fine * (width + beside), height: fine * (height + above) });
  const pen = sheet.getContext("2d");
  if (!pen) return;
  const style = getComputedStyle(document.body);
  pen.scale(fine, fine);
  pen.fillStyle = style.getPropertyValue("--card");
  pen.fillRect(0, 0, width + beside, height + above);
  pen.fillStyle = style.color;
  pen.font = '600 16px system-ui, "Liberation Sans", Arial, sans-serif';
  pen.fillText(data.title, 12, 28, width + beside - 24);
  pen.drawImage(viewer.rendered(fine), 0, above, width, height);
  pen.drawImage(await pictureOfSvg(byId<SVGElement>("overlay"), width, height, dark), 0, above, width, height);
  const legend = byId("legend"), bar = legend.querySelector<SVGElement>("svg.bar"), left = width + 12;
  let top = above + 14;
  pen.font = '13px system-ui, "Liberation Sans", Arial, sans-serif';
  const title = legend.querySelector(".legend-title")?.textContent;
  if (title) pen.fillText(title, left, top, beside - 16);
  if (bar) {
    const [w, h] = [bar.getBoundingClientRect().width, bar.getBoundingClientRect().height];
    pen.drawImage(await pictureOfSvg(bar, w, h, dark), left, top + 10, w, h);
    top += h + 20;
  }
  for (const swatch of legend.querySelectorAll(".swatch")) {
    const colour = within(swatch, "i").style.background;
    if (!colour) continue;
    top += 20;
    pen.fillStyle = colour;
    pen.fillRect(left, top - 8, 16, 4);
    pen.fillStyle = style.color;
    pen.fillText(swatch.textContent, left + 22, top, beside - 40);
  }
  const blob = await new Promise<Blob | null>((done) => { sheet.toBlob(done, "image/png"); });
  if (blob) save(fileName(data.title, ".png"), blob);
}

const CSV_STATES = ["used", "used", "held_out", "outlier", "left_out", "duplicate"];

/** The points of the page, a line each, in the order of the file. */
export function csvOf({ points, origin, bounds }: Data): string {
  if (!points) return "";
  const { positions, deviation, index, parameters, faces, state, count: shown, notFinite } = points;
  // As many digits as the page has.
  const digits = Math.min(Math.max(0, 7 - Math.floor(Math.log10(bounds.diagonal))), 15);
  const form = (x: number): string => (Number.isFinite(x) ? String(Number(x.toPrecision(7))) : "");
  const lines = ["index,x,y,z,deviation,u,v,face,place,state"], absent = Array.from(notFinite);
  let next = 0;
  const gap = (before: number): void => {
    while (next < absent.length && absent[next] < before) lines.push(`${absent[next++]},,,,,,,,,not_finite`);
  };
  for (let i = 0; i < shown; i++) {
    const number = index?.[i] ?? i, place = [0, 1, 2].map((k) => Number((positions[3 * i + k] + origin[k]).toFixed(digits)));
    const known = deviation && Number.isFinite(deviation[i]);
    const u = known && parameters ? form(parameters[2 * i]) : "", v = known && parameters ? form(parameters[2 * i + 1]) : "";
    const face = known && faces ? faces[i] : "", where = known && state[i] < 2 ? ["interior", "free_edge"][state[i]] : "";
    gap(number);
    lines.push([number, ...place, known ? form(deviation[i]) : "", u, v, face, where, CSV_STATES[state[i]]].join(","));
  }
  gap(Infinity);
  return `${lines.join("\n")}\n`;
}

/** The page as it was loaded, with these marks in it. */
export function pageWith(loaded: string, marks: Item[]): string {
  const kept = JSON.stringify(marks).replace(/</g, "\\u003c"), opening = '<script type="application/json" id="kept">';
  const from = loaded.indexOf(opening) + opening.length, to = loaded.indexOf("</script>", from);
  return `<!doctype html>\n${loaded.slice(0, from)}${kept}${loaded.slice(to)}`;
}
