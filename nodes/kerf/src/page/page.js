"use strict";
// Draws the data and reacts to the mouse. Rust has decided what is shown; the data have paper
// coordinates in millimetres with y downwards, and times in seconds.
document.body.dataset.errors = "";
addEventListener("error", (event) => { document.body.dataset.errors += event.message + "\n"; });

const data = JSON.parse(document.getElementById("data").textContent);
const by = (id) => document.getElementById(id);
// The columns of an element of a path.
const KIND = 0, X = 1, Y = 2, CX = 3, CY = 4, END = 5, LINE = 8, BLOCK = 9, LOOK = 10, FEED = 11, CALL = 12;
// The columns of a call or a pass of a loop.
const NAME = 0, CALL_LINE = 1, PASS = 2, PARENT = 3;
const [STRAIGHT, CLOCKWISE] = [0, 1];
const [CUT, CORNER, LEAD, RAPID] = [0, 1, 2, 3];
const LOOKS = ["cut", "corner", "lead", "rapid"];
const STATE_COLORS = {
  RUN: "#bfe3cd", HOLD: "#ffe3a8", ALARM: "#f4b6b6", UNKNOWN: "#d8c7e8", DISCONNECTED: "#d8c7e8",
  DOOR: "#ffe3a8", TOOL_CHANGE: "#c6dcf4", HOME: "#d9eef7", JOG: "#d9eef7", CHECK: "#e4e7ec",
};
const PIN_COLORS = { error: "#c62828", alarm: "#c62828", warning: "#d98200", difference: "#e8590c", start: "#2e7d32" };

let sheet, run;
let shown = [];                       // which layers are drawn
let view = { x: 0, y: 0, scale: 1 };  // paper point in the middle, pixels a millimetre
let under = null;                     // { layer, index } below the mouse
let moment = null;                    // seconds that the chart points at
let span = [0, 1];                    // seconds that the chart shows

// ---- the drawing

const canvas = by("drawing"), pen = canvas.getContext("2d");

function size(canvas, pen) {
  const ratio = devicePixelRatio || 1, box = canvas.getBoundingClientRect();
  if (canvas.width !== Math.round(box.width * ratio) || canvas.height !== Math.round(box.height * ratio)) {
    canvas.width = Math.round(box.width * ratio);
    canvas.height = Math.round(box.height * ratio);
  }
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, box.width, box.height);
  return box;
}

const toScreen = (box, x, y) => [(x - view.x) * view.scale + box.width / 2, (y - view.y) * view.scale + box.height / 2];
const toPaper = (box, x, y) => [(x - box.width / 2) / view.scale + view.x, (y - box.height / 2) / view.scale + view.y];

function extent() {
  let box = [Infinity, Infinity, -Infinity, -Infinity];
  const add = (x, y, r = 0) => { box = [Math.min(box[0], x - r), Math.min(box[1], y - r), Math.max(box[2], x + r), Math.max(box[3], y + r)]; };
  for (const layer of sheet.layers) {
    let [x, y] = layer.start;
    if (layer.elements.length) add(x, y);
    for (const e of layer.elements) {
      add(e[X], e[Y]);
      if (e[KIND] !== STRAIGHT) {
        const r = Math.hypot(x - e[CX], y - e[CY]);
        for (const [px, py] of [[e[CX] + r, e[CY]], [e[CX] - r, e[CY]], [e[CX], e[CY] + r], [e[CX], e[CY] - r]]) {
          if (sweeps(px, py, x, y, e)) add(px, py);
        }
      }
      x = e[X]; y = e[Y];
    }
  }
  for (const pin of sheet.pins) if (pin.at) add(...pin.at);
  return box[0] > box[2] ? [-1, -1, 1, 1] : box;
}

function fit() {
  const box = canvas.getBoundingClientRect(), [x0, y0, x1, y1] = extent();
  view.scale = Math.min(box.width / (x1 - x0 || 1), box.height / (y1 - y0 || 1)) * 0.84;
  view.x = (x0 + x1) / 2;
  view.y = (y0 + y1) / 2;
  draw();
}

