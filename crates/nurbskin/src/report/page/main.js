// The page: reads the data, fills what is words, starts the view where there can be one, and ties the controls to it.

const byId = (id) => document.getElementById(id);
// Name, text, whether there is any, whether it is on at first. Points lie on the surface, unless they are far off it.
const LAYERS = [
  ["surface", "Surface", (d) => d.mesh, true], ["points", "Points", (d) => d.points, (d) => !d.mesh || d.bounds.diagonal > 2 * d.bounds.size],
  ["rejected", "Points not used", (d) => d.points?.state.some((k) => k >= UNUSED && k < DUPLICATE), true],
  ["net", "Control net", (d) => d.lines.control_net], ["iso", "Iso-curves", (d) => d.lines.iso_curves],
  ["edges", "Edges", (d) => d.lines.edges && d.joins.some((join) => join.kind !== "sharp"), true],
  ["features", "Feature lines", (d) => d.lines.edges && d.joins.some((join) => join.kind === "sharp"), true], ["seams", "Seams and poles", (d) => d.lines.seams || d.poles.length, true],
  ["unsupported", "Area without data", (d) => d.mesh?.deviation?.some(Number.isNaN), true], ["worst", "Worst places", (d) => d.worst.length, true],
];
const MODES = [
  ["deviation", "deviation", (d) => d.mesh?.deviation || d.points?.deviation], ["height", "height", (d) => d.points && !d.mesh],
  ["plain", "plain", () => true], ["mean", "mean curvature", (d) => d.mesh?.mean], ["gaussian", "Gaussian curvature", (d) => d.mesh?.gaussian],
  ["zebra", "zebra stripes", (d) => d.mesh], ["jumps", "angles between faces", (d) => d.mesh && d.lines.edges && d.joins.some((join) => join.kind === "smooth" && Number.isFinite(jumpOf(join)))],
  ["faces", "faces", (d) => d.mesh?.faces && d.faces.length > 1], ["by_face", "mean deviation of faces", byFace],
];

const NOTES = {
  plain: "No colour scale.",
  zebra: "Reflected stripes: where they break, the tangent does; where they kink, the curvature does.",
  faces: "One colour for each face.",
  jumps: "How far the normals of two faces turn at their common edge, at most; the numbers are those of the edges.",
};

// The limits of the scales that a mode has: P95 of what it shows.
function firstLimits(data) {
  const { mesh, points, bounds, statistics, faces } = data, limits = {};
  const deviations = mesh?.deviation ?? points?.deviation;
  if (deviations) limits.deviation = Math.max(statistics?.scan_to_surface?.p95 || magnitude(deviations, 0.95) || data.tolerance || 0, 1e-9 * bounds.size);
  // Rounded up, so that the noise of a constant curvature is not off the scale; no less than what is flat.
  const rounded = (values, flat, share = 0.95) => {
    const x = Math.max(1.02 * magnitude(values, share), flat), step = 10 ** (Math.floor(Math.log10(x)) - 1);
    return Number((Math.ceil(x / step) * step).toPrecision(2));
  };
  const means = faces.map((face) => face.deviation?.count && face.deviation.signed_mean).filter(Number.isFinite);
  if (means.length) limits.by_face = rounded(means, 1e-9 * bounds.size, 1);
  // The map of the tolerance reaches beyond it, as far as points do, but no farther than shows the tolerance.
  const s = statistics?.scan_to_surface, t = data.tolerance;
  if (t && deviations) limits.tolerance = Math.max(1.5 * t, Math.min(s?.max ?? 0, Math.max(4 * t, s?.p95 ?? 0)));
  if (mesh?.mean) limits.mean = rounded(mesh.mean, 1e-3 / bounds.size);
  if (mesh?.gaussian) limits.gaussian = rounded(mesh.gaussian, 1e-6 / bounds.size ** 2);
  return limits;
}

// Which of the limits holds: that of the mode, or that of the map of the tolerance.
const limitName = ({ mode, map }) => (mode === "deviation" && map === "tolerance" ? "tolerance" : mode);

