// The path in space, on a canvas: projected along a direction that can be turned.
const everything = [...data.paths.flat(), ...data.orbits.flat()];
const reach = Math.max(0.1, ...everything.map((p) => Math.hypot(p[0], p[1], p[2])));
const FROM_ABOVE = { yaw: 0, pitch: Math.PI / 2, zoom: 1, height: 1 };

function project(view, width, height) {
  const scale = (0.46 * Math.min(width, height) * view.zoom) / reach;
  const [c, s] = [Math.cos(view.yaw), Math.sin(view.yaw)];
  const [up, along] = [Math.cos(view.pitch), Math.sin(view.pitch)];
  return (p) => {
    const x = p[0] * c - p[1] * s;
    const y = p[0] * s + p[1] * c;
    return [width / 2 + scale * x, height / 2 - scale * (y * along + p[2] * view.height * up)];
  };
}

function drawSpace(canvas, view, named) {
  const width = canvas.clientWidth;
  const height = Math.round(Math.min(width, 520) * 0.92);
  const sharp = window.devicePixelRatio || 1;
  canvas.style.height = height + "px";
  canvas.width = Math.round(width * sharp);
  canvas.height = Math.round(height * sharp);
  const pen = canvas.getContext("2d");
  pen.setTransform(sharp, 0, 0, sharp, 0, 0);
  pen.clearRect(0, 0, width, height);
  pen.font = "12px system-ui, sans-serif";
  const at = project(view, width, height);
  const line = (list, stroke, thick) => {
    pen.beginPath();
    list.forEach((p, k) => (k ? pen.lineTo(...at(p)) : pen.moveTo(...at(p))));
    pen.strokeStyle = stroke;
    pen.lineWidth = thick;
    pen.stroke();
  };
  rings(pen, at, line);
  pen.globalAlpha = 0.45;
  data.orbits.forEach((orbit) => line(orbit, colour("quiet"), 0.7));
  pen.globalAlpha = 1;
  data.paths.forEach((path, k) => line(path, viridis(data.paths.length > 1 ? k / (data.paths.length - 1) : 0.5), 2.2));
  pen.setLineDash([2, 3]);
  data.stays.forEach((stay) => line(stay, colour("ink"), 1.6));
  pen.setLineDash([]);
  dot(pen, at([0, 0, 0]), 5, colour("orange"));
  const spots = data.stops.map((stop) => ({ stop, at: at(stop.at) }));
  if (Math.abs(Math.sin(view.pitch)) < 0.98) {
    // Stems down to the ecliptic tell what is above it and what below.
    spots.forEach(({ stop }) => line([stop.at, [stop.at[0], stop.at[1], 0]], colour("quiet"), 0.8));
  }
  spots.forEach((spot) => dot(pen, spot.at, 3, colour("ink")));
  labels(pen, spots, width, height, named);
  return spots;
}

function rings(pen, at, line) {
  const step = reach > 12 ? 10 : reach > 6 ? 5 : 1;
  for (let radius = step; radius <= reach * 1.05; radius += step) {
    const ring = [];
    for (let k = 0; k <= 96; k++) ring.push([radius * Math.cos((k * Math.PI) / 48), radius * Math.sin((k * Math.PI) / 48), 0]);
    pen.setLineDash([1, 4]);
    line(ring, colour("quiet"), 1);
    pen.setLineDash([]);
    const [x, y] = at([radius * Math.SQRT1_2, -radius * Math.SQRT1_2, 0]);
    pen.fillStyle = colour("quiet");
    pen.fillText(radius + " AU", x + 2, y + 2);
  }
}

function dot(pen, [x, y], radius, fill) {
  pen.beginPath();
  pen.arc(x, y, radius, 0, 2 * Math.PI);
  pen.fillStyle = fill;
  pen.fill();
}

