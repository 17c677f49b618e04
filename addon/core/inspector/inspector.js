// SPDX-License-Identifier: GPL-3.0-or-later
// The inspector's page: draws the maps, rays, trees and levels of the element "data", and exports them.
"use strict";

const data = JSON.parse(document.getElementById("data").textContent), structures = data.structures;
const byId = id => document.getElementById(id);

// A new element with text and a class, the last child of its parent.
function make(tag, parent, text = "", kind = "") {
  const made = document.createElement(tag);
  made.textContent = text;
  if (kind) made.className = kind;
  parent.append(made);
  return made;
}

function button(parent, text, work, enabled = true) {
  const made = make("button", parent, text);
  made.onclick = work;
  made.disabled = !enabled;
  return made;
}

function number(value) {
  if (typeof value !== "number") return value ?? "–";
  return Math.abs(value) >= 100 ? Math.round(value).toLocaleString("en") : String(+value.toPrecision(3));
}

// A number of a scale, a quarter of its end.
const tick = (end, quarters) => (+(end * quarters / 4).toPrecision(4)).toLocaleString("en");

// Files.

function save(name, blob) {
  const link = make("a", document.body);
  link.href = URL.createObjectURL(blob);
  link.download = name.replace(/[^\w.-]+/g, "-");
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(link.href), 60000);
}

