"use strict";
// A drop or a scan: pictures with what was found in them. The server knows the corrections; the page only asks and draws.
const at = (id) => document.getElementById(id);
const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
const KEPT = 200e6; // bytes of pictures that stay decoded
let state = null, shown = 0, zoom = 0, tool = "look", points = [], cursor = null, timer = 0, dirty = false;
const pictures = new Map();

// One question after the other: two quick clicks would else be answered in any order, and the page would show the older state.
let answered = Promise.resolve();
function ask(path, body) {
  const answer = answered.then(() => send(path, body));
  answered = answer.catch(() => {});
  return answer;
}

async function send(path, body) {
  const options = body === undefined ? {} : { method: "POST", body: JSON.stringify(body), headers: { "Content-Type": "application/json" } };
  let answer;
  try { answer = await fetch(path, options); } catch { throw new Error("labsim view has ended; start it again"); }
  const found = await answer.json();
  if (!answer.ok) throw new Error(found.trouble || "the server refused");
  return found;
}

async function act(path, body = {}) {
  try { take(await ask(path, body)); complain(""); return true; } catch (trouble) { complain(trouble.message); return false; }
}

const complain = (text) => { at("trouble").textContent = text || (state && state.trouble) || ""; };

function take(found) {
  const first = state === null;
  state = found;
  if (first) begin();
  show();
  if (state.busy) setTimeout(async () => { try { take(await ask("state")); } catch (trouble) { complain(trouble.message); } }, 300);
}

// what a click does: key, name, hint
const TOOLS = {
  drop: {
    look: ["1", "look", ""],
    surface: ["2", "surface", "Click the undisturbed surface."],
    scale: ["3", "scale", "Write a known length, then click its two ends."],
    region: ["4", "region", "Click two corners of where the projectile is looked for."],
  },
  scan: {
    look: ["1", "look", ""],
    axis: ["2", "axis", "Click where the axis of penetration passes this slice."],
    air: ["3", "air", "Click empty space: its mean grey level becomes grey_air."],
    solid: ["4", "solid", "Click solid grain material: its mean grey level becomes filling factor 1."],
  },
};
const KEYS = [["← →", "one picture"], ["↑ ↓", "ten pictures"], ["Home End", "first, last"], ["space", "play, stop"], ["+ −", "zoom"],
  ["1–4", "what a click does"], ["Shift and arrows", "move the cross (with Ctrl by 10)"], ["Enter", "click at the cross"],
  ["r", "measure again"], ["u", "undo"], ["s", "save"], ["Esc", "back to looking"]];

function element(name, properties = {}, ...children) {
  const made = Object.assign(document.createElement(name), properties);
  made.append(...children);
  return made;
}

function begin() {
  const drop = state.kind === "drop";
  document.title = `${state.name} – labsim view`;
  at("name").textContent = state.name;
  at("measure").textContent = drop ? "track again" : "reduce again";
  at("measure").title = "measure with the corrections (r)";
  if (state.shape) for (const [name, [key, label]] of Object.entries(TOOLS[state.kind]))
    at("tools").append(element("button", { id: `tool-${name}`, textContent: label, title: `key ${key}`, onclick: () => choose(name) }));
  if (drop) {
    at("tools").append(element("button", { id: "leave", textContent: "leave frame out", title: "key x", onclick: leaveOut }));
    at("tools").append(element("input", { id: "length", type: "number", min: 0, step: "any", placeholder: "length (mm)", ariaLabel: "Known length in mm", hidden: true }));
  }
  for (const field of state.fields) {
    const input = element("input", { id: field.key, type: "number", step: "any" });
    input.onchange = () => input.value !== "" && act("edit", { [field.key]: Number(input.value) });
    at("fields").append(element("label", { htmlFor: field.key, textContent: field.label }), input);
  }
  const keys = drop ? [...KEYS.slice(0, 8), ["x", "leave the frame out, or take it back"], ...KEYS.slice(8)] : KEYS;
  for (const [key, text] of keys) at("keys").append(element("dt", {}, element("kbd", { textContent: key })), element("dd", { textContent: text }));
  if (!state.shape) for (const id of ["stage", "smaller", "larger", "hint"]) at(id).hidden = true; // a track has no pictures
  if (state.shape) {
    const [height, width] = state.shape, room = at("stage").clientWidth - 4;
    zoom = Math.min(room / width, 0.7 * innerHeight / height, 8);
    zoom = zoom > 1 ? Math.floor(2 * zoom) / 2 : zoom;
  }
  choose("look");
  if (!state.measured && !state.busy) act("measure");
}