function scaleOf(data, settings, limits, lengths) {
  const { mode, map } = settings, limit = limits[limitName(settings)], per = data.unit ? `1/${data.unit}` : "";
  if (mode === "height") {
    const { low, high, diagonal } = data.bounds, form = formatter(diagonal, 4);
    return { map: "height", low: low[2], high: high[2], title: "Height z", unit: data.unit, offset: data.origin[2], format: (x) => form(x + data.origin[2]) };
  }
  if (!limit) return null;
  const common = { map, low: -limit, high: limit, symmetric: true };
  if (mode === "by_face") return { ...common, map: map === "tolerance" ? "diverging" : map, title: "Mean deviation of faces", unit: lengths.unit, factor: lengths.factor, note: "+ outside, \u2212 inside", format: lengths.aligned, alone: lengths.alone };
  if (mode === "deviation" && map === "tolerance") {
    const high = Math.max(limit, data.tolerance);
    Object.assign(common, { low: -high, high, band: data.tolerance });
  } else if (map === "tolerance") common.map = "diverging";
  if (mode === "deviation") return { ...common, title: "Deviation", unit: lengths.unit, factor: lengths.factor, note: "+ outside, \u2212 inside", tolerance: data.tolerance, format: lengths.aligned, alone: lengths.alone };
  const title = mode === "mean" ? "Mean curvature" : "Gaussian curvature";
  return { ...common, title, unit: mode === "mean" ? per : per && `${per}²`, format: formatter(limit, 2) };
}

function swatches({ mesh, joins }, { layers, mode }, points) {
  const found = mode === "jumps" ? jumpSwatches(joins) : [];
  if (layers.surface && layers.unsupported && mesh?.deviation?.some(Number.isNaN) && ["deviation", "plain", "by_face"].includes(mode)) found.push(["hatched", "no data under it"]);
  if (layers.points && points.size > 1) for (const k of points) if (k < UNUSED || layers.rejected) found.push([`state-${k}`, k ? STATES[k] : "point"]);
  return found;
}

