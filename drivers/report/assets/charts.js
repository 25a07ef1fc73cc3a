"use strict";

// Charts as SVG: lines with a readout under the pointer, maps of contacts over time, pressures along a line.
// One clock serves all: a click on a history moves the film, and the film moves the cursor of every history.

const COLOURS = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#8A6D00", "#56B4E9", "#444444"];
const DASHES = ["", "7 3", "2 2", "9 3 2 3"];
const HUES = {
  blue: [[255, 255, 255], [198, 219, 239], [107, 174, 214], [33, 113, 181], [8, 48, 107]],
  orange: [[255, 255, 255], [254, 217, 166], [244, 158, 76], [204, 88, 3], [102, 37, 6]],
};
const DATA = JSON.parse(document.getElementById("data").textContent);

const clock = {
  time: null,
  listeners: [],
  set(time) {
    this.time = time;
    for (const listener of this.listeners) listener(time);
  },
};

function draw(name, attributes, parent, text) {
  const element = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  if (text !== undefined) element.textContent = text;
  if (parent) parent.appendChild(element);
  return element;
}

function make(name, attributes, parent, text) {
  const element = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  if (text !== undefined) element.textContent = text;
  if (parent) parent.appendChild(element);
  return element;
}

function unpack(text, Kind) {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  return new Kind(bytes.buffer);
}

// Numbers with so many significant digits, a true minus sign and no idle zeros.
function say(value, digits = 4) {
  if (value === 0) return "0";
  const size = Math.abs(value);
  const text = size >= 1e-4 && size < 1e6 ? String(Number(value.toPrecision(digits))) : value.toExponential(digits - 1);
  return text.replace("-", "\u2212");
}

function ticks(low, high, wanted) {
  const raw = (high - low) / Math.max(wanted, 1);
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = power * [1, 2, 2.5, 5, 10].find((m) => m * power >= raw * 0.999);
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) found.push(Number((k * step).toPrecision(12)));
  return found;
}

function logTicks(low, high) {
  const found = [];
  for (let p = Math.floor(Math.log10(low)); p <= Math.ceil(Math.log10(high)); p++) {
    for (const m of [1, 2, 5]) {
      const value = m * 10 ** p;
      if (value >= low * 0.999 && value <= high * 1.001) found.push(Number(value.toPrecision(6)));
    }
  }
  return found;
}

// A frame with axes; `spec` gives ranges and labels. Returns the svg and the two scales.
function frame(holder, spec, height, margin) {
  const width = Math.max(holder.paper || holder.clientWidth, 260);
  const svg = draw("svg", { viewBox: `0 0 ${width} ${height}`, class: "chart", role: "img", "aria-label": spec.title }, null);
  const box = { left: margin.left, right: width - margin.right, top: margin.top, bottom: height - margin.bottom };
  const warp = spec.log ? Math.log10 : (v) => v;
  const [x0, x1, y0, y1] = [warp(spec.low), warp(spec.high), spec.bottom, spec.top];
  const x = (v) => box.left + ((warp(v) - x0) / (x1 - x0 || 1)) * (box.right - box.left);
  const y = (v) => box.bottom - ((v - y0) / (y1 - y0 || 1)) * (box.bottom - box.top);
  const back = (px) => {
    const v = x0 + ((px - box.left) / (box.right - box.left)) * (x1 - x0);
    return spec.log ? 10 ** v : v;
  };
  const inner = box.right - box.left;
  for (const v of spec.log ? logTicks(spec.low, spec.high) : ticks(spec.low, spec.high, inner / 90)) {
    draw("path", { class: "grid", d: `M${x(v)} ${box.top}V${box.bottom}` }, svg);
    draw("text", { class: "tick", x: x(v), y: box.bottom + 16, "text-anchor": "middle" }, svg, say(v));
  }
  if (!spec.noRows) {
    for (const v of ticks(y0, y1, (box.bottom - box.top) / 34)) {
      draw("path", { class: v === 0 ? "grid zero" : "grid", d: `M${box.left} ${y(v)}H${box.right}` }, svg);
      draw("text", { class: "tick", x: box.left - 7, y: y(v) + 4, "text-anchor": "end" }, svg, say(v));
    }
  }
  draw("rect", { class: "box", x: box.left, y: box.top, width: inner, height: box.bottom - box.top }, svg);
  draw("text", { class: "tick", x: box.right, y: height - 4, "text-anchor": "end" }, svg, spec.x);
  return { svg, box, x, y, back, width };
}