function grid(box) {
  const least = 70 / view.scale, power = 10 ** Math.floor(Math.log10(least));
  const step = [1, 2, 5, 10].map((digit) => digit * power).find((it) => it >= least);
  const [x0, y0] = toPaper(box, 0, 0), [x1, y1] = toPaper(box, box.width, box.height);
  pen.font = "11px system-ui, sans-serif";
  pen.fillStyle = "#9aa0a8";
  pen.lineWidth = 1;
  const digits = Math.max(0, -Math.floor(Math.log10(step)));
  for (const [from, to, vertical] of [[x0, x1, true], [y0, y1, false]]) {
    for (let index = Math.ceil(from / step); index * step <= to; index++) {
      const at = index * step, [sx, sy] = toScreen(box, at, at);
      pen.strokeStyle = index === 0 ? "#b9c0c9" : "#eceef1";
      pen.beginPath();
      if (vertical) { pen.moveTo(sx, 0); pen.lineTo(sx, box.height); } else { pen.moveTo(0, sy); pen.lineTo(box.width, sy); }
      pen.stroke();
      const value = (vertical || sheet.down ? at : -at) || 0;
      if (vertical) pen.fillText(value.toFixed(digits), sx + 3, box.height - 4);
      else if (sy - 14 > by("layers").offsetTop + by("layers").offsetHeight) pen.fillText(value.toFixed(digits), 3, sy - 3);
    }
  }
  pen.fillText(sheet.axes, box.width - pen.measureText(sheet.axes).width - 8, 48);
}

// Adds an element to the path of the pen, which is at its start.
function trace(box, e, x, y) {
  const [ex, ey] = toScreen(box, e[X], e[Y]);
  if (e[KIND] === STRAIGHT) { pen.lineTo(ex, ey); return; }
  const [cx, cy] = toScreen(box, e[CX], e[CY]), [sx, sy] = toScreen(box, x, y);
  const radius = Math.hypot(sx - cx, sy - cy), clockwise = e[KIND] % 2 === CLOCKWISE;
  const from = Math.atan2(sy - cy, sx - cx), to = Math.atan2(ey - cy, ex - cx);
  // On a page y points down: a positive angle is clockwise.
  if (e[KIND] > 2) pen.arc(cx, cy, radius, from, from + (clockwise ? 2 : -2) * Math.PI, !clockwise);
  if (Math.hypot(ex - sx, ey - sy) > 1e-9) pen.arc(cx, cy, radius, from, to, !clockwise);
  pen.lineTo(ex, ey);
}

function stroke(layer, look) {
  pen.setLineDash(look === LEAD ? [9, 6] : []);
  pen.lineWidth = look === RAPID ? layer.rapid_width : layer.width;
  pen.strokeStyle = look === RAPID ? layer.rapid : look === CORNER ? layer.corner : layer.color;
  pen.stroke();
}

function drawLayer(box, layer) {
  let [x, y] = layer.start, look = -1;
  for (const e of layer.elements) {
    if (e[LOOK] !== look) {
      if (look >= 0) stroke(layer, look);
      look = e[LOOK];
      pen.beginPath();
      pen.moveTo(...toScreen(box, x, y));
    }
    trace(box, e, x, y);
    x = e[X]; y = e[Y];
  }
  if (look >= 0) stroke(layer, look);
}

function drawPin(box, pin, number) {
  const [x, y] = toScreen(box, ...pin.at), color = PIN_COLORS[pin.kind] || "#555";
  pen.setLineDash([]);
  pen.fillStyle = color;
  pen.strokeStyle = "#fff";
  pen.lineWidth = 1.5;
  pen.beginPath();
  pen.moveTo(x, y);
  pen.arc(x, y - 13, 6, 0.75 * Math.PI, 2.25 * Math.PI);
  pen.closePath();
  pen.fill();
  pen.stroke();
  pen.font = "12px system-ui, sans-serif";
  // Several pins often share a place: their labels must not overlap.
  const label = pin.label, ly = y - 16 - 15 * (number % 4);
  pen.fillStyle = "#ffffffd8";
  pen.fillRect(x + 9, ly - 11, pen.measureText(label).width + 4, 15);
  pen.fillStyle = color;
  pen.fillText(label, x + 11, ly);
}