function choose(name) {
  tool = name; points = [];
  if (state.shape) for (const each of Object.keys(TOOLS[state.kind])) at(`tool-${each}`).setAttribute("aria-pressed", each === name);
  at("hint").textContent = TOOLS[state.kind][name][2];
  at("stage").classList.toggle("tool", name !== "look");
  if (at("length")) { at("length").hidden = name !== "scale"; if (name === "scale" && !at("length").value) at("length").focus(); }
  draw();
}

function show() {
  at("file").textContent = state.file || "no drop.toml: corrections count on this page only";
  for (const field of state.fields) {
    const input = at(field.key);
    if (document.activeElement !== input || !input.value) input.value = field.value === null || field.value === undefined ? "" : Number(field.value.toFixed(field.digits));
  }
  at("undo").disabled = !state.can_undo;
  at("save").disabled = state.saved || !state.file;
  at("measure").disabled = Boolean(state.busy);
  at("status").textContent = state.busy ? `${state.busy.text} ${Math.round(100 * state.busy.share)} %`
    : [state.stale ? "measured before the last correction" : "", state.saved ? "saved" : "not saved"].filter(Boolean).join("; ");
  document.documentElement.dataset.state = state.busy ? "busy" : "ready";
  document.documentElement.dataset.measurements = state.measurements;
  const found = state.measured;
  at("found").replaceChildren(...(found ? found.lines : []).flatMap(([label, text]) => [element("dt", { textContent: label }), element("dd", { textContent: text })]));
  at("found").classList.toggle("stale", state.stale);
  at("warnings").replaceChildren(...(found ? found.warnings : []).map((text) => element("li", { textContent: text })));
  at("said").hidden = !(found && found.warnings.length);
  complain("");
  const more = [];
  if (state.kind === "drop") {
    if (state.region) more.push(`region ${state.region.join(", ")} `, element("button", { textContent: "whole picture", onclick: () => act("edit", { "record.region_px": null }) }));
    if (state.left_out.length) more.push(" left out: " + state.left_out.join(", "));
  } else {
    more.push(`grey of solid: ${Number(state.grey_solid.toFixed(2))} `);
    if (state.axis) more.push(`axis stated: ${state.axis.map((v) => v.toFixed(2)).join(", ")} `, element("button", { textContent: "the bead's", onclick: () => act("edit", { "scan.axis_px": null }) }));
  }
  at("more").replaceChildren(...more);
  at("chart").hidden = state.kind !== "drop" || !found;
  at("map").hidden = state.kind !== "scan" || !found;
  at("legend").replaceChildren();
  if (state.kind === "drop" && found) {
    at("legend").append(element("b", { className: "tip", textContent: "tip and 1 σ" }), " · ", element("b", { className: "bad", textContent: "not used" }), " · ", element("b", { className: "surface", textContent: "surface" }), ". Above: row of the tip; below: row minus fit with 1 σ. A click goes to the frame.");
  } else if (found) at("legend").append("Filling factor about the axis. A click goes to the slice.");
  draw(); drawChart(); drawMap();
}

async function picture(number) {
  if (!pictures.has(number)) {
    const answer = await fetch(`picture/${number}`);
    if (!answer.ok) return null;
    if (pictures.size >= Math.max(KEPT / (4 * state.shape[0] * state.shape[1]), 10)) {
      const [oldest, image] = pictures.entries().next().value;
      image.close(); pictures.delete(oldest);
    }
    pictures.set(number, await createImageBitmap(await answer.blob()));
  }
  return pictures.get(number);
}

// numbers of the frames or slices; of a track without pictures those in its file
const numbers = () => state.shape ? state.numbers : (state.measured && state.measured.frame) || [];

function go(number) {
  shown = Math.min(Math.max(number, 0), Math.max(numbers().length - 1, 0));
  at("slider").value = shown;
  draw(); drawChart(); drawMap();
}

function play() {
  if (timer) { clearInterval(timer); timer = 0; }
  else timer = setInterval(() => { if (!dirty) { if (shown + 1 >= numbers().length) go(0); else go(shown + 1); } }, 66);
  at("play").textContent = timer ? "❚❚" : "▶";
  at("play").setAttribute("aria-label", timer ? "Stop" : "Play");
}

