// Charts with axes, as SVG.
function frame(host, width, height, x, y, left) {
  host.textContent = "";
  const box = { left: left || 56, right: 12, top: 12, bottom: 40 };
  const canvas = shape(host, "svg", {
    viewBox: `0 0 ${width} ${height}`, width, height, role: "img", "aria-label": y.label + " over " + x.label,
  });
  const X = (v) => box.left + ((v - x.low) / (x.high - x.low || 1)) * (width - box.left - box.right);
  const Y = (v) => height - box.bottom - ((v - y.low) / (y.high - y.low || 1)) * (height - box.top - box.bottom);
  for (const tick of y.ticks) {
    shape(canvas, "line", { class: "grid", x1: box.left, x2: width - box.right, y1: Y(tick.at), y2: Y(tick.at) });
    shape(canvas, "text", { x: box.left - 6, y: Y(tick.at) + 4, "text-anchor": "end" }, tick.label);
  }
  for (const tick of x.ticks) {
    shape(canvas, "line", { class: "axis", x1: X(tick.at), x2: X(tick.at), y1: height - box.bottom, y2: height - box.bottom + 5 });
    const end = X(tick.at) > width - 34 ? "end" : X(tick.at) < box.left + 20 ? "start" : "middle";
    shape(canvas, "text", { x: X(tick.at), y: height - box.bottom + 18, "text-anchor": end }, tick.label);
  }
  shape(canvas, "line", { class: "axis", x1: box.left, x2: width - box.right, y1: height - box.bottom, y2: height - box.bottom });
  shape(canvas, "text", { x: (box.left + width - box.right) / 2, y: height - 6, "text-anchor": "middle" }, x.label);
  shape(canvas, "text", {
    x: -(height - box.bottom + box.top) / 2, y: 13, transform: "rotate(-90)", "text-anchor": "middle",
  }, y.label);
  return { canvas, X, Y, box };
}

const points = (list, X, Y) => list.map((p, k) => (k ? "L" : "M") + X(p[0]).toFixed(1) + " " + Y(p[1]).toFixed(1)).join("");

function missionTime(width) {
  const low = data.visits[0].departure;
  const high = data.visits[data.visits.length - 1].arrival;
  return { low, high, ticks: dateTicks(low, high, Math.max(2, width / 90)), label: "date (TDB)" };
}

function drawThrust(host, width) {
  const most = data.limits.thrust_n || 1;
  const y = { low: 0, high: most * 1.08, ticks: ticks(0, most, 4), label: "thrust, N" };
  const { canvas, X, Y } = frame(host, width, 190, missionTime(width), y);
  for (const leg of data.thrust) {
    let path = `M${X(leg[0][0]).toFixed(1)} ${Y(0).toFixed(1)}`;
    leg.forEach((step, k) => {
      path += `V${Y(step[1]).toFixed(1)}`;
      if (k + 1 < leg.length) path += `H${X(leg[k + 1][0]).toFixed(1)}`;
    });
    shape(canvas, "path", { class: "area", d: path + `V${Y(0).toFixed(1)}Z` });
  }
  limit(canvas, X, Y, most, "T max");
}

function drawMass(host, width) {
  const kg = data.mass.map((p) => p[1]);
  const dry = data.limits.dry_kg;
  const high = Math.max(...kg);
  const low = Math.min(dry, ...kg);
  const pad = 0.06 * (high - low || 1);
  const y = { low: low - pad, high: high + pad, ticks: ticks(low, high, 5), label: "mass, kg" };
  const { canvas, X, Y } = frame(host, width, 210, missionTime(width), y);
  shape(canvas, "path", { class: "trace green", d: points(data.mass, X, Y) });
  limit(canvas, X, Y, dry, "dry mass");
}

function limit(canvas, X, Y, value, name) {
  const time = missionTime(600);
  shape(canvas, "line", { class: "limit", x1: X(time.low), x2: X(time.high), y1: Y(value), y2: Y(value) });
  shape(canvas, "text", { x: X(time.high), y: Y(value) - 4, "text-anchor": "end" }, name);
}

function drawVisits(host, width) {
  const narrow = width < 560;
  const row = narrow ? 40 : 26;
  const height = data.visits.length * row + 64;
  const y = { low: data.visits.length, high: 0, ticks: [], label: "" };
  const { canvas, X, Y, box } = frame(host, width, height, missionTime(width), y, narrow ? 10 : 170);
  data.visits.forEach((visit, k) => {
    const top = Y(k) + (narrow ? 18 : 4);
    const name = visit.number + "  " + visit.name;
    const most = narrow ? 40 : 22;
    const label = shape(canvas, "text", {
      class: "name", x: narrow ? box.left : box.left - 8, y: narrow ? top - 4 : top + 13,
      "text-anchor": narrow ? "start" : "end",
    }, name.length > most ? name.slice(0, most - 1) + "…" : name);
    const bar = (kind, from, to, words) => {
      const made = shape(canvas, "rect", {
        class: kind, x: X(from).toFixed(1), y: top, height: 16, rx: 2,
        width: Math.max(1, X(to) - X(from)).toFixed(1),
      });
      shape(made, "title", {}, words);
    };
    bar("flight", visit.departure, visit.arrival, `leg ${visit.number}: ${dateOf(visit.departure)} to ${dateOf(visit.arrival)}`);
    if (visit.fly_by) {
      const x = X(visit.arrival);
      shape(canvas, "path", { class: "pass-by", d: `M${x} ${top - 1}l6 9l-6 9l-6 -9Z` });
    } else if (visit.until > visit.arrival) {
      bar("stay", visit.arrival, visit.until, `stay: ${(visit.until - visit.arrival).toFixed(1)} days`);
    }
    shape(label, "title", {}, visit.name);
  });
  key(host, [["flight", "rect", "flight"], ["stay", "rect", "stay"]].concat(
    data.visits.some((visit) => visit.fly_by) ? [["pass-by", "rect", "fly-by"]] : []));
}