function addCursor(place, inTime) {
  const line = draw("path", { class: "cursor", visibility: "hidden" }, place.svg);
  const show = (time) => {
    if (time === null || time === undefined) return;
    line.setAttribute("d", `M${place.x(time)} ${place.box.top}V${place.box.bottom}`);
    line.setAttribute("visibility", "visible");
  };
  if (inTime) show(clock.time);
  return show;
}

function nearest(values, wanted) {
  let low = 0;
  let high = values.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (values[middle] < wanted) low = middle;
    else high = middle;
  }
  return Math.abs(values[low] - wanted) <= Math.abs(values[high] - wanted) ? low : high;
}

function heading(figure, spec) {
  const title = make("figcaption", {}, figure);
  make("span", { class: "charttitle" }, title, spec.title);
  make("span", { class: "unit" }, title, ` [${spec.unit}]`);
  return title;
}

function readoutOf(figure) {
  return make("div", { class: "readout", "aria-live": "off" }, figure);
}

// Redraws when the width changes, and for paper in the width that it has there, so that letters keep their size.
function keepDrawn(holder, render) {
  let width = 0;
  const again = () => {
    const wanted = holder.paper || holder.clientWidth;
    if (wanted && wanted !== width) {
      width = wanted;
      holder.replaceChildren();
      render();
    }
  };
  again();
  new ResizeObserver(again).observe(holder);
  window.addEventListener("beforeprint", () => {
    holder.paper = holder.closest(".two") ? 340 : 700;
    again();
  });
  window.addEventListener("afterprint", () => {
    holder.paper = 0;
    again();
  });
}

function lineChart(figure, spec) {
  heading(figure, spec);
  const legend = make("div", { class: "legend" }, figure);
  const readout = readoutOf(figure);
  const holder = make("div", { class: "holder" }, figure);
  // The title of a chart of one curve may say all.
  legend.hidden = spec.curves.length === 1 && spec.title.toLowerCase().includes(spec.curves[0].name.toLowerCase());
  if (spec.note) make("p", { class: "note" }, figure, spec.note);
  spec.curves.forEach((curve, i) => {
    const key = make("span", {}, legend);
    const mark = draw("svg", { viewBox: "0 0 26 8", width: 26, height: 8, "aria-hidden": "true" }, null);
    draw("path", { d: "M0 4H26", stroke: COLOURS[i % 7], "stroke-width": 2.4, "stroke-dasharray": dash(i) }, mark);
    key.appendChild(mark);
    make("span", {}, key, curve.name);
  });
  const all = spec.curves.flatMap((c) => c.y);
  let bottom = Math.min(0, ...extent(all));
  let top = Math.max(0, ...extent(all));
  if (top === bottom) top = bottom + 1;
  const room = 0.06 * (top - bottom);
  bottom -= bottom < 0 ? room : 0;
  top += top > 0 ? room : 0;
  const xs = extent(spec.curves.flatMap((c) => [c.x[0], c.x[c.x.length - 1]]));
  const ranges = { ...spec, low: xs[0], high: xs[1], bottom, top };
  let showCursor = () => {};
  keepDrawn(holder, () => {
    const place = frame(holder, ranges, spec.height || 230, { left: 62, right: 12, top: 8, bottom: 34 });
    spec.curves.forEach((curve, i) => {
      const d = curve.x.map((x, k) => `${k ? "L" : "M"}${place.x(x).toFixed(1)} ${place.y(curve.y[k]).toFixed(1)}`).join("");
      const marks = curve.x.length < 3 ? { "stroke-linecap": "round", "stroke-width": 4 } : {};
      draw("path", { class: "curve", d, stroke: COLOURS[i % 7], "stroke-dasharray": dash(i), ...marks }, place.svg);
    });
    showCursor = addCursor(place, spec.time);
    const dots = spec.curves.map((_, i) => draw("circle", { r: 3.5, fill: COLOURS[i % 7], visibility: "hidden" }, place.svg));
    holder.appendChild(place.svg);
    const at = (event) => {
      const scale = place.width / place.svg.getBoundingClientRect().width;
      const px = (event.clientX - place.svg.getBoundingClientRect().left) * scale;
      return Math.min(Math.max(place.back(px), xs[0]), xs[1]);
    };
    place.svg.addEventListener("pointermove", (event) => {
      const wanted = at(event);
      const shown = spec.curves.map((curve, i) => {
        const k = nearest(curve.x, wanted);
        dots[i].setAttribute("cx", place.x(curve.x[k]));
        dots[i].setAttribute("cy", place.y(curve.y[k]));
        dots[i].setAttribute("visibility", "visible");
        return `${curve.name} ${say(curve.y[k], 5)}`;
      });
      const [symbol, unit] = spec.x.replace("]", "").split(" [");
      const here = spec.curves.length ? spec.curves[0].x[nearest(spec.curves[0].x, wanted)] : wanted;
      readout.textContent = `${symbol} = ${say(here, 5)} ${unit}:  ${shown.join(",  ")} ${spec.unit}`;
    });
    place.svg.addEventListener("pointerleave", () => {
      readout.textContent = "";
      dots.forEach((dot) => dot.setAttribute("visibility", "hidden"));
    });
    if (spec.time) place.svg.addEventListener("click", (event) => clock.set(at(event)));
  });
  if (spec.time) clock.listeners.push((time) => showCursor(Math.min(Math.max(time, xs[0]), xs[1])));
}