// Rows as CSV, with every digit of their numbers; null is an empty field.
function saveTable(name, rows) {
  // A spreadsheet would compute a text that begins like a formula.
  const plain = value => typeof value === "string" && /^[=+\-@\t\r]./.test(value) && isNaN(value) ? "'" + value : value;
  const quoted = value => /[",\n]/.test(value) ? `"${String(value).replaceAll('"', '""')}"` : value ?? "";
  const field = value => quoted(plain(value));
  const lines = [Object.keys(rows[0]), ...rows.map(row => Object.values(row))];
  save(name + ".csv", new Blob([lines.map(line => line.map(field).join(",") + "\n").join("")], { type: "text/csv" }));
}

function savePicture(name, canvas) {
  canvas.toBlob(blob => save(name + ".png", blob));
}

// A table that scrolls. pick: called with the place of a row that is clicked or entered.
function table(parent, rows, pick) {
  const box = make("div", parent, "", "wide"), made = make("table", box), head = make("tr", make("thead", made));
  for (const key of Object.keys(rows[0] ?? {})) make("th", head, key).scope = "col";
  const body = make("tbody", made);
  rows.forEach((row, place) => {
    const line = make("tr", body);
    for (const value of Object.values(row)) make("td", line, number(value));
    if (!pick) return;
    line.tabIndex = 0;
    line.onclick = () => pick(place);
    line.onkeydown = event => { if (event.key === "Enter") pick(place); };
  });
  return body;
}

// Maps.

const BINS = 64, GREY = 0.35, DARK = "#17181c", OUTSIDE = "#6b6e75", HANDLE = "#8fd0ff", CURSOR = "rgb(90, 255, 140)";
const TYPES = { "<u2": Uint16Array, "<u4": Uint32Array, "<f4": Float32Array, "<f8": Float64Array };

// Red, green and blue, 0 to 255, of a share of the scale.
function colour(share) {
  const place = Math.min(Math.max(share, 0), 1) * (data.scale.length - 1);
  const low = Math.min(Math.floor(place), data.scale.length - 2), part = place - low;
  return data.scale[low].map((value, k) => Math.round(255 * (value * (1 - part) + data.scale[low + 1][k] * part)));
}

const COLOURS = Array.from({ length: 1024 }, (_, k) => colour(k / 1023));
const css = rgb => `rgb(${rgb.join(", ")})`;

// The numbers of a map, rows from the bottom.
async function unpacked(stored) {
  const bytes = Uint8Array.from(atob(stored.data), c => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new TYPES[stored.type](await new Response(stream).arrayBuffer());
}

// The ends of ranges as shares of the scale, by quantity, one pair for each structure.
const ranges = new Map(data.quantities.map(one => [one.key, structures.map(() => [0, 1])]));
let cursor = null, shown = [], drawing = 0;

const isInside = (share, [low, high]) => share >= low && (share <= high || high >= 1);

class CostMap {
  constructor(structure, place, quantity, values) {
    Object.assign(this, { structure, place, quantity, values, ...structure.maps[quantity.key] });
    this.counts = new Array(BINS).fill(0);
    this.sum = 0;
    for (const value of values) {
      this.counts[Math.min(Math.floor(value / quantity.end * BINS), BINS - 1)] += 1;
      this.sum += value;
    }
    this.name = `${structure.spec}-${quantity.key}`;
    this.build(make("section", byId("maps")));
  }

  get range() { return ranges.get(this.quantity.key)[this.place]; }

  at(x, y) { return this.values[(this.height - 1 - y) * this.width + x]; }

  build(section) {
    const { end, unit } = this.quantity;
    make("h3", section, this.structure.label);
    this.facts = make("p", section, "", "note");
    this.bars = make("canvas", section, "", "histogram");
    [this.bars.width, this.bars.height] = [512, 76];
    make("div", section, "", "scale");
    const ticks = make("div", section, "", "ticks");
    for (const part of [0, 1, 2, 3, 4]) make("span", ticks, tick(end, part) + (part === 4 ? " " + unit : ""));
    this.map = make("canvas", section, "", "map");
    [this.map.width, this.map.height] = [this.width, this.height];
    this.reading = make("p", section, "", "note reading");
    const row = make("div", section, "", "bar range");
    this.ends = ["From", "To"].map((text, which) => {
      const input = make("input", make("label", row, text + " ")), ariaLabel = `${text}, ${this.structure.label}`;
      Object.assign(input, { type: "number", min: 0, max: end, step: "any", ariaLabel });
      input.onchange = () => this.move(which, input.value / end);
      return input;
    });
    button(row, "Map PNG", () => savePicture(this.name, this.picture()));
    button(row, "Histogram PNG", () => savePicture(this.name + "-histogram", this.histogram()));
    button(row, "CSV", () => saveTable(this.name, this.rows()));
    this.follow();
  }

  // Pointers on the map move the cursor, those on the histogram the nearer end of the range.
  follow() {
    const place = (event, element) => {
      const box = element.getBoundingClientRect();
      return [(event.clientX - box.x) / box.width, (event.clientY - box.y) / box.height].map(
        share => Math.min(Math.max(share, 0), 1));
    };
    this.map.onpointermove = this.map.onpointerdown = event => {
      const [x, y] = place(event, this.map), { width, height } = this;
      cursor = [Math.min(Math.floor(x * width), width - 1), Math.min(Math.floor(y * height), height - 1)];
      for (const one of shown) one.show();
    };
    let held = -1;
    this.bars.onpointerdown = event => {
      const [share] = place(event, this.bars), [low, high] = this.range;
      held = Math.abs(share - low) < Math.abs(share - high) || share < low ? 0 : 1;
      this.bars.setPointerCapture(event.pointerId);
      this.move(held, share);
    };
    this.bars.onpointermove = event => { if (held >= 0) this.move(held, place(event, this.bars)[0]); };
    this.bars.onpointerup = this.bars.onpointercancel = () => { held = -1; };
  }

  // Move one end of the range to a share of the scale; it stops at the other one.
  move(which, share) {
    const own = this.range;
    own[which] = which ? Math.max(Math.min(share, 1), own[0]) : Math.min(Math.max(share, 0), own[1]);
    if (byId("together").checked) shareRange(this.place);
    for (const one of shown) one.draw();
  }

  // The map's pixels in their colours; `inside` and `part` count those in the range.
  paint() {
    const image = new ImageData(this.width, this.height), { end } = this.quantity;
    this.inside = this.part = 0;
    for (let y = 0, at = 0; y < this.height; y++) for (let x = 0; x < this.width; x++, at += 4) {
      const value = this.at(x, y), share = value / end, rgb = COLOURS[Math.round(1023 * Math.min(share, 1))];
      const inside = isInside(share, this.range), grey = GREY * (rgb[0] + rgb[1] + rgb[2]) / 3;
      if (inside) { this.inside += 1; this.part += value; }
      for (let k = 0; k < 3; k++) image.data[at + k] = inside ? rgb[k] : grey;
      image.data[at + 3] = 255;
    }
    return image;
  }

  draw() {
    this.image = this.paint();
    paintBars(this.bars.getContext("2d"), this.bars.width, this.bars.height, this);
    const count = this.values.length, share = (part, whole) => (100 * part / (whole || 1)).toFixed(1) + "%";
    const times = this.quantity.key === "TIME" ? `; ${this.structure.answers}` : "";
    this.facts.textContent = `Mean ${number(this.sum / count)} ${this.quantity.unit}${times}. In the range: `
      + `${share(this.inside, count)} of the pixels, ${share(this.part, this.sum)} of the sum`;
    this.ends.forEach((input, k) => { input.value = +(this.range[k] * this.quantity.end).toPrecision(6); });
    this.show();
  }

  // The pixels and the cursor's crossed lines, which leave its own pixel visible.
  show() {
    const context = this.map.getContext("2d");
    context.putImageData(this.image, 0, 0);
    this.reading.textContent = "No pixel under the cursor";
    if (!cursor) return;
    const [x, y] = cursor, { width, height } = this;
    context.fillStyle = CURSOR;
    const lines = [[0, y, x, 1], [x + 1, y, width, 1], [x, 0, 1, y], [x, y + 1, 1, height]];
    for (const line of lines) context.fillRect(...line);
    this.reading.textContent = `${number(this.at(x, y))} ${this.quantity.unit} at pixel ${x}, ${y}`;
  }

  picture() {
    const canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = [this.width, this.height];
    canvas.getContext("2d").putImageData(this.image, 0, 0);
    return canvas;
  }

  // The histogram with its title and the numbers of its scale.
  histogram() {
    const canvas = document.createElement("canvas"), context = canvas.getContext("2d");
    const { label, unit, end } = this.quantity;
    [canvas.width, canvas.height] = [640, 240];
    context.fillStyle = "#fff";
    context.fillRect(0, 0, 640, 240);
    context.translate(0, 36);
    paintBars(context, 640, 172, this);
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.fillStyle = "#1c1f24";
    context.font = "15px system-ui, sans-serif";
    context.fillText(`${this.structure.label}: ${label}`, 8, 23, 624);
    context.font = "13px system-ui, sans-serif";
    for (const part of [0, 1, 2, 3, 4]) {
      context.textAlign = ["left", "center", "center", "center", "right"][part];
      context.fillText(tick(end, part) + (part === 4 ? " " + unit : ""), [8, 160, 320, 480, 632][part], 228);
    }
    return canvas;
  }

  // Pixels from the top left.
  rows() {
    const rows = [];
    for (let row = 0; row < this.height; row++) for (let column = 0; column < this.width; column++) {
      rows.push({ column, row, [this.quantity.key.toLowerCase()]: this.at(column, row) });
    }
    return rows;
  }
}

// A map's bars, whose heights are square roots of numbers of pixels, and the ends of its range.
function paintBars(context, width, height, map) {
  const most = Math.max(...map.counts), step = width / BINS;
  context.fillStyle = DARK;
  context.fillRect(0, 0, width, height);
  map.counts.forEach((count, k) => {
    const share = (k + 0.5) / BINS, tall = (height - 10) * Math.sqrt(count / most);
    context.fillStyle = share < map.range[0] || share > map.range[1] ? OUTSIDE : css(colour(Math.max(share, 0.3)));
    context.fillRect(k * step, height - tall, step - 1, tall);
  });
  context.fillStyle = HANDLE;
  for (const share of map.range) {
    const x = Math.min(share * width, width - 2);
    context.fillRect(x, 0, 2, height);
    context.fillRect(Math.min(Math.max(x - 5, 0), width - 12), 0, 12, 8);
  }
}

// Give all maps of the quantity the range of one.
function shareRange(place) {
  const all = ranges.get(data.quantities[byId("quantity").selectedIndex].key);
  all.forEach((_, k) => { all[k] = [...all[place]]; });
}

async function showMaps() {
  const turn = ++drawing, quantity = data.quantities[byId("quantity").selectedIndex];
  byId("meaning").textContent = quantity.meaning;
  const values = await Promise.all(structures.map(one => unpacked(one.maps[quantity.key])));
  if (turn !== drawing) return; // another quantity was chosen meanwhile
  byId("maps").replaceChildren();
  if (byId("together").checked) shareRange(0);
  shown = structures.map((structure, place) => new CostMap(structure, place, quantity, values[place]));
  for (const one of shown) one.draw();
}

// Worst rays.

let place = 0;

function showRays() {
  const key = byId("set").value + " " + byId("order").value;
  const most = Math.max(...structures.map(one => one.rays[key].length));
  place = Math.max(Math.min(place, most - 1), 0);
  byId("rays").replaceChildren();
  structures.forEach((structure, which) => {
    const section = make("section", byId("rays")), rays = structure.rays[key];
    make("h3", section, structure.label);
    if (!rays.length) make("p", section, "Nothing is hit: there is no such ray.", "note");
    else if (place >= rays.length) make("p", section, `There are only ${rays.length} of them.`, "note");
    else showRay(section, which, rays, key.replace(" ", "-"));
  });
  const first = structures.find(structure => place < structure.rays[key].length), ray = first?.rays[key][place];
  cursor = ray ? [ray.row.column, ray.row.row] : null;
  for (const one of shown) one.show();
  const where = structures.length > 1 ? ` of ${first?.label}` : "";
  const told = `${place + 1} of the worst ${most}; the cursor in the maps is at the ray${where}`;
  byId("place").textContent = ray ? told : "";
  byId("previous").disabled = place === 0;
  byId("next").disabled = place >= most - 1;
}

// One ray: its lines, a slider over its steps, and the table of them.
function showRay(section, which, rays, name) {
  const { spec } = structures[which], ray = rays[place], count = ray.steps.length;
  const list = make("ul", section);
  for (const line of ray.lines) make("li", list, line);
  const files = (row, node) => {
    button(row, "Show This Node", node, count > 0);
    button(row, "CSV of Steps", () => saveTable(`${spec}-${name}-${place + 1}-steps`, ray.steps), count > 0);
    button(row, "CSV of These Rays", () => saveTable(`${spec}-${name}`, rays.map(one => one.row)));
  };
  if (!count) {
    make("p", section, "It visits no node.", "note");
    files(make("div", section, "", "bar"), null);
    return;
  }
  const slider = make("input", section);
  Object.assign(slider, { type: "range", min: 1, max: count, value: count, ariaLabel: "Step" });
  const facts = make("p", section, "", "note");
  const body = table(section, ray.steps, at => { slider.value = at + 1; slider.oninput(); });
  slider.oninput = () => {
    const step = +slider.value, done = ray.steps.slice(0, step), line = body.rows[step - 1];
    const tests = done.reduce((sum, one) => sum + one.tests, 0), box = body.closest(".wide");
    const leaves = done.filter(one => one.kind === "leaf").length;
    [...body.rows].forEach((row, at) => { row.className = at === step - 1 ? "on" : ""; });
    // Scroll the table alone: the page stays where it is.
    const top = line.offsetTop - line.offsetHeight, bottom = line.offsetTop + line.offsetHeight;
    if (top < box.scrollTop) box.scrollTop = top;
    if (bottom > box.scrollTop + box.clientHeight) box.scrollTop = bottom - box.clientHeight;
    const inner = step - leaves;
    facts.textContent = `Step ${step} of ${count}: so far ${inner} inner nodes, ${leaves} leaves, ${tests} tests`;
  };
  facts.textContent = `${count} nodes${ray.note ? ", " + ray.note : ""}; drag to go through them`;
  files(make("div", section, "", "bar"), () => goTo[which](ray.steps[+slider.value - 1].node));
}

// Trees.

// By structure, the function that shows a node, given its row in the table of the tree.
const goTo = [];

function showTree(structure, which) {
  const named = values => Object.fromEntries(structure.columns.map((name, k) => [name, values[k]]));
  const nodes = structure.nodes.map(node => ({ ...node, row: named(node.row) })), below = nodes.map(() => []);
  const section = make("section", byId("trees"));
  nodes.forEach((node, k) => { if (node.up >= 0) below[node.up].push(k); });
  make("h3", section, structure.label);
  const box = make("div", section);
  const go = at => {
    box.replaceChildren();
    const node = nodes[at], same = node.up < 0 ? [at] : below[node.up], here = same.indexOf(at);
    const row = make("div", box, "", "bar");
    button(row, "Root", () => go(0), at > 0);
    button(row, "Parent", () => go(node.up), at > 0);
    for (const [text, step] of [["Previous", -1], ["Next", 1]]) {
      button(row, text, () => go(same[(here + step + same.length) % same.length]), same.length > 1);
    }
    const list = make("ul", box), children = make("div", box, "", "children");
    for (const line of node.lines) make("li", list, line);
    for (const child of below[at]) {
      const { node: row, kind, triangles_below: count } = nodes[child].row;
      const made = button(children, `Node ${row.toLocaleString("en")}: ${kind}`, () => go(child));
      make("span", made, `${count.toLocaleString("en")} triangles, ${nodes[child].share}`);
    }
    if (!below[at].length && node.row.children) make("p", box, "Its children are not part of this page.", "note");
  };
  const places = new Map(nodes.map((node, k) => [node.row.node, k]));
  goTo[which] = row => { go(places.get(row)); section.scrollIntoView({ block: "nearest" }); };
  go(0);
  if (structure.hidden) make("p", section, structure.hidden, "note");
  const saveNodes = () => saveTable(`${structure.spec}-nodes`, nodes.map(one => one.row));
  button(make("div", section, "", "bar"), "CSV of These Nodes", saveNodes);
}

// Levels.

function showLevels(structure) {
  const section = make("section", byId("levels"));
  make("h3", section, structure.label);
  const list = make("ul", section);
  for (const line of structure.sentences) make("li", list, line);
  const percent = share => (100 * share).toFixed(1) + "%";
  table(section, structure.levels.map(one => ({
    level: one.level, inner: one.nodes, leaves: one.leaves, triangles: one.triangles, SAH: percent(one.sah_share),
    overlap: one.overlap, steps: one.steps, tests: one.tests,
    "ns, fitted": one.fitted_nanoseconds,
  })));
  button(make("div", section, "", "bar"), "CSV", () => saveTable(`${structure.spec}-levels`, structure.levels));
}

// Begin.

for (const quantity of data.quantities) make("option", byId("quantity"), quantity.label);
byId("quantity").onchange = showMaps;
byId("together").onchange = () => {
  if (byId("together").checked) shareRange(0);
  for (const one of shown) one.draw();
};
byId("together").closest("label").hidden = structures.length < 2;
for (const [id, names] of [["set", data.sets], ["order", data.orders]]) {
  for (const [key, label] of names) make("option", byId(id), label).value = key;
  byId(id).onchange = () => { place = 0; showRays(); };
}
byId("next").onclick = () => { place += 1; showRays(); };
byId("previous").onclick = () => { place -= 1; showRays(); };
structures.forEach(showTree);
structures.forEach(showLevels);
showRays();
showMaps();
