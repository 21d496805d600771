// What all drawings share: data, elements, scales and colours. Texts are set as texts, never parsed.
const data = JSON.parse(document.getElementById("data").textContent);
const NS = "http://www.w3.org/2000/svg";
const byId = (id) => document.getElementById(id);
const redraws = [];

function shape(parent, name, attributes, text) {
  const made = document.createElementNS(NS, name);
  for (const key of Object.keys(attributes || {})) made.setAttribute(key, attributes[key]);
  if (text !== undefined) made.textContent = text;
  parent.appendChild(made);
  return made;
}

function colour(name) {
  return getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim();
}

const isDark = matchMedia("(prefers-color-scheme: dark)");

const VIRIDIS = [
  [68, 1, 84], [71, 44, 122], [59, 81, 139], [44, 113, 142],
  [33, 144, 141], [39, 173, 129], [92, 200, 99], [170, 220, 50], [253, 231, 37],
];

// Viridis without the end that vanishes on the paper.
function viridis(share) {
  const at = (isDark.matches ? 0.3 + 0.7 * share : 0.86 * share) * (VIRIDIS.length - 1);
  const k = Math.min(VIRIDIS.length - 2, Math.floor(at));
  const mix = VIRIDIS[k].map((c, i) => Math.round(c + (at - k) * (VIRIDIS[k + 1][i] - c)));
  return "rgb(" + mix.join(",") + ")";
}

function ticks(low, high, most) {
  const rough = (high - low) / Math.max(1, most);
  const power = Math.pow(10, Math.floor(Math.log10(rough)));
  const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= rough * 0.999);
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + step * 1e-9; k++) {
    found.push({ at: k * step, label: String(Number((k * step).toPrecision(10))) });
  }
  return found;
}

function decades(low, high) {
  const found = [];
  for (let k = Math.ceil(low - 1e-9); k <= high + 1e-9; k++) {
    const label = k < 4 ? String(Math.pow(10, k)) : "10" + [...String(k)].map((d) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[d]).join("");
    found.push({ at: k, label });
  }
  return found;
}

const DAY_MS = 864e5;
const ZERO_MS = Date.UTC(2000, 0, 1);
const dateOf = (t) => new Date(ZERO_MS + t * DAY_MS).toISOString().slice(0, 10);

function dateTicks(low, high, most) {
  const months = (high - low) / 30.44;
  const step = [1, 2, 3, 6, 12, 24, 60, 120, 240, 600].find((s) => months / s <= most) || 1200;
  const begin = new Date(ZERO_MS + low * DAY_MS);
  let month = begin.getUTCFullYear() * 12 + begin.getUTCMonth();
  month = Math.ceil(month / step) * step;
  const found = [];
  for (;; month += step) {
    const at = (Date.UTC(Math.floor(month / 12), month % 12, 1) - ZERO_MS) / DAY_MS;
    if (at > high) return found;
    if (at < low) continue;
    const year = String(Math.floor(month / 12));
    found.push({ at, label: step >= 12 ? year : year + "-" + String((month % 12) + 1).padStart(2, "0") });
  }
}

// Draws now, and again whenever the host's width or the colour scheme changes.
function drawn(host, draw) {
  let width = 0;
  const again = () => {
    width = host.clientWidth;
    if (width > 0) draw(width);
  };
  redraws.push(again);
  again();
  if (window.ResizeObserver) {
    // In a frame of its own: drawing changes the height, which would be reported once more.
    new ResizeObserver(() => {
      requestAnimationFrame(() => {
        if (host.clientWidth !== width) again();
      });
    }).observe(host);
  } else {
    addEventListener("resize", again);
  }
}
isDark.addEventListener("change", () => redraws.forEach((again) => again()));