// Labels keep out of each other's way: a name where there is room, else the number alone.
function labels(pen, spots, width, height, named) {
  const taken = [];
  pen.fillStyle = colour("ink");
  for (const { stop, at } of spots) {
    const texts = named && width > 420 ? [stop.number + " " + stop.name.slice(0, 18), String(stop.number)] : [String(stop.number)];
    search: for (const text of texts) {
      const wide = pen.measureText(text).width;
      // Outwards is where the path is not.
      const away = ([dx, dy]) => -Math.hypot(at[0] + dx + wide / 2 - width / 2, at[1] + dy - 5 - height / 2);
      const places = [[6, -5], [6, 13], [-wide - 6, -5], [-wide - 6, 13], [-wide / 2, -9], [-wide / 2, 19]];
      for (const [dx, dy] of places.sort((a, b) => away(a) - away(b))) {
        const box = [at[0] + dx, at[1] + dy - 11, at[0] + dx + wide, at[1] + dy + 2];
        const inside = box[0] > 0 && box[1] > 0 && box[2] < width && box[3] < height;
        if (inside && taken.every((t) => box[2] < t[0] || box[0] > t[2] || box[3] < t[1] || box[1] > t[3])) {
          taken.push(box);
          pen.fillText(text, box[0], box[3] - 2);
          break search;
        }
      }
    }
  }
}

function turnable(canvas, view, show) {
  const held = new Map();
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    held.set(event.pointerId, [event.clientX, event.clientY]);
  });
  const release = (event) => held.delete(event.pointerId);
  canvas.addEventListener("pointerup", release);
  canvas.addEventListener("pointercancel", release);
  canvas.addEventListener("pointermove", (event) => {
    const before = held.get(event.pointerId);
    if (!before) return;
    const now = [event.clientX, event.clientY];
    if (held.size === 2) {
      const other = [...held.entries()].find(([id]) => id !== event.pointerId)[1];
      const gap = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]) || 1;
      zoom((gap(now) / gap(before)));
    } else {
      turn((now[0] - before[0]) * 0.01, (now[1] - before[1]) * 0.01);
    }
    held.set(event.pointerId, now);
    show();
  });
  canvas.addEventListener("wheel", (event) => {
    // Only once it was clicked: a page that is scrolled past should not zoom.
    if (document.activeElement !== canvas) return;
    event.preventDefault();
    zoom(Math.exp(-event.deltaY * 0.001));
    show();
  }, { passive: false });
  canvas.addEventListener("keydown", (event) => {
    const steps = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1] };
    if (steps[event.key]) turn(...steps[event.key]);
    else if (event.key === "+" || event.key === "=") zoom(1.2);
    else if (event.key === "-") zoom(1 / 1.2);
    else return;
    event.preventDefault();
    show();
  });
  const turn = (yaw, pitch) => {
    view.yaw += yaw;
    view.pitch = Math.min(Math.PI / 2, Math.max(-Math.PI / 2, view.pitch + pitch));
  };
  const zoom = (factor) => {
    view.zoom = Math.min(40, Math.max(0.5, view.zoom * factor));
  };
  const button = (id, act) => byId(id).addEventListener("click", () => { act(byId(id)); show(); });
  button("nearer", () => zoom(1.3));
  button("farther", () => zoom(1 / 1.3));
  button("upright", () => Object.assign(view, START));
  button("higher", (pressed) => {
    view.height = view.height === 1 ? 5 : 1;
    pressed.setAttribute("aria-pressed", String(view.height !== 1));
  });
}

const START = { yaw: -0.6, pitch: 0.5, zoom: 1 };

function pointable(canvas, spotsOf) {
  const tell = (event) => {
    const box = canvas.getBoundingClientRect();
    const away = ({ at }) => Math.hypot(at[0] - (event.clientX - box.left), at[1] - (event.clientY - box.top));
    const near = spotsOf().filter((spot) => away(spot) < 16).sort((a, b) => away(a) - away(b))[0];
    if (near) byId("pointed").textContent = `${near.stop.number}: ${near.stop.name} (${near.stop.id}), ${near.stop.date}`;
  };
  canvas.addEventListener("pointermove", tell);
  canvas.addEventListener("pointerdown", tell);
}
