// What a reader takes along: the picture, the points as CSV, and a copy of the page with the marks on it.

function save(name, content, type) {
  const address = URL.createObjectURL(content instanceof Blob ? content : new Blob([content], { type }));
  const link = element("a", { href: address, download: name });
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(address), 10000);
}

// A file name of the title.
const fileName = (title, ending) => `${(title || "report").replace(/\.[a-z0-9]{1,5}$/i, "").replace(/[^\p{L}\p{N}._-]+/gu, "-").replace(/^-+|-+$/g, "").slice(0, 80) || "report"}${ending}`;

// An SVG of the page as a picture; its styles are those of the page.
async function pictureOfSvg(svg, width, height, dark) {
  const copy = svg.cloneNode(true), style = document.createElementNS("http://www.w3.org/2000/svg", "style");
  copy.setAttribute("xmlns", "http://www.w3.org/2000/svg");
  copy.setAttribute("width", width);
  copy.setAttribute("height", height);
  copy.setAttribute("style", `color: ${dark ? "#e9edf1" : "#14181d"}; font: 12px system-ui, "Liberation Sans", Arial, sans-serif`);
  style.textContent = document.querySelector("style").textContent;
  copy.prepend(style);
  copy.querySelector(".handle")?.remove();
  const image = new Image();
  image.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(new XMLSerializer().serializeToString(copy))}`;
  await image.decode();
  return image;
}

// The view with what lies over it, its title and its legend, as PNG.
async function savePicture(view, data) {
  const fine = 2, beside = 170, above = 44, { width, height } = view, dark = matchMedia("(prefers-color-scheme: dark)").matches;
  const sheet = element("canvas", { width: fine * (width + beside), height: fine * (height + above) }), pen = sheet.getContext("2d");
  const style = getComputedStyle(document.body);
  pen.scale(fine, fine);
  pen.fillStyle = style.getPropertyValue("--card");
  pen.fillRect(0, 0, width + beside, height + above);
  pen.fillStyle = style.color;
  pen.font = '600 16px system-ui, "Liberation Sans", Arial, sans-serif';
  pen.fillText(data.title, 12, 28, width + beside - 24);
  pen.drawImage(view.rendered(fine, dark), 0, above, width, height);
  pen.drawImage(await pictureOfSvg(document.getElementById("overlay"), width, height, dark), 0, above, width, height);
  const legend = document.getElementById("legend"), bar = legend.querySelector("svg.bar"), left = width + 12;
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
    const colour = swatch.querySelector("i").style.background;
    if (colour) [pen.fillStyle, top] = [colour, top + 20], pen.fillRect(left, top - 8, 16, 4), pen.fillStyle = style.color, pen.fillText(swatch.textContent, left + 22, top, beside - 40);
  }
  const blob = await new Promise((done) => sheet.toBlob(done, "image/png"));
  save(fileName(data.title, ".png"), blob);
}

const CSV_STATES = ["used", "used", "held_out", "outlier", "left_out", "duplicate"];

// The points of the page, a line each, in the order of the file.
function csvOf({ points, origin, bounds }) {
  const { positions, deviation, index, parameters, faces, state, count: shown, notFinite } = points;
  // As many digits as the page has.
  const digits = Math.max(0, 7 - Math.floor(Math.log10(bounds.diagonal))), form = (x) => (Number.isFinite(x) ? String(Number(x.toPrecision(7))) : "");
  const lines = ["index,x,y,z,deviation,u,v,face,place,state"], absent = [...notFinite];
  const gap = (before) => { while (absent.length && absent[0] < before) lines.push(`${absent.shift()},,,,,,,,,not_finite`); };
  for (let i = 0; i < shown; i++) {
    const number = index?.[i] ?? i, place = [0, 1, 2].map((k) => Number((positions[3 * i + k] + origin[k]).toFixed(Math.min(digits, 15))));
    const known = deviation && Number.isFinite(deviation[i]);
    gap(number);
    lines.push([number, ...place, known ? form(deviation[i]) : "", known && parameters ? form(parameters[2 * i]) : "", known && parameters ? form(parameters[2 * i + 1]) : "",
      known && faces ? faces[i] : "", known && state[i] < 2 ? ["interior", "free_edge"][state[i]] : "", CSV_STATES[state[i]]].join(","));
  }
  gap(Infinity);
  return `${lines.join("\n")}\n`;
}

// The page as it was loaded, with these marks in it.
function pageWith(loaded, marks) {
  const kept = JSON.stringify(marks).replace(/</g, "\\u003c"), opening = '<script type="application/json" id="kept">';
  const from = loaded.indexOf(opening) + opening.length, to = loaded.indexOf("<\/script>", from);
  return `<!doctype html>\n${loaded.slice(0, from)}${kept}${loaded.slice(to)}`;
}