// Each kind has a mark of its own: colours alone do not reach everybody.
const MARKS = {
  circle: (x, y, r) => `M${x - r} ${y}a${r} ${r} 0 1 0 ${2 * r} 0a${r} ${r} 0 1 0 ${-2 * r} 0`,
  square: (x, y, r) => `M${x - r} ${y - r}h${2 * r}v${2 * r}h${-2 * r}Z`,
  diamond: (x, y, r) => `M${x} ${y - r * 1.3}l${r * 1.3} ${r * 1.3}l${-r * 1.3} ${r * 1.3}l${-r * 1.3} ${-r * 1.3}Z`,
  triangle: (x, y, r) => `M${x} ${y - r * 1.2}l${r * 1.2} ${r * 2.1}h${-r * 2.4}Z`,
  cross: (x, y, r) => `M${x - r} ${y - r}l${2 * r} ${2 * r}m0 ${-2 * r}l${-2 * r} ${2 * r}`,
};

function key(host, entries) {
  const list = document.createElement("ul");
  list.className = "key";
  for (const [kind, mark, words] of entries) {
    const item = document.createElement("li");
    const sample = shape(item, "svg", { viewBox: "0 0 26 14", "aria-hidden": "true" });
    if (mark === "rect") shape(sample, "rect", { class: kind, x: 1, y: 1, width: 24, height: 12, rx: 2 });
    else shape(sample, "path", { class: "trace " + kind, d: MARKS[mark](13, 7, 4) });
    item.appendChild(document.createTextNode(words));
    list.appendChild(item);
  }
  host.appendChild(list);
}

const COUNTS = [
  ["quiet", "circle", "proposed", (r) => r[2]],
  ["blue", "square", "left after pruning", (r) => Math.max(0, r[2] - r[3])],
  ["orange", "diamond", "optimised", (r) => r[4]],
  ["green", "triangle", "flyable", (r) => r[5]],
  ["purple", "cross", "kept", (r) => r[6]],
];

function drawRanks(host, width, pass) {
  const sums = new Map();
  for (const line of data.ranks) {
    if (pass !== "all" && line[0] !== Number(pass)) continue;
    const sum = sums.get(line[1]) || [0, line[1], 0, 0, 0, 0, 0];
    for (let k = 2; k < 7; k++) sum[k] += line[k];
    sums.set(line[1], sum);
  }
  const lines = [...sums.values()].sort((a, b) => a[1] - b[1]);
  const high = Math.log10(Math.max(10, ...lines.flatMap((line) => COUNTS.map((c) => c[3](line)))));
  const last = Math.max(1, ...lines.map((line) => line[1]));
  const low = Math.min(1, ...lines.map((line) => line[1]));
  const x = {
    low: low - 0.3, high: last + 0.3, label: "rank (legs of the tour)",
    ticks: ticks(low, last, Math.min(last - low || 1, width / 50)).filter((t) => Number.isInteger(t.at)),
  };
  // Nothing at all is drawn at the bottom, below one.
  const floor = -0.35;
  const y = { low: floor, high: high * 1.04, ticks: [{ at: floor, label: "0" }, ...decades(0, high)], label: "hops" };
  const { canvas, X, Y } = frame(host, width, 300, x, y, 60);
  for (const [kind, mark, name, count] of COUNTS) {
    const path = lines.map((line) => [line[1], count(line) > 0 ? Math.log10(count(line)) : floor]);
    if (path.length > 1) shape(canvas, "path", { class: "trace " + kind, d: points(path, X, Y) });
    lines.forEach((line, k) => {
      const made = shape(canvas, "path", { class: "trace " + kind, d: MARKS[mark](X(path[k][0]), Y(path[k][1]), 4) });
      shape(made, "title", {}, `rank ${line[1]}: ${count(line)} ${name}`);
    });
  }
  key(host, COUNTS);
}

const FATES = [
  ["quiet", "circle", "pruned, cannot be flown", (c) => !c[2] && !c[3]],
  ["orange", "square", "kept, cannot be flown", (c) => c[2] && !c[3]],
  ["blue", "triangle", "kept, flyable", (c) => c[2] && c[3]],
  ["red", "diamond", "pruned, flyable (lost)", (c) => !c[2] && c[3]],
];

function drawCandidates(host, width) {
  const days = data.candidates.map((c) => c[0]);
  const low = Math.min(...days);
  const high = Math.max(...days);
  const pad = 0.03 * (high - low || 10);
  const x = { low: low - pad, high: high + pad, ticks: ticks(low, high, width / 80), label: "flight time, days" };
  const y = { low: -0.05, high: 2.05, ticks: ticks(0, 2, 4), label: "predicted margin m*/m0" };
  const { canvas, X, Y, box } = frame(host, width, 340, x, y);
  shape(canvas, "line", { class: "limit", x1: box.left, x2: width - box.right, y1: Y(1), y2: Y(1) });
  for (const [kind, mark, , holds] of FATES) {
    const size = kind === "red" ? 5 : 2.6;
    const d = data.candidates.filter(holds).map(
      (c) => MARKS[mark](Number(X(c[0]).toFixed(1)), Number(Y(Math.min(2, Math.max(0, c[1]))).toFixed(1)), size)).join("");
    if (d) shape(canvas, "path", { class: "trace " + kind, d });
  }
  key(host, FATES.map(([kind, mark, words, holds]) => [kind, mark, `${words}: ${data.candidates.filter(holds).length}`]));
}
