// Numbers as people read them: a true minus, thin spaces between thousands, as many digits as mean something.

function grouped(digits) {
  const [whole, part] = digits.split(".");
  const spaced = whole.length > 4 ? whole.replace(/\B(?=(\d{3})+$)/g, "\u202f") : whole;
  return part === undefined ? spaced : `${spaced}.${part}`;
}

function signed(x, text, plus) {
  return (x < 0 ? "\u2212" : plus && x > 0 ? "+" : "") + text;
}

// Writes numbers so that `digits` digits remain of one as large as `reference`; all of a table align.
function formatter(reference, digits = 3) {
  const size = Math.floor(Math.log10(Math.abs(reference) || 1));
  const decimals = Math.max(0, digits - 1 - size);
  return (x, plus = false) => {
    if (x === null || x === undefined || !Number.isFinite(x)) return "–";
    const a = Math.abs(x);
    if (decimals > 8 || a >= 1e9) return a === 0 ? "0" : signed(x, exponential(a, digits), plus);
    const text = a.toFixed(decimals);
    return signed(Number(text) === 0 ? 0 : x, grouped(text), plus);
  };
}

function exponential(a, digits) {
  const [m, e] = a.toExponential(digits - 1).split("e");
  return `${m}e${e.replace("+", "").replace("-", "\u2212")}`;
}

const count = (n) => (Number.isFinite(n) ? grouped(String(n)) : "–");
// A share that is not all is never shown as 100 %, nor one that is not nothing as 0 %.
function percent(x) {
  if (!Number.isFinite(x)) return "–";
  if (x < 1 && x > 0.9999) return "> 99.99 %";
  if (x > 0 && x < 0.0001) return "< 0.01 %";
  return `${(100 * x).toFixed(x === 1 || x === 0 ? 0 : 2)} %`;
}

// A number as it was given, or to five digits where it has more.
const exact = (x) => signed(x, grouped(String(Number(Math.abs(x).toPrecision(5)))));

// Writes the multiples of a step.
const stepped = (step) => formatter(step, 1);

// The largest of 1, 2, 5 times a power of ten that is not above x.
function nice(x) {
  const power = 10 ** Math.floor(Math.log10(x));
  return power * ([5, 2, 1].find((m) => m * power <= x * (1 + 1e-9)) ?? 1);
}

// Zero where numbers can have no steps between them: there is no range, or it is lost in their rounding.
function tickStep(low, high, about) {
  const wide = high - low, fine = nice(wide / about), step = wide / fine > 1.5 * about ? 2 * fine : fine;
  return wide > 1e-13 * Math.max(Math.abs(low), Math.abs(high)) && step > 0 && Number.isFinite(step) ? step : 0;
}

// The multiples of the step from low to high; without a step the one number that there is, if it is one.
function ticks(low, high, about) {
  const step = tickStep(low, high, about);
  if (!step) return Number.isFinite(low) && low <= high ? [low] : [];
  const first = Math.ceil(low / step - 1e-9), last = Math.floor(high / step + 1e-9);
  return Array.from({ length: Math.max(0, last - first + 1) }, (_, k) => (first + k) * step);
}

function element(name, attributes = {}, ...children) {
  const svg = ["svg", "g", "path", "rect", "line", "text", "circle", "title", "defs", "linearGradient", "stop", "pattern"].includes(name);
  const made = svg ? document.createElementNS("http://www.w3.org/2000/svg", name) : document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    if (key.startsWith("on")) made.addEventListener(key.slice(2), value);
    else made.setAttribute(key, value);
  }
  made.append(...children);
  return made;
}