// px of the picture -> px of the canvas: pixel centres lie at whole numbers
const place = (value) => (value + 0.5) * zoom;

async function draw() {
  if (!state || dirty) return;
  at("slider").max = Math.max(numbers().length - 1, 0);
  if (!state.shape) { document.documentElement.dataset.shown = shown; return tellTip(); }
  dirty = true;
  const number = shown;
  let image = null;
  try { image = await picture(number); } catch { /* the server has ended; the next action says so */ }
  dirty = false;
  if (number !== shown) return draw();
  const [height, width] = state.shape, canvas = at("picture"), pen = canvas.getContext("2d");
  canvas.width = Math.round(width * zoom); canvas.height = Math.round(height * zoom);
  pen.imageSmoothingEnabled = zoom < 1;
  if (image) pen.drawImage(image, 0, 0, canvas.width, canvas.height);
  pen.lineWidth = 1.5;
  (state.kind === "drop" ? drawTip : drawBead)(pen, canvas);
  pen.strokeStyle = "#ffd23f"; pen.fillStyle = "#ffd23f";
  for (const [x, y] of points) { pen.beginPath(); pen.arc(place(x), place(y), 4, 0, 7); pen.fill(); }
  if (points.length && cursor) {
    const [a, b] = [points[0], cursor];
    pen.beginPath();
    if (tool === "region") pen.rect(place(a[0]), place(a[1]), (b[0] - a[0]) * zoom, (b[1] - a[1]) * zoom);
    else { pen.moveTo(place(a[0]), place(a[1])); pen.lineTo(place(b[0]), place(b[1])); }
    pen.stroke();
  }
  if (cursor && tool !== "look") cross(pen, place(cursor[0]), place(cursor[1]), 14);
  document.documentElement.dataset.shown = shown;
}

function line(pen, x0, y0, x1, y1) { pen.beginPath(); pen.moveTo(x0, y0); pen.lineTo(x1, y1); pen.stroke(); }
function cross(pen, x, y, size) { line(pen, x - size, y, x + size, y); line(pen, x, y - size, x, y + size); }

function drawTip(pen, canvas) {
  const found = state.measured, fields = Object.fromEntries(state.fields.map((f) => [f.key, f.value]));
  const surface = fields["camera.surface_row_px"] ?? (found && found.surface ? found.surface[0] : null);
  if (surface !== null && surface !== undefined) {
    pen.strokeStyle = "#3fa9f5"; line(pen, 0, place(surface), canvas.width, place(surface));
  }
  if (state.region) {
    const [left, top, right, bottom] = state.region;
    pen.strokeStyle = "#ffd23f"; pen.setLineDash([6, 4]);
    pen.strokeRect(left * zoom, top * zoom, (right + 1 - left) * zoom, (bottom + 1 - top) * zoom); pen.setLineDash([]);
  }
  const out = state.left_out.includes(state.numbers[shown]);
  if (found && shown < found.row.length) {
    const row = found.row[shown];
    if (row !== null) {
      const x = place(found.column[shown] ?? state.shape[1] / 2), y = place(row), spread = found.sigma[shown] * zoom;
      pen.strokeStyle = found.used[shown] && !out ? "#3ddc97" : "#ff8a3d";
      line(pen, x - 22, y, x + 22, y);
      line(pen, x, y - Math.max(spread, 3), x, y + Math.max(spread, 3)); // as long as the error bar where that can be seen
      if (spread >= 3) { line(pen, x - 5, y - spread, x + 5, y - spread); line(pen, x - 5, y + spread, x + 5, y + spread); }
    }
  }
  if (out) { pen.strokeStyle = "#ff8a3d"; line(pen, 0, 0, canvas.width, canvas.height); line(pen, 0, canvas.height, canvas.width, 0); }
  tellTip();
}

function tellTip() {
  const found = state.measured, number = numbers()[shown], out = state.left_out.includes(number);
  if (number === undefined) return;
  let text = `frame ${number} (${shown + 1} of ${numbers().length})`, reason = "";
  if (found && shown < found.row.length) {
    const row = found.row[shown];
    reason = found.reason[shown];
    if (row !== null) text += `, ${(1e3 * found.time[shown]).toFixed(3)} ms, row ${row.toFixed(2)} ± ${found.sigma[shown].toFixed(3)}`;
    if (reason) text += `, ${reason}`;
    else if (!found.used[shown] && row !== null) text += ", not in the fit";
  }
  at("where").textContent = text + (out && !reason ? ", to be left out" : "");
  at("leave").setAttribute("aria-pressed", out);
}