// Where further axes arrive; a word that another one would cover is left out.
function drawTurns(box) {
  const written = [];
  pen.setLineDash([]);
  pen.font = "12px system-ui, sans-serif";
  pen.fillStyle = "#1763a6";
  for (const [at, words] of sheet.turns) {
    const [x, y] = toScreen(box, ...at), width = pen.measureText(words).width;
    pen.beginPath();
    pen.moveTo(x, y - 4);
    pen.lineTo(x + 4, y);
    pen.lineTo(x, y + 4);
    pen.lineTo(x - 4, y);
    pen.fill();
    if (written.some(([u, v, wide]) => x < u + wide && u < x + width && Math.abs(v - y) < 13)) continue;
    written.push([x, y, width]);
    pen.fillText(words, x + 6, y - 6);
  }
}

function draw() {
  if (!sheet) return;
  const box = size(canvas, pen);
  grid(box);
  pen.lineJoin = pen.lineCap = "round";
  for (const region of sheet.uncut) {
    pen.beginPath();
    pen.moveTo(...toScreen(box, ...region.start));
    let [x, y] = region.start;
    for (const e of region.elements) { trace(box, e, x, y); x = e[X]; y = e[Y]; }
    pen.closePath();
    pen.fillStyle = "#f2b8a0";
    pen.fill();
  }
  sheet.layers.forEach((layer, index) => { if (shown[index]) drawLayer(box, layer); });
  if (under) {
    const { layer, index } = under;
    pen.setLineDash([]);
    pen.lineWidth = 5;
    pen.strokeStyle = "#ffb000";
    pen.beginPath();
    const start = startOf(layer, index);
    pen.moveTo(...toScreen(box, ...start));
    trace(box, layer.elements[index], ...start);
    pen.stroke();
  }
  drawTurns(box);
  sheet.pins.filter((pin) => pin.at).forEach((pin, number) => drawPin(box, pin, number));
  const state = run && moment !== null ? stateAt(moment) : null;
  if (state && state.at) {
    const [x, y] = toScreen(box, ...state.at);
    pen.strokeStyle = "#23272e";
    pen.lineWidth = 2;
    pen.setLineDash([]);
    pen.beginPath();
    pen.arc(x, y, 7, 0, 2 * Math.PI);
    pen.moveTo(x - 11, y); pen.lineTo(x + 11, y); pen.moveTo(x, y - 11); pen.lineTo(x, y + 11);
    pen.stroke();
  }
}

// ---- the element below the mouse

const startOf = (layer, index) => index === 0 ? layer.start : [layer.elements[index - 1][X], layer.elements[index - 1][Y]];

// Whether an arc that begins at x, y passes in the direction of a point.
function sweeps(px, py, x, y, e) {
  const turn = 2 * Math.PI, sign = e[KIND] % 2 === CLOCKWISE ? 1 : -1;
  const angle = (ax, ay) => Math.atan2(ay - e[CY], ax - e[CX]);
  const from = angle(x, y), swept = (at) => (((at - from) * sign) % turn + turn) % turn;
  const sweep = e[KIND] > 2 ? turn : swept(angle(e[X], e[Y]));
  return swept(angle(px, py)) <= sweep;
}

function distance(px, py, x, y, e) {
  if (e[KIND] === STRAIGHT) {
    const dx = e[X] - x, dy = e[Y] - y, length = dx * dx + dy * dy;
    const t = length > 0 ? Math.max(0, Math.min(1, ((px - x) * dx + (py - y) * dy) / length)) : 0;
    return Math.hypot(px - x - t * dx, py - y - t * dy);
  }
  if (sweeps(px, py, x, y, e)) return Math.abs(Math.hypot(px - e[CX], py - e[CY]) - Math.hypot(x - e[CX], y - e[CY]));
  return Math.min(Math.hypot(px - x, py - y), Math.hypot(px - e[X], py - e[Y]));
}

function find(px, py, within) {
  let best = null, nearest = within;
  sheet.layers.forEach((layer, number) => {
    if (!shown[number]) return;
    let [x, y] = layer.start;
    layer.elements.forEach((e, index) => {
      const found = distance(px, py, x, y, e);
      // If layers overlap, the topmost one counts.
      if (found < nearest || (found <= nearest && best && best.layer !== layer)) { nearest = found; best = { layer, index }; }
      x = e[X]; y = e[Y];
    });
  });
  return best;
}