function dash(i) {
  return DASHES[Math.floor(i / 7) % 4] || (i % 7 && i < 7 ? ["", "7 3", "", "9 3 2 3", "2 2", "7 3", "2 2"][i] : "");
}

function extent(values) {
  let low = Infinity;
  let high = -Infinity;
  for (const v of values) {
    if (v < low) low = v;
    if (v > high) high = v;
  }
  return [low, high];
}

function colour(hue, share) {
  const stops = HUES[hue];
  const at = Math.min(Math.max(share, 0), 1) * (stops.length - 1);
  const k = Math.min(Math.floor(at), stops.length - 2);
  return stops[k].map((v, i) => Math.round(v + (at - k) * (stops[k + 1][i] - v)));
}

function mapChart(figure, spec) {
  heading(figure, spec);
  const readout = readoutOf(figure);
  const holder = make("div", { class: "holder" }, figure);
  const values = unpack(spec.values, Uint16Array);
  const rows = spec.names.length;
  const picture = document.createElement("canvas");
  picture.width = spec.columns;
  picture.height = rows;
  const pixels = picture.getContext("2d").createImageData(spec.columns, rows);
  for (let r = 0; r < rows; r++) {
    for (let c = 0; c < spec.columns; c++) {
      const rgb = colour(spec.hue, values[r * spec.columns + c] / 65535);
      pixels.data.set([...rgb, 255], 4 * ((rows - 1 - r) * spec.columns + c));
    }
  }
  picture.getContext("2d").putImageData(pixels, 0, 0);
  const url = picture.toDataURL();
  let showCursor = () => {};
  const height = Math.min(320, Math.max(150, 90 + 18 * rows));
  const ranges = { ...spec, x: "t [s]", low: spec.from, high: spec.to, bottom: 0.5, top: rows + 0.5, noRows: true };
  keepDrawn(holder, () => {
    const place = frame(holder, ranges, height, { left: 62, right: 74, top: 8, bottom: 34 });
    const { box } = place;
    draw("image", { href: url, x: box.left, y: box.top, width: box.right - box.left, height: box.bottom - box.top,
      preserveAspectRatio: "none", class: "pixels" }, place.svg);
    draw("rect", { class: "box", x: box.left, y: box.top, width: box.right - box.left, height: box.bottom - box.top }, place.svg);
    const every = Math.max(1, Math.ceil(rows / ((box.bottom - box.top) / 15)));
    for (let r = 0; r < rows; r += every) {
      draw("text", { class: "tick", x: box.left - 7, y: place.y(r + 1) + 4, "text-anchor": "end" }, place.svg, spec.names[r]);
    }
    const bar = { x: box.right + 14, steps: 40 };
    for (let k = 0; k < bar.steps; k++) {
      const tall = (box.bottom - box.top) / bar.steps;
      draw("rect", { x: bar.x, y: box.bottom - (k + 1) * tall, width: 12, height: tall + 0.5,
        fill: `rgb(${colour(spec.hue, k / (bar.steps - 1))})` }, place.svg);
    }
    draw("rect", { class: "box", x: bar.x, y: box.top, width: 12, height: box.bottom - box.top }, place.svg);
    for (const v of ticks(0, spec.top || 1, 4)) {
      if (v > (spec.top || 1)) continue;
      const py = box.bottom - (v / (spec.top || 1)) * (box.bottom - box.top);
      draw("text", { class: "tick", x: bar.x + 16, y: py + 4 }, place.svg, say(v, 3));
    }
    showCursor = addCursor(place, true);
    holder.appendChild(place.svg);
    const at = (event) => {
      const rect = place.svg.getBoundingClientRect();
      const scale = place.width / rect.width;
      const c = Math.floor((((event.clientX - rect.left) * scale - box.left) / (box.right - box.left)) * spec.columns);
      const r = rows - 1 - Math.floor((((event.clientY - rect.top) * scale - box.top) / (box.bottom - box.top)) * rows);
      return c >= 0 && c < spec.columns && r >= 0 && r < rows ? [r, c] : null;
    };
    const timeOf = (c) => spec.from + ((c + 0.5) / spec.columns) * (spec.to - spec.from);
    place.svg.addEventListener("pointermove", (event) => {
      const found = at(event);
      if (!found) return;
      const value = (values[found[0] * spec.columns + found[1]] / 65535) * spec.top;
      readout.textContent = `${spec.names[found[0]]}, t \u2248 ${say(timeOf(found[1]), 4)} s:  ${say(value, 4)} ${spec.unit}`;
    });
    place.svg.addEventListener("pointerleave", () => { readout.textContent = ""; });
    place.svg.addEventListener("click", (event) => {
      const found = at(event);
      if (found) clock.set(timeOf(found[1]));
    });
  });
  clock.listeners.push((time) => showCursor(Math.min(Math.max(time, spec.from), spec.to)));
}

