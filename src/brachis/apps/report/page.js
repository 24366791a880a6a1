"use strict";
(() => {
const { motion, timeline, scene } = JSON.parse(document.getElementById("data").textContent);
const element = (id) => document.getElementById(id);
const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
const floats = (array) => new Float32Array(bytes(array.bdata).buffer);
const styled = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const [t, s, speed, bones] = [scene.t, scene.s, scene.speed, scene.bones].map(floats);
const frames = t.length, points = bones.length / frames / 3, end = t[frames - 1];
const fastest = Math.max(...speed), listeners = [];
let now = 0;

// Time: everything that follows it is told of its changes.
function setTime(value) {
  now = Math.min(Math.max(value, 0), end);
  element("time").value = now;
  listeners.forEach((listener) => listener());
}
function frameAt(time) {
  return Math.min(Math.round((time / end) * (frames - 1)), frames - 1);
}
function pointAt(time, point) { // linear between frames
  const place = (time / end) * (frames - 1), k = Math.min(Math.floor(place), frames - 2), part = place - k;
  const at = (frame, axis) => bones[(frame * points + point) * 3 + axis];
  return [0, 1, 2].map((axis) => (1 - part) * at(k, axis) + part * at(k + 1, axis));
}

// The robot, projected in parallel; a planar one onto its plane.
const canvas = element("robot"), pen = canvas.getContext("2d");
let azimuth = -0.95, elevation = 0.42, zoom = 1;
const low = [Infinity, Infinity, Infinity], high = low.map((value) => -value);
for (let k = 0; k < bones.length; k++) {
  low[k % 3] = Math.min(low[k % 3], bones[k]);
  high[k % 3] = Math.max(high[k % 3], bones[k]);
}
const middle = low.map((value, axis) => (value + high[axis]) / 2);
function flat(point) { // across and up, m from the middle
  const [x, y, z] = point.map((value, axis) => value - middle[axis]);
  if (scene.plane) return scene.plane.map((axis) => [x, y, z][axis]);
  const [c, d] = [Math.cos(azimuth), Math.sin(azimuth)];
  return [-d * x + c * y, -Math.sin(elevation) * (c * x + d * y) + Math.cos(elevation) * z];
}
function fit() { // pixels per metre, for the view at the beginning
  let across = 0.1, up = 0.1;
  const include = (point) => {
    const [x, y] = flat(point);
    [across, up] = [Math.max(across, Math.abs(x)), Math.max(up, Math.abs(y))];
  };
  for (let k = 0; k < bones.length; k += 3) include([bones[k], bones[k + 1], bones[k + 2]]);
  [from[0], to[0]].forEach((x) => [from[1], to[1]].forEach((y) => include(onGround(0, x, y))));
  return { across, up };
}
const axesInView = scene.plane ?? [0, 1], ground = [...middle];
if (!scene.plane) ground[2] = Math.min(0, low[2]);
const wide = Math.max(...axesInView.map((axis) => high[axis] - low[axis]), 0.1);
const step = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10].find((value) => wide / value < 9) ?? 20;
const from = axesInView.map((axis) => Math.floor(low[axis] / step) * step);
const to = axesInView.map((axis) => Math.ceil(high[axis] / step) * step);
function onGround(i, value, other) {
  const point = [...ground];
  [point[axesInView[i]], point[axesInView[1 - i]]] = [value, other];
  return point;
}
const extent = fit();
function screen(point) {
  const { width, height } = canvas.getBoundingClientRect();
  const scale = zoom * 0.86 * Math.min(width / extent.across, height / extent.up) / 2, [x, y] = flat(point);
  return [width / 2 + scale * x, height / 2 - scale * y];
}
function stroke(line, colour, width, dash = []) {
  pen.beginPath();
  line.forEach((point, k) => pen[k ? "lineTo" : "moveTo"](...screen(point)));
  Object.assign(pen, { strokeStyle: colour, lineWidth: width, lineCap: "round", lineJoin: "round" });
  pen.setLineDash(dash);
  pen.stroke();
}
const posture = (time) => Array.from({ length: points }, (_, point) => pointAt(time, point));
const STOPS = [[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [232, 201, 23]];
function colourOf(part) {
  const place = Math.min(Math.max(part, 0), 1) * (STOPS.length - 1), k = Math.min(Math.floor(place), STOPS.length - 2);
  return `rgb(${STOPS[k].map((value, i) => value + (place - k) * (STOPS[k + 1][i] - value)).join(",")})`;
}
function drawGround() {
  const names = "xyz", base = posture(0)[0];
  [0, 1].forEach((i) => {
    for (let value = from[i]; value <= to[i] + step / 2; value += step) {
      stroke([onGround(i, value, from[1 - i]), onGround(i, value, to[1 - i])], styled("--line"), 1);
    }
  });
  pen.font = "12px sans-serif";
  (scene.plane ?? [0, 1, 2]).forEach((axis) => {
    const tip = [...base];
    tip[axis] += 1.2 * step;
    stroke([base, tip], ["#d62728", "#2ca02c", "#1f77b4"][axis], 2);
    pen.fillStyle = styled("--text");
    pen.fillText(names[axis], ...screen(tip));
  });
  pen.fillStyle = styled("--faint");
  pen.fillText(`grid ${step} m`, 10, 18);
}
function draw() {
  const { width, height } = canvas.getBoundingClientRect(), ratio = window.devicePixelRatio || 1;
  if (canvas.width !== Math.round(width * ratio)) {
    [canvas.width, canvas.height] = [Math.round(width * ratio), Math.round(height * ratio)];
  }
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  drawGround();
  const tool = (k) => pointAt(t[k], points - 1), text = styled("--text");
  stroke(posture(0), "rgba(128,140,155,0.35)", 5);
  stroke(posture(end), "rgba(128,140,155,0.55)", 5);
  for (let k = 1; k < frames; k++) {
    const passed = t[k] <= now + 1e-9;
    stroke([tool(k - 1), tool(k)], colourOf(speed[k] / (fastest || 1)), passed ? 4 : 1.6);
  }
  const links = posture(now);
  stroke(links, styled("--link"), 6);
  scene.joints.forEach((joint, k) => {
    const [x, y] = screen(links[2 * k + 2]);
    pen.setLineDash([]);
    pen.beginPath();
    if (joint.prismatic) pen.rect(x - 5, y - 5, 10, 10);
    else pen.arc(x, y, 5, 0, 2 * Math.PI);
    Object.assign(pen, { fillStyle: joint.redundant ? "#E69F00" : "#ffffff", strokeStyle: text, lineWidth: 1.5 });
    pen.fill();
    pen.stroke();
  });
}
function followPointer() {
  let last = null;
  canvas.addEventListener("pointerdown", (event) => { last = event; canvas.setPointerCapture(event.pointerId); });
  canvas.addEventListener("pointerup", () => { last = null; });
  canvas.addEventListener("pointermove", (event) => {
    if (!last || scene.plane) return;
    azimuth -= (event.clientX - last.clientX) / 150;
    elevation = Math.min(Math.max(elevation + (event.clientY - last.clientY) / 150, -1.5), 1.57);
    last = event;
    draw();
  });
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    zoom *= Math.exp(-event.deltaY / 800);
    draw();
  }, { passive: false });
  element("turn").textContent = scene.plane ? "Wheel: zoom." : "Drag: turn. Wheel: zoom.";
}