const mm = (value) => value.toFixed(3);
const blockText = (line) => (sheet.program[line - 1] || "").trim();

// How the program came to run an element: the calls and passes, the innermost first.
function chain(row) {
  const parts = [];
  for (let call; (call = sheet.calls[row - 1]) && parts.length < 8; row = call[PARENT]) {
    const place = `line ${call[CALL_LINE]}`;
    if (call[NAME] === null) parts.push(`pass ${call[PASS]} of the loop in ${place}`);
    else parts.push(`in ${call[NAME]}, called from ${place}` + (call[PASS] > 1 ? `, pass ${call[PASS]}` : ""));
  }
  if (sheet.calls[row - 1]) parts.push("and more around it");
  return parts.length ? "\n" + parts.join(", ") : "";
}

function describe({ layer, index }) {
  const e = layer.elements[index];
  const feed = e[FEED] === null ? "rapid" : e[FEED] === 0 ? "" : `F${e[FEED]}`;
  const shape = e[KIND] === STRAIGHT ? "line" : `arc of radius ${mm(Math.hypot(e[X] - e[CX], e[Y] - e[CY]))} mm`;
  const block = e[BLOCK] === null ? "" : ` (N${e[BLOCK]})`;
  return `${layer.name}, element ${index}: ${LOOKS[e[LOOK]]}, ${shape} to X${mm(e[END])} Y${mm(e[END + 1])} Z${mm(e[END + 2])} ${feed}\nline ${e[LINE]}${block}: ${blockText(e[LINE])}${chain(e[CALL])}`;
}

function look(px, py, box) {
  const [x, y] = toPaper(box, px, py);
  const pin = sheet.pins.find((pin) => pin.at && Math.hypot(...toScreen(box, ...pin.at).map((s, i) => s - [px, py + 13][i])) < 10);
  const turn = sheet.turns.find(([at]) => Math.hypot(...toScreen(box, ...at).map((s, i) => s - [px, py][i])) < 6);
  under = pin ? null : find(x, y, 8 / view.scale);
  by("under").textContent = pin ? pin.text : [turn ? `${turn[1]} (line ${turn[2]})` : "", under ? describe(under) : ""].filter(Boolean).join("\n");
  if (under) mark(under.layer.elements[under.index][LINE]);
  draw();
}

const local = (event, box) => [event.clientX - box.left, event.clientY - box.top];
let drag = null;
canvas.addEventListener("pointerdown", (event) => { drag = { x: event.clientX, y: event.clientY, view: { ...view }, moved: false }; canvas.setPointerCapture(event.pointerId); });
canvas.addEventListener("pointermove", (event) => {
  const box = canvas.getBoundingClientRect();
  if (!drag) { look(...local(event, box), box); return; }
  const dx = event.clientX - drag.x, dy = event.clientY - drag.y;
  drag.moved ||= Math.hypot(dx, dy) > 3;
  view.x = drag.view.x - dx / view.scale;
  view.y = drag.view.y - dy / view.scale;
  draw();
});
canvas.addEventListener("pointerup", () => {
  if (drag && !drag.moved && under) { choose("program"); reveal(under.layer.elements[under.index][LINE] - 1); }
  drag = null;
});
function zoom(factor, px, py, box) {
  const [x, y] = toPaper(box, px, py);
  view.scale = Math.min(1e6, Math.max(1e-4, view.scale * factor));
  view.x = x - (px - box.width / 2) / view.scale;
  view.y = y - (py - box.height / 2) / view.scale;
  draw();
}
canvas.addEventListener("wheel", (event) => {
  event.preventDefault();
  const box = canvas.getBoundingClientRect();
  zoom(Math.exp(-event.deltaY * 0.0015), ...local(event, box), box);
}, { passive: false });
canvas.addEventListener("dblclick", fit);
canvas.addEventListener("keydown", (event) => {
  const box = canvas.getBoundingClientRect(), step = 40 / view.scale;
  const keys = {
    "+": () => zoom(1.25, box.width / 2, box.height / 2, box), "-": () => zoom(0.8, box.width / 2, box.height / 2, box),
    0: fit, ArrowLeft: () => { view.x -= step; draw(); }, ArrowRight: () => { view.x += step; draw(); },
    ArrowUp: () => { view.y -= step; draw(); }, ArrowDown: () => { view.y += step; draw(); },
  };
  if (keys[event.key]) { event.preventDefault(); keys[event.key](); }
});
by("fit").addEventListener("click", fit);