async function start() {
  // Before anything changes, for a copy of the page.
  const loaded = document.documentElement.outerHTML;
  const data = await readData(), reference = data.statistics?.scan_to_surface?.p95 || data.tolerance || 1e-3 * data.bounds.size;
  const lengths = lengthsLike(data.shown_in, reference), limits = firstLimits(data), first = { ...limits };
  const states = new Set(data.points ? Array.from(data.points.state).filter((k) => k < DUPLICATE).sort() : []);
  const has = (list) => list.filter(([, , there]) => there(data));
  const modes = has(MODES).map(([name]) => name), layers = has(LAYERS).map(([name]) => name);
  const p99 = data.statistics?.scan_to_surface?.p99 ?? 0, { size } = data.bounds;
  const settings = {
    mode: modes[0], map: data.tolerance && modes[0] === "deviation" ? "tolerance" : "diverging", stripes: 20, pointSize: 0,
    lift: Math.min(Math.max(0.0015 * size, 1.2 * p99), 0.02 * size),
    layers: Object.fromEntries(LAYERS.map(([name, , there, on]) => [name, !!there(data) && (typeof on === "function" ? on(data) : !!on)])),
  };
  // Nothing is cut away where nothing says what lies under it.
  if (!layers.includes("unsupported")) settings.layers.unsupported = true;

  let view = null;
  const said = (text) => { byId("said").textContent = text; byId("tool-help").textContent = text; };
  const marks = new Marks(data, lengths, { moved: () => view?.moved(), said });
  const section = data.mesh ? new Section(data, settings, lengths, () => view?.moved()) : null;
  byId("section").hidden = !section;
  byId("save-csv").hidden = !data.points?.deviation;
  byId("save-csv").addEventListener("click", () => save(fileName(data.title, ".csv"), csvOf(data), "text/csv"));
  byId("save-page").addEventListener("click", () => save(fileName(data.title, ".html"), pageWith(loaded, marks.items), "text/html"));
  byId("save-picture").addEventListener("click", () => view && savePicture(view, data));
  fillHead(data, lengths, (place) => view?.visit(place));
  fillTables(byId("tables"), data, lengths, {
    join: (join) => view?.visit(join.place),
    face: (k) => view?.visit(middleOf(data, k)),
  });
  fillProvenance(byId("provenance"), data, lengths);
  if (data.worst.length) {
    byId("worst").hidden = false;
    fillWorst(byId("worst").querySelector(".scroll"), data, lengths, (k) => view?.choose(k));
  }
  if (!data.histogram && !data.worst.length) {
    document.body.classList.add("wide");
    byId("no-deviation").hidden = false;
    byId("no-deviation").textContent = data.kind === "view"
      ? "No deviation here: this page shows what is in the file. nurbskin deviation SCAN CAD --report FILE.html compares a scan with a surface."
      : "No deviation here: nothing was measured.";
  }

  function histogram() {
    if (!data.histogram?.counts?.length) return;
    byId("histogram").hidden = false;
    const scale = scaleOf(data, { ...settings, mode: "deviation" }, { deviation: reference, ...limits }, lengths);
    const common = 1.5 * (data.statistics?.scan_to_surface?.p95 ?? Infinity), few = common < 0.5 * data.histogram.high;
    byId("crop-tool").hidden = !few;
    const shown = few && byId("crop").checked ? cropped(data.histogram, common) : data.histogram;
    drawHistogram(byId("histogram").querySelector(".chart"), shown, {
      scale, lengths, tolerance: data.tolerance, logarithmic: byId("log").checked,
    });
  }
  for (const id of ["log", "crop"]) byId(id).addEventListener("change", histogram);
  function trade() {
    if (!data.trade?.points?.length) return;
    byId("trade").hidden = false;
    drawTrade(byId("trade").querySelector(".chart"), data.trade, lengths);
  }
  new ResizeObserver(() => { histogram(); trade(); }).observe(byId("side"));

  // Shows what the settings say, in the controls and in the view.
  function update() {
    settings.scale = scaleOf(data, settings, limits, lengths);
    const limit = limitName(settings);
    if (section) {
      section.scale = scaleOf(data, { ...settings, mode: "deviation" }, limits, lengths);
      section.ask();
    }
    byId("mode").value = settings.mode;
    byId("map").value = settings.scale?.symmetric ? settings.scale.map : settings.map;
    byId("scale-tools").hidden = !settings.scale?.symmetric;
    byId("stripes-tool").hidden = settings.mode !== "zebra";
    byId("size-tool").hidden = !settings.layers.points;
    if (settings.scale?.symmetric) {
      byId("limit").value = Number(((settings.scale.factor ?? 1) * limits[limit]).toPrecision(4));
      byId("limit").removeAttribute("aria-invalid");
      byId("limit-unit").textContent = settings.scale.unit;
      const focused = [...byId("presets").children].indexOf(document.activeElement);
      byId("presets").replaceChildren(...presets().map(([name, value]) => element("button", {
        type: "button", "aria-pressed": Math.abs(value / limits[limit] - 1) < 1e-6, onclick: () => setLimit(value),
      }, name)));
      byId("presets").children[focused]?.focus();
    }
    byId("layers").querySelector("[data-layer=rejected]")?.toggleAttribute("hidden", !settings.layers.points);
    for (const button of byId("layers").children) button.setAttribute("aria-pressed", settings.layers[button.dataset.layer]);
    byId("canvas").setAttribute("aria-label", `${data.title}, ${MODES.find(([name]) => name === settings.mode)[1]}`);
    histogram();
    legend();
    view?.moved();
  }
  function legend() {
    const lying = matchMedia("screen and (max-width: 640px)").matches;
    const scale = settings.layers.surface || settings.layers.points ? settings.scale : null;
    const inside = settings.mode === "plain" && data.mesh?.normals ? " The inside of the surface is bluish." : "";
    drawLegend(byId("legend"), { scale, note: (NOTES[settings.mode] ?? "") + inside, swatches: swatches(data, settings, states), lying });
  }
  function presets() {
    const exactly = settings.mode !== "deviation" || data.statistics?.scan_to_surface?.p95 === first.deviation;
    const name = limitName(settings), found = [[exactly && name === "deviation" ? "P95" : "default", first[name]]];
    if (settings.mode !== "deviation") return found;
    const largest = data.statistics?.scan_to_surface?.max;
    if (data.tolerance) found.push(["tolerance", data.tolerance]);
    if (largest > 0) found.push(["largest", largest]);
    return found;
  }
  function setLimit(value) {
    if (value > 0 && Number.isFinite(value)) {
      // With the map of the tolerance, what is within it stays green.
      const name = limitName(settings);
      limits[name] = name === "tolerance" ? Math.max(value, data.tolerance) : value;
      update();
    } else byId("limit").setAttribute("aria-invalid", "true");
  }
  const set = (name, value) => { settings[name] = value; update(); };
  const setLayer = (name, on) => { settings.layers[name] = on; update(); };

  if (data.tolerance) [byId("map").options[0].hidden, byId("map").options[0].disabled] = [false, false];
  byId("mode").append(...has(MODES).map(([name, text]) => element("option", { value: name }, text)));
  byId("mode").addEventListener("change", (e) => set("mode", e.target.value));
  byId("map").addEventListener("change", (e) => set("map", e.target.value));
  byId("stripes").addEventListener("input", (e) => set("stripes", Number(e.target.value)));
  byId("point-size").addEventListener("input", (e) => set("pointSize", Number(e.target.value)));
  byId("limit").addEventListener("change", (e) => setLimit(Number(e.target.value.trim().replace(",", ".").replace("\u2212", "-")) / (settings.scale?.factor ?? 1)));
  byId("layers").append(...has(LAYERS).map(([name, text]) => element("button", {
    type: "button", "data-layer": name, onclick: () => setLayer(name, !settings.layers[name]),
  }, text)));
  const absent = LAYERS.filter(([name]) => !layers.includes(name) && !["rejected", "unsupported", "worst"].includes(name)).map(([, text]) => text.toLowerCase());
  byId("absent").textContent = absent.length ? `Not in this file: ${absent.join(", ")}.` : "";
  for (const button of document.querySelectorAll("[data-view]")) button.addEventListener("click", () => view?.look(button.dataset.view));
  byId("perspective").addEventListener("click", () => view?.project(!view.camera.perspective));
  if (data.points && data.points.count < data.points.total) {
    byId("thinned").textContent = `${count(data.points.count)} of ${count(data.points.total)} points are drawn`
      + (data.statistics ? "; statistics and histogram are over all of them." : ".");
  }
  byId("log").parentElement.hidden = !data.histogram;

  update();
  trade();
  try {
    if (!data.mesh && !data.points && !Object.values(data.lines).some(Boolean)) throw new Error("There is nothing to draw in this page.");
    view = new View(data, settings, {
      lengths, marks, section,
      changed: (k) => byId("worst").querySelectorAll("tbody tr").forEach((row, i) => (i === k ? row.setAttribute("aria-current", "true") : row.removeAttribute("aria-current"))),
    });
    matchMedia("screen and (max-width: 640px)").addEventListener("change", update);
    update();
    view.draw();
  } catch (error) {
    document.body.classList.add("flat");
    byId("no-view").hidden = false;
    byId("no-view").textContent = error.message === "no WebGL 2"
      ? "The 3-D view needs WebGL 2, which this browser or its graphics driver does not offer. All figures are below."
      : error.message;
  }
  return { data, settings, modes, layers, view, set, setLayer, setLimit, marks, section, loaded };
}