function drawBead(pen, canvas) {
  const found = state.measured;
  let text = `slice ${shown} (${shown + 1} of ${state.numbers.length})`, axis = state.axis;
  if (found) {
    const [x, y, k] = found.bead.centre, left = found.bead.radius ** 2 - (shown - k) ** 2;
    if (left > 0) { pen.strokeStyle = "#3ddc97"; pen.beginPath(); pen.arc(place(x), place(y), Math.sqrt(left) * zoom, 0, 7); pen.stroke(); }
    if (!axis) axis = [found.axis[0] + (shown - k) * found.lean[0], found.axis[1] + (shown - k) * found.lean[1]];
    text += `, ${(found.voxel_mm * (shown - found.surface[0])).toFixed(3)} mm below the surface`;
  }
  if (axis) { pen.strokeStyle = "#3fa9f5"; cross(pen, place(axis[0]), place(axis[1]), 12); }
  at("where").textContent = text;
}

function prepare(canvas, height) {
  const scale = devicePixelRatio || 1, width = canvas.clientWidth;
  canvas.style.height = `${height}px`;
  canvas.width = width * scale; canvas.height = height * scale;
  const pen = canvas.getContext("2d");
  pen.scale(scale, scale); pen.font = "12px system-ui, sans-serif"; pen.lineWidth = 1;
  return [pen, width];
}

const LEFT = 46;
function chartPlace(found, width) {
  const times = found.time.filter((t) => t !== null), first = times[0], last = times[times.length - 1];
  return (t) => LEFT + (t - first) / (last - first || 1) * (width - LEFT - 12);
}

function drawChart() {
  const found = state && state.measured;
  if (at("chart").hidden || !found || !found.row) return;
  const [pen, width] = prepare(at("chart"), 250), across = chartPlace(found, width);
  const rows = found.row.filter((v) => v !== null), surface = found.surface ? found.surface[0] : null;
  const low = Math.min(...rows, surface ?? Infinity), high = Math.max(...rows, surface ?? -Infinity);
  const down = (row) => 14 + (row - low) / (high - low || 1) * 120;
  pen.strokeStyle = colour("surface");
  if (surface !== null) line(pen, LEFT, down(surface), width - 12, down(surface));
  const good = (i) => found.used[i] && !found.reason[i];
  found.row.forEach((row, i) => {
    if (row === null) return;
    pen.fillStyle = good(i) ? colour("tip") : colour("bad");
    pen.fillRect(across(found.time[i]) - 1.5, down(row) - 1.5, 3, 3);
  });
  pen.fillStyle = colour("soft");
  pen.fillText(low.toFixed(0), 6, down(low) + 4); pen.fillText(high.toFixed(0), 6, down(high) + 4);
  if (found.residual) {
    const sizes = found.residual.map((v, i) => v === null || !good(i) ? 0 : Math.abs(v) + found.sigma[i]);
    const most = Math.max(...sizes) || 1, middle = 196, fall = (v) => middle + Math.max(Math.min(v / most, 1.15), -1.15) * 38;
    pen.strokeStyle = colour("line"); line(pen, LEFT, middle, width - 12, middle);
    found.residual.forEach((v, i) => {
      if (v === null) return;
      const x = across(found.time[i]);
      pen.strokeStyle = good(i) ? colour("tip") : colour("bad");
      line(pen, x, fall(v - found.sigma[i]), x, fall(v + found.sigma[i]));
    });
    pen.fillStyle = colour("soft");
    pen.fillText(most.toFixed(2), 6, middle - 34); pen.fillText("px", 6, middle + 4); pen.fillText((-most).toFixed(2), 6, middle + 42);
  }
  if (shown < found.time.length) { pen.strokeStyle = colour("ink"); const x = across(found.time[shown]); line(pen, x, 6, x, 244); }
}

// viridis at nine places
const MAP = [[68, 1, 84], [71, 44, 122], [59, 81, 139], [44, 113, 142], [33, 144, 141], [39, 173, 129], [92, 200, 99], [170, 220, 50], [253, 231, 37]];
const LEAST = 0.12, MOST = 0.30; // filling factor at the ends of the colours, as in all pictures of labsim
function tint(value) {
  const p = Math.min(Math.max((value - LEAST) / (MOST - LEAST), 0), 1) * 8, i = Math.min(Math.floor(p), 7);
  return MAP[i].map((v, c) => Math.round(v + (p - i) * (MAP[i + 1][c] - v)));
}