function goTo(at) {
  view.x = at[0]; view.y = at[1];
  draw();
}

// ---- the lists: of long ones only the rows that can be seen exist

const ROW = 20, list = by("list");
// So many messages at most are shown with all their lines; in longer lists each has one line.
const WRAPPED_MAX = 500;
let tab = "program", rows = [], at = -1, allReports = false;
const isWrapped = () => (tab === "findings" || tab === "differences") && rows.length <= WRAPPED_MAX;

function contents(name) {
  if (name === "program") return sheet.program.map((text, index) => ({ head: index + 1, text, line: index + 1 }));
  if (name === "findings") return sheet.pins.map((pin) => ({ head: pin.line ? pin.label : pin.label.replace(/,? line 0$/, ""), text: pin.text, kind: pin.kind, line: pin.line, go: pin.at }));
  if (name === "differences") return sheet.differences.map(([head, text]) => ({ head, text, kind: "bad" }));
  if (!run) return [];
  const isReport = (text) => text.startsWith("<") || text === "?";
  const wanted = run.dialogue.filter(([, , text]) => allReports || !isReport(text));
  return wanted.map(([t, kind, text]) => ({ head: t.toFixed(3), text: (kind === "tx" ? "→ " : kind === "rx" ? "← " : "") + text, kind: /^(error|ALARM)/.test(text) ? "error" : kind, t }));
}

function renderRows() {
  const whole = isWrapped();
  const first = whole ? 0 : Math.max(0, Math.floor(list.scrollTop / ROW) - 10);
  const last = whole ? rows.length : Math.min(rows.length, first + Math.ceil(list.clientHeight / ROW) + 20);
  const box = by("list-rows");
  box.className = whole ? "wrapped" : "";
  box.style.top = `${first * ROW}px`;
  box.replaceChildren(...rows.slice(first, last).map((row, offset) => {
    const element = document.createElement("div"), head = document.createElement("b");
    element.className = `row ${row.kind || ""} ${first + offset === at ? "at" : ""}`;
    element.title = row.text;
    head.textContent = row.head;
    element.append(head, whole ? row.text : row.text.split("\n")[0]);
    element.addEventListener("click", () => pick(first + offset));
    return element;
  }));
}

function reveal(index) {
  at = index;
  if (isWrapped()) {
    renderRows();
    by("list-rows").children[index]?.scrollIntoView({ block: "nearest" });
    return;
  }
  const y = index * ROW;
  if (y < list.scrollTop || y > list.scrollTop + list.clientHeight - ROW) list.scrollTop = y - list.clientHeight / 2;
  renderRows();
}

// The row of a source line, if the program is shown.
function mark(line) { if (tab === "program") reveal(line - 1); }

function pick(index) {
  const row = rows[index];
  reveal(index);
  if (row.t !== undefined) pointAt(row.t);
  if (row.go) { by("under").textContent = row.text; goTo(row.go); }
  if (row.line && tab === "program") {
    const layer = [...sheet.layers].reverse().find((layer) => layer.elements.some((e) => e[LINE] === row.line));
    if (layer) {
      under = { layer, index: layer.elements.findIndex((e) => e[LINE] === row.line) };
      by("under").textContent = describe(under);
      goTo([layer.elements[under.index][X], layer.elements[under.index][Y]]);
    }
  }
}