// The figures of every joint at the time.
const table = element("values");
const values = scene.joints.map((joint) => joint.quantities.map((each) => ({
  unit: each.unit, values: floats(each.values), ratios: each.ratios && floats(each.ratios),
})));
function makeTable() {
  table.createTHead().insertRow().append(...["joint", ...scene.kinds].map((name) => {
    const cell = document.createElement("th");
    cell.textContent = name;
    return cell;
  }));
  const body = table.createTBody();
  scene.joints.forEach((joint) => {
    const row = body.insertRow();
    row.insertCell().textContent = joint.name;
    joint.quantities.forEach(() => row.insertCell());
  });
}
function fillTable() {
  const k = frameAt(now);
  element("now").textContent =
    `t = ${now.toFixed(4)} s, s = ${s[k].toFixed(4)}, tool at ${speed[k].toFixed(3)} m/s`;
  values.forEach((row, joint) => row.forEach((each, column) => {
    const cell = table.tBodies[0].rows[joint].cells[column + 1], ratio = each.ratios?.[k];
    const share = ratio === undefined ? "" : ` (${(100 * ratio).toFixed(0)} %)`;
    cell.textContent = `${each.values[k].toFixed(3)} ${each.unit}${share}`;
    cell.className = ["beyond", "at", "near"].find((level) => ratio >= scene.levels[level]) ?? "";
  }));
}

// Playing.
let playing = null;
function play() {
  const wasPlaying = playing !== null;
  cancelAnimationFrame(playing);
  playing = null;
  element("play").textContent = wasPlaying ? "Play" : "Pause";
  if (wasPlaying) return;
  let before = performance.now();
  if (now >= end) setTime(0);
  const step = (clock) => {
    const next = now + (clock - before) / 1000 * Number(element("rate").value);
    before = clock;
    setTime(next);
    if (next >= end) { play(); return; }
    playing = requestAnimationFrame(step);
  };
  playing = requestAnimationFrame(step);
}