// The vertex of a face that is nearest to the middle of its vertices, in the coordinates of the file.
function middleOf({ mesh, origin }, face) {
  const own = [];
  for (let v = 0; v < (mesh?.faces?.length ?? 0); v++) if (mesh.faces[v] === face) own.push([0, 1, 2].map((k) => mesh.positions[3 * v + k]));
  if (!own.length) return origin;
  const mean = [0, 1, 2].map((k) => own.reduce((sum, p) => sum + p[k], 0) / own.length);
  const far = (p) => Math.hypot(...sub(p, mean));
  return add(own.reduce((a, b) => (far(b) < far(a) ? b : a)), origin);
}

// For tests and for scripts in the console. `ready` is kept once the page is drawn; positions are in the file's unit.
window.nurbskin = {};
window.nurbskin.ready = start().then(({ data, settings, modes, layers, view, set, setLayer, setLimit, marks, section, loaded }) => {
  Object.assign(window.nurbskin, {
    modes, layers, settings, data, drawn: !!view, setLayer, setLimit, marks, section,
    setMode: (mode) => set("mode", mode), setMap: (map) => set("map", map),
    camera: () => view?.camera.pose, look: (name) => view?.look(name), worst: (k) => view?.choose(k), visit: (place) => view?.visit(place),
    pick: (x, y) => view?.pick(x, y), frames: () => view?.frames, resting: () => !view || view.resting,
    locate: (p) => { const { x, y } = view.camera.project(sub(p, data.origin), view.aspect); return [(x + 1) / 2 * view.width, (1 - y) / 2 * view.height]; },
    csv: () => csvOf(data), copy: () => pageWith(loaded, marks.items),
  });
  return new Promise((done) => requestAnimationFrame(() => done(true)));
}).catch((error) => {
  document.body.classList.add("broken");
  byId("trouble").hidden = false;
  byId("trouble").textContent = `The data of this page cannot be shown: ${error.message}`;
  return false;
});