function choose(name) {
  tab = name;
  at = -1;
  rows = contents(name);
  list.scrollTop = 0;
  by("list-space").style.height = isWrapped() ? 0 : `${rows.length * ROW}px`;
  const names = [["program", sheet.program.length], ["findings", sheet.pins.length], ["differences", sheet.differences.length]];
  if (run) names.push(["dialogue", run.dialogue.length]);
  by("tabs").replaceChildren(...names.filter(([name, count]) => count || name === "program").map(([key, count]) => {
    const button = document.createElement("button");
    // A finding is about a program; what a run met are alarms, and a run in the middle has its start.
    const all = (kind) => key === "findings" && sheet.pins.every((pin) => pin.kind === kind);
    const word = all("alarm") ? "alarms" : key;
    button.textContent = key === "program" ? key : all("start") ? "start" : `${word} ${count}`;
    button.id = `tab-${key}`;
    button.setAttribute("aria-selected", key === name);
    button.addEventListener("click", () => choose(key));
    return button;
  }));
  if (name === "dialogue") {
    const label = document.createElement("label"), box = document.createElement("input");
    box.type = "checkbox";
    box.checked = allReports;
    box.addEventListener("change", () => { allReports = box.checked; choose("dialogue"); });
    label.append(box, " status reports");
    by("tabs").append(label);
  }
  renderRows();
}
list.addEventListener("scroll", renderRows);

// ---- state and feed over time

const chart = by("chart"), ink = chart.getContext("2d");
// Room for the numbers at the left, pixels.
const CHART_LEFT = 58;

// The last row at or before a time.
function before(rows, t, time) {
  let low = 0, high = rows.length;
  while (low < high) { const middle = (low + high) >> 1; if (time(rows[middle]) <= t) low = middle + 1; else high = middle; }
  return low - 1;
}
const stateAt = (t) => run.states[Math.max(0, before(run.states, t, (state) => state.t))];
const duration = () => run.end || 1e-3;

function drawChart() {
  if (!run) return;
  const box = size(chart, ink), [from, to] = span, left = CHART_LEFT, bottom = 18;
  const x = (t) => left + (t - from) / (to - from) * (box.width - left), height = box.height - bottom;
  const most = Math.max(1, ...run.states.map((state) => state.feed)), y = (feed) => height - feed / most * (height - 26);
  ink.font = "11px system-ui, sans-serif";
  run.states.forEach((state, index) => {
    const end = index + 1 < run.states.length ? run.states[index + 1].t : duration();
    if (end < from || state.t > to) return;
    ink.fillStyle = STATE_COLORS[state.state] || "#eceef1";
    ink.fillRect(x(Math.max(from, state.t)), 0, Math.max(1, x(Math.min(to, end)) - x(Math.max(from, state.t))), height);
  });
  let named = -Infinity, last = "";
  ink.fillStyle = "#30343a";
  run.states.forEach((state, index) => {
    if (state.state === last) return;
    last = state.state;
    const next = run.states.slice(index).find((later) => later.state !== state.state);
    const begin = Math.max(left, x(state.t)), end = x(next ? next.t : duration()), width = ink.measureText(state.state).width;
    // Only where there is room for it: long states matter most.
    if (end - begin < width + 6 || begin < named || begin > box.width) return;
    ink.fillText(state.state, begin + 3, 12);
    named = begin + width + 8;
  });
  ink.save();
  ink.beginPath();
  ink.rect(left, 0, box.width - left, height);
  ink.clip();
  ink.strokeStyle = "#7b2fbf";
  ink.lineWidth = 1.5;
  ink.beginPath();
  // A feed holds until the next state: a slope would show a feed that was never reported.
  run.states.forEach((state, index) => {
    if (index) { ink.lineTo(x(state.t), y(run.states[index - 1].feed)); ink.lineTo(x(state.t), y(state.feed)); }
    else ink.moveTo(x(state.t), y(state.feed));
  });
  ink.stroke();
  ink.restore();
  ink.fillStyle = "#6b727c";
  ink.fillText(`${most.toFixed(0)}`, 4, y(most) + 4);
  ink.fillText("mm/min", 4, y(most) + 16);
  ink.fillText("0", 34, height);
  const least = (to - from) / (box.width / 90), power = 10 ** Math.floor(Math.log10(least));
  const step = [1, 2, 5, 10].map((digit) => digit * power).find((it) => it >= least);
  for (let index = Math.ceil(from / step); index * step <= to; index++) {
    ink.fillText(`${+(index * step).toFixed(6)} s`, x(index * step), box.height - 5);
  }
  if (moment !== null) {
    ink.strokeStyle = "#23272e";
    ink.lineWidth = 1;
    ink.beginPath();
    ink.moveTo(x(moment), 0);
    ink.lineTo(x(moment), height);
    ink.stroke();
  }
}