function mapPlace(map, width) {
  const reach = map.r[map.r.length - 1], above = map.z[0], below = map.z[map.z.length - 1];
  const scale = Math.min((width - 110) / (2 * reach), 420 / (above - below));
  return { scale, x: (r) => 50 + (r + reach) * scale, y: (z) => 10 + (above - z) * scale, height: (above - below) * scale + 34, reach };
}

function drawMap() {
  const found = state && state.measured;
  if (at("map").hidden || !found || !found.map) return;
  const map = found.map, p = mapPlace(map, at("map").clientWidth);
  if (p.scale <= 0) return; // a window that is being resized may have no width; the next resize draws it
  const [pen] = prepare(at("map"), p.height);
  const step = (map.r[1] - map.r[0]) * p.scale, size = Math.ceil(step) + 1;
  map.filling_factor.forEach((row, i) => row.forEach((value, j) => {
    if (value === null) return;
    pen.fillStyle = `rgb(${tint(value)})`;
    for (const side of [-1, 1]) pen.fillRect(p.x(side * map.r[j]) - step / 2, p.y(map.z[i]) - step / 2, size, size);
  }));
  pen.strokeStyle = colour("ink");
  pen.beginPath(); pen.arc(p.x(0), p.y(map.bead_z), map.bead_radius * p.scale, 0, 7); pen.stroke();
  pen.strokeStyle = colour("surface"); line(pen, p.x(-p.reach), p.y(0), p.x(p.reach), p.y(0));
  const z = (found.surface[0] - shown) * found.voxel_mm;
  pen.strokeStyle = colour("bad"); line(pen, p.x(-p.reach), p.y(z), p.x(p.reach), p.y(z));
  pen.fillStyle = colour("soft");
  pen.fillText("0 mm", 6, p.y(0) + 4); pen.fillText(map.z[map.z.length - 1].toFixed(2), 6, p.y(map.z[map.z.length - 1]) + 4);
  const x = p.x(p.reach) + 14, tall = Math.min(160, p.height - 40);
  for (let i = 0; i < tall; i++) { pen.fillStyle = `rgb(${tint(MOST - (MOST - LEAST) * i / tall)})`; pen.fillRect(x, 14 + i, 12, 1.5); }
  pen.fillStyle = colour("soft"); pen.fillText(MOST.toFixed(2), x + 16, 22); pen.fillText(LEAST.toFixed(2), x + 16, 14 + tall);
}

async function click(x, y) {
  if (tool === "look") return;
  const [height, width] = state.shape;
  x = Math.min(Math.max(x, 0), width - 1); y = Math.min(Math.max(y, 0), height - 1);
  if (tool === "surface") return act("edit", { "camera.surface_row_px": Number(y.toFixed(2)) });
  if (tool === "axis") return act("edit", { "scan.axis_px": [Number(x.toFixed(2)), Number(y.toFixed(2))] });
  if (tool === "air" || tool === "solid") {
    try {
      const { grey } = await ask(`grey?slice=${shown}&column=${x}&row=${y}`);
      if (tool === "air") return act("edit", { "calibration.grey_air": grey });
      const air = state.fields.find((f) => f.key === "calibration.grey_air").value;
      return act("edit", { "calibration.grey_per_density": Number(((grey - air) / state.density_solid).toPrecision(6)) });
    } catch (trouble) { return complain(trouble.message); }
  }
  points.push([x, y]);
  if (points.length === 2) {
    const [a, b] = points;
    points = [];
    if (tool === "region") {
      const sides = [Math.min(a[0], b[0]), Math.min(a[1], b[1]), Math.max(a[0], b[0]), Math.max(a[1], b[1])].map(Math.round);
      return act("edit", { "record.region_px": sides });
    }
    const length = Number(at("length").value), apart = Math.hypot(a[0] - b[0], a[1] - b[1]);
    if (!(length > 0)) { draw(); return complain("write the known length in mm first, then click its two ends"); }
    return act("edit", { "camera.pixel_size_um": Number((1e3 * length / apart).toPrecision(5)) });
  }
  draw();
}

function leaveOut() {
  const number = numbers()[shown];
  if (number === undefined) return;
  const others = state.left_out.filter((each) => each !== number);
  const after = others.length < state.left_out.length ? others : [...others, number].sort((a, b) => a - b);
  act("edit", { "record.frames_left_out": after.length ? after : null });
}