// The figures, in the page's looks and colours.
const TOP = 1.1, { at, beyond } = scene.levels;
const HEAT = {
  type: "heatmap", zmin: 0, zmax: TOP, ygap: 3,
  colorscale: [
    [0, "#F7FBFF"], [at / TOP / 2, "#9ECAE1"], [at / TOP, "#08306B"], [at / TOP, "#E69F00"],
    [beyond / TOP, "#E69F00"], [beyond / TOP, "#C00000"], [1, "#C00000"],
  ],
  colorbar: { title: { text: "fraction of the limit" }, thickness: 12, tickvals: [0, 0.25, 0.5, 0.75, 1] },
  hovertemplate: "%{y}: %{customdata:.1f} % of its limit at %{x:.4f} s<extra></extra>",
};
function curve(trace, text) {
  const limit = trace.meta === "limit", line = { simplify: limit, width: limit ? 1 : 1.8, ...trace.line };
  if (limit) line.dash = "4px,4px";
  if (line.color === "#000000") line.color = text;
  const looks = { type: "scatter", mode: "lines", legendgroup: trace.name, ...trace, line };
  return limit ? { ...looks, showlegend: false, hoverinfo: "skip" } : looks;
}
function dressed(figure, light) {
  const [text, grid] = light ? ["#1a1a1a", "#d0d4d9"] : [styled("--text"), styled("--line")];
  const layout = structuredClone(figure.layout), clear = "rgba(0,0,0,0)", isTimeline = figure === timeline;
  Object.assign(layout, {
    paper_bgcolor: clear, plot_bgcolor: clear, font: { color: text, size: 12 },
    hoverlabel: { bgcolor: light ? "#ffffff" : styled("--card"), font: { color: text } },
    hovermode: isTimeline ? "closest" : "x unified", margin: { l: 70, r: 20, t: 40, b: 50 },
    legend: { orientation: "h", y: 1, yanchor: "bottom", x: 0 },
    shapes: scene.phase_ends.map((time) => ({ // where phases meet
      type: "line", x0: time, x1: time, yref: "paper", y0: 0, y1: 1, line: { color: "#666666", width: 1, dash: "dot" },
    })),
  });
  Object.assign(layout.xaxis, { hoverformat: ".4f", title: { text: "t (s)" } });
  if (isTimeline) layout.yaxis = { automargin: true, fixedrange: true, ticks: "" };
  else Object.assign(layout.xaxis.minor, { ticks: "inside", ticklen: 3 });
  Object.keys(layout).filter((key) => /^[xy]axis/.test(key)).forEach((key) => {
    Object.assign(layout[key], { gridcolor: grid, linecolor: grid, zerolinecolor: grid, mirror: true, showline: true });
    if (key[0] === "y" && !isTimeline) {
      Object.assign(layout[key], { anchor: "x", zeroline: true });
      layout[key].title.standoff = 8;
    }
  });
  return [figure.data.map((trace) => isTimeline ? { ...HEAT, ...trace } : curve(trace, text)), layout];
}
function drawFigure(id, figure) {
  const place = element(id), config = { responsive: true, displaylogo: false };
  const cursor = document.createElement("div");
  cursor.className = "cursor";
  const show = (light) => Plotly.react(place, ...dressed(figure, light), config);
  show(false).then(() => {
    place.append(cursor);
    place.on("plotly_click", (event) => setTime(event.points[0].x));
    place.on("plotly_afterplot", move);
    move();
  });
  function move() {
    const layout = place._fullLayout, axis = layout.xaxis, x = axis._offset + axis.l2p(now);
    const inside = x >= axis._offset - 1 && x <= axis._offset + axis._length + 1;
    Object.assign(cursor.style, {
      left: `${x}px`, top: `${layout._size.t}px`, height: `${layout._size.h}px`, display: inside ? "" : "none",
    });
  }
  listeners.push(() => { if (cursor.isConnected) move(); });
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { show(false); draw(); });
  window.addEventListener("beforeprint", () => show(true));
  window.addEventListener("afterprint", () => show(false));
}
async function drawFigures() {
  const packed = new Blob([bytes(element("plotly").textContent)]).stream();
  const source = await new Response(packed.pipeThrough(new DecompressionStream("gzip"))).text();
  const script = document.createElement("script");
  script.textContent = source;
  document.head.append(script);
  drawFigure("motion_figure", motion);
  drawFigure("timeline_figure", timeline);
  document.body.dataset.ready = "yes";
}

element("time").max = end;
element("rate").value = end > 2.5 ? "1" : end > 1 ? "0.5" : "0.2";
element("slowest").textContent = "0";
element("fastest").textContent = `${fastest.toFixed(2)} m/s`;
element("time").addEventListener("input", (event) => setTime(Number(event.target.value)));
element("play").addEventListener("click", play);
window.addEventListener("resize", draw);
followPointer();
makeTable();
listeners.push(draw, fillTable);
setTime(0);
drawFigures().catch((error) => {
  Object.assign(element("notice"), { hidden: false, textContent: `The figures cannot be shown in this browser: ${error}` });
});
})();