function pointAt(t) {
  moment = t;
  const state = stateAt(t), reason = state.reason ? ` (${state.reason})` : "";
  by("moment").textContent = `${t.toFixed(3)} s: ${state.state}${reason}, ${state.feed.toFixed(0)} mm/min, line ${state.line}`;
  drawChart();
  draw();
}

const timeOf = (event) => {
  const box = chart.getBoundingClientRect();
  const part = (event.clientX - box.left - CHART_LEFT) / (box.width - CHART_LEFT);
  return span[0] + Math.max(0, Math.min(1, part)) * (span[1] - span[0]);
};
let pull = null;
chart.addEventListener("pointerdown", (event) => { pull = { x: event.clientX, span: [...span], moved: false }; chart.setPointerCapture(event.pointerId); });
chart.addEventListener("pointermove", (event) => {
  if (!pull) { pointAt(timeOf(event)); return; }
  const width = chart.getBoundingClientRect().width - CHART_LEFT, shift = (pull.x - event.clientX) / width * (pull.span[1] - pull.span[0]);
  pull.moved ||= Math.abs(event.clientX - pull.x) > 3;
  span = pull.span.map((t) => t + shift);
  drawChart();
});
chart.addEventListener("pointerup", (event) => {
  if (pull && !pull.moved) {
    pointAt(timeOf(event));
    choose("dialogue");
    reveal(Math.max(0, before(rows, moment, (row) => row.t)));
  }
  pull = null;
});
chart.addEventListener("wheel", (event) => {
  event.preventDefault();
  const t = timeOf(event), factor = Math.exp(event.deltaY * 0.0015);
  span = span.map((end) => t + (end - t) * factor);
  drawChart();
}, { passive: false });
chart.addEventListener("dblclick", () => { span = [0, duration()]; drawChart(); });

// ---- axes that are not in the drawing, along the path

const strips = by("strips"), brush = strips.getContext("2d");
// Pixels of one axis, and the most of all of them.
const STRIP = 84, STRIPS_MAX = 252;
const placeAt = (box, x, length) => (x - CHART_LEFT) / (box.width - CHART_LEFT - 12) * length;
let pointed = null;                   // the place of the path below the mouse

function drawStrips() {
  if (!sheet.strips.length) return;
  const box = size(strips, brush), each = box.height / sheet.strips.length;
  brush.font = "11px system-ui, sans-serif";
  sheet.strips.forEach((strip, number) => {
    const top = number * each + 18, bottom = (number + 1) * each - 8, right = box.width - 12;
    const [least, most] = strip.range, low = most > least ? least : least - 0.5, range = most > least ? most - least : 1;
    const x = (along) => CHART_LEFT + along / (strip.length || 1) * (right - CHART_LEFT);
    const y = (value) => bottom - (value - low) / range * (bottom - top);
    brush.fillStyle = "#6b727c";
    brush.fillText(`${strip.letter} in ${strip.unit} along ${strip.length.toFixed(1)} mm of path; a turn alone counts 1 mm a degree`, CHART_LEFT, top - 6);
    brush.strokeStyle = "#eceef1";
    brush.lineWidth = 1;
    for (const value of most > least ? [least, most] : [least]) {
      brush.beginPath();
      brush.moveTo(CHART_LEFT, y(value));
      brush.lineTo(right, y(value));
      brush.stroke();
      const text = `${+value.toFixed(3)}`;
      brush.fillText(text, CHART_LEFT - 6 - brush.measureText(text).width, y(value) + 4);
    }
    brush.strokeStyle = "#1763a6";
    brush.lineWidth = 1.5;
    for (const piece of strip.pieces) {
      brush.beginPath();
      piece.forEach(([along, value], index) => index ? brush.lineTo(x(along), y(value)) : brush.moveTo(x(along), y(value)));
      brush.stroke();
    }
    if (pointed === null) return;
    brush.strokeStyle = "#23272e";
    brush.lineWidth = 1;
    brush.beginPath();
    brush.moveTo(x(pointed), top - 4);
    brush.lineTo(x(pointed), bottom + 4);
    brush.stroke();
  });
}