function resize(factor) {
  if (!state.shape) return;
  const [height, width] = state.shape;
  zoom = Math.min(Math.max(zoom * factor, 0.1), 16, 8000 / Math.max(height, width));
  draw();
}

async function tellGrey() {
  if (state.kind !== "scan" || !cursor) return;
  try {
    const { grey, scatter, filling_factor } = await ask(`grey?slice=${shown}&column=${cursor[0]}&row=${cursor[1]}`);
    at("where").textContent = `slice ${shown}, column ${cursor[0].toFixed(1)}, row ${cursor[1].toFixed(1)}: grey ${grey.toFixed(1)} ± ${scatter.toFixed(1)}, filling factor ${filling_factor.toFixed(3)}`;
  } catch { /* outside the picture */ }
}

const ACTIONS = {
  ArrowLeft: () => go(shown - 1), ArrowRight: () => go(shown + 1), ArrowUp: () => go(shown - 10), ArrowDown: () => go(shown + 10),
  Home: () => go(0), End: () => go(Infinity), " ": play, "+": () => resize(1.25), "=": () => resize(1.25), "-": () => resize(0.8),
  r: () => act("measure"), u: () => act("undo"), s: () => state.file ? act("save") : complain("there is no drop.toml to save in; labsim new DIR writes one"),
  x: () => state.kind === "drop" && leaveOut(), Escape: () => choose("look"), Enter: () => cursor && click(...cursor),
};
const MOVES = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

addEventListener("keydown", (event) => {
  if (!state || event.altKey || event.metaKey) return;
  const typing = event.target.matches("input[type=number]");
  if (typing) { if (event.key === "Escape") event.target.blur(); if (event.key === "Enter" && event.target.id === "length") at("stage").focus(); return; }
  if (event.shiftKey && MOVES[event.key] && state.shape) {
    const [dx, dy] = MOVES[event.key], by = event.ctrlKey ? 10 : 1;
    cursor = cursor || [state.shape[1] / 2, state.shape[0] / 2];
    cursor = [Math.min(Math.max(cursor[0] + dx * by, 0), state.shape[1] - 1), Math.min(Math.max(cursor[1] + dy * by, 0), state.shape[0] - 1)];
    event.preventDefault(); draw(); tellGrey();
    return;
  }
  if (event.ctrlKey) return;
  const pressed = event.target.matches("button, summary") && (event.key === " " || event.key === "Enter");
  const chosen = Object.entries(TOOLS[state.kind]).find(([, [key]]) => key === event.key);
  if (chosen && state.shape) { choose(chosen[0]); event.preventDefault(); }
  else if (ACTIONS[event.key] && !pressed) { event.preventDefault(); ACTIONS[event.key](); }
});

function onPicture(event) {
  const box = at("picture").getBoundingClientRect();
  return [(event.clientX - box.left) / zoom - 0.5, (event.clientY - box.top) / zoom - 0.5];
}
at("picture").addEventListener("click", (event) => { cursor = onPicture(event); click(...cursor); tellGrey(); });
at("picture").addEventListener("mousemove", (event) => { if (tool !== "look") { cursor = onPicture(event); draw(); } });
at("chart").addEventListener("click", (event) => {
  const found = state.measured, across = chartPlace(found, at("chart").clientWidth);
  const gaps = found.time.map((t) => Math.abs(across(t) - event.offsetX));
  go(gaps.indexOf(Math.min(...gaps)));
});
at("map").addEventListener("click", (event) => {
  const found = state.measured, p = mapPlace(found.map, at("map").clientWidth);
  go(Math.round(found.surface[0] - (found.map.z[0] - (event.offsetY - 10) / p.scale) / found.voxel_mm));
});
at("slider").addEventListener("input", () => go(Number(at("slider").value)));
at("play").onclick = play; at("back").onclick = () => go(shown - 1); at("forth").onclick = () => go(shown + 1);
at("smaller").onclick = () => resize(0.8); at("larger").onclick = () => resize(1.25);
for (const name of ["measure", "undo", "save"]) at(name).onclick = () => act(name);
addEventListener("resize", () => { drawChart(); drawMap(); });
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { drawChart(); drawMap(); });
addEventListener("beforeunload", (event) => { if (state && state.file && !state.saved) event.preventDefault(); });
ask("state").then(take, (trouble) => complain(trouble.message));