// Pressure along a line of contacts: largest, mean and at the film's instant. `forces(frame)` gives the contact forces in N.
function pressureChart(figure, spec, forces) {
  heading(figure, spec);
  const legend = make("div", { class: "legend" }, figure);
  for (const [name, kind] of [["largest", "largest"], ["mean", "mean"], ["now", "now"]]) {
    const key = make("span", {}, legend);
    const mark = draw("svg", { viewBox: "0 0 26 8", width: 26, height: 8, "aria-hidden": "true" }, null);
    draw("path", { d: "M0 4H26", class: `pressure ${kind}` }, mark);
    key.appendChild(mark);
    make("span", {}, key, name);
  }
  const holder = make("div", { class: "holder" }, figure);
  const top = 1.06 * Math.max(...spec.largest, 1e-300);
  const high = spec.position[spec.position.length - 1];
  let now = null;
  let place = null;
  const path = (values) => values.map((v, k) => `${k ? "L" : "M"}${place.x(spec.position[k]).toFixed(1)} ${place.y(v).toFixed(1)}`).join("");
  const show = (k) => {
    if (!now || !forces) return;
    const here = forces(k);
    now.setAttribute("d", path(spec.contacts.map((c, i) => here[c] * spec.per[i])));
  };
  let last = 0;
  keepDrawn(holder, () => {
    place = frame(holder, { ...spec, x: "along the line [m]", low: 0, high, bottom: 0, top }, 200, { left: 62, right: 12, top: 8, bottom: 34 });
    draw("path", { class: "pressure largest", d: path(spec.largest) }, place.svg);
    draw("path", { class: "pressure mean", d: path(spec.mean) }, place.svg);
    now = draw("path", { class: "pressure now" }, place.svg);
    show(last);
    holder.appendChild(place.svg);
  });
  return (k) => { last = k; show(k); };
}

for (const spec of DATA.charts) {
  const figure = document.getElementById(`chart-${spec.key}`);
  if (figure) (spec.kind === "map" ? mapChart : lineChart)(figure, spec);
}