// The value of an axis at a place of the path, and the line that takes it on from there; null where nobody says it.
function valueAt(strip, along) {
  for (const piece of strip.pieces) {
    const next = piece.findIndex(([at]) => at >= along);
    if (next < 0 || piece[0][0] > along) continue;
    const [to, value, line] = piece[next], [from, old] = piece[Math.max(0, next - 1)];
    return [to > from ? old + (value - old) * (along - from) / (to - from) : value, line];
  }
  return null;
}

strips.addEventListener("pointermove", (event) => {
  const box = strips.getBoundingClientRect(), length = sheet.strips[0].length;
  pointed = Math.max(0, Math.min(length, placeAt(box, event.clientX - box.left, length)));
  const values = sheet.strips.map((strip) => [strip, valueAt(strip, pointed)]).filter(([, found]) => found);
  const line = Math.min(...values.map(([, [, line]]) => line));
  by("under").textContent = values.map(([strip, [value]]) => `${strip.letter} ${value.toFixed(3)} ${strip.unit}`).join(", ")
    + (values.length ? `\nline ${line}: ${blockText(line)}` : "");
  if (values.length) mark(line);
  drawStrips();
});

// What the strokes of the path mean, where it has them.
function legend() {
  if (!sheet.layers.length) return [];
  const path = sheet.layers.reduce((best, layer) => layer.width > best.width ? layer : best);
  const looks = [[CORNER, "corner", path.corner, "3px solid"], [LEAD, "lead", path.color, "3px dashed"], [RAPID, "rapid", path.rapid, "1px solid"]];
  const row = document.createElement("div");
  for (const [look, name, color, width] of looks) {
    if (!path.elements.some((e) => e[LOOK] === look)) continue;
    const entry = document.createElement("span"), line = document.createElement("i");
    line.style.borderTop = `${width} ${color}`;
    entry.append(line, name);
    row.append(entry);
  }
  return [row];
}

// ---- choosing a sheet

function show(number) {
  sheet = data.sheets[number];
  run = sheet.run === null ? null : data.runs[sheet.run];
  shown = sheet.layers.map(() => true);
  under = moment = null;
  by("title").textContent = sheet.title;
  by("verdict").textContent = sheet.verdict;
  by("verdict").className = sheet.good ? "" : "bad";
  by("end").textContent = sheet.end;
  by("summary").textContent = sheet.summary;
  by("under").textContent = by("moment").textContent = "";
  by("layers").replaceChildren(...sheet.layers.map((layer, index) => {
    const label = document.createElement("label"), box = document.createElement("input"), line = document.createElement("i");
    box.type = "checkbox";
    box.checked = true;
    box.addEventListener("change", () => { shown[index] = box.checked; under = null; draw(); });
    line.style.borderColor = layer.color;
    label.append(box, line, `${layer.name} (${layer.elements.length})`);
    return label;
  }), ...legend());
  by("strips-box").className = sheet.strips.length ? "" : "none";
  by("strips-box").style.height = `${Math.min(STRIPS_MAX, STRIP * sheet.strips.length)}px`;
  pointed = null;
  drawStrips();
  by("chart-box").className = run ? "" : "none";
  if (run) { span = [0, duration()]; drawChart(); }
  choose(sheet.differences.length ? "differences" : sheet.pins.length ? "findings" : run && !sheet.program.length ? "dialogue" : "program");
  fit();
  // Shows its whole text: the row in the list may be cut by the window.
  const first = ["difference", "alarm"].map((kind) => sheet.pins.find((pin) => pin.kind === kind)).find(Boolean);
  if (first) by("under").textContent = first.text;
}

by("sheets").replaceChildren(...data.sheets.map((sheet, index) => new Option(sheet.title, index)));
by("sheets").hidden = data.sheets.length < 2;
by("sheets").addEventListener("change", (event) => show(+event.target.value));
addEventListener("resize", () => { draw(); drawStrips(); drawChart(); renderRows(); });
show(0);
document.body.dataset.ready = "true";
