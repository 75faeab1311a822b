// SPDX-License-Identifier: GPL-3.0-or-later
// Plots over time with one cursor and one window of time, and the histogram of tick durations.
import uPlot from "uplot";
import { axisLabels, timeText } from "./axis_labels.js";
import { History, Rows } from "./curve_data.js";
import { $, make } from "./elements.js";

const MINIMUM_WINDOW_s = 2e-3;
const TIME_STEPS_s = [0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 30, 60, 120, 300, 600];
const LABEL_px = 62;  // width of a label of the time axis with its distance to the next one
const DESCRIBE_INTERVAL_MS = 2000;
const LEAST_DRAG_px = 4;  // a shorter one is a click

export const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

const axis = (more = {}) => ({
  stroke: () => css("--muted"),
  grid: { stroke: () => css("--line"), width: 1 },
  ticks: { show: false },
  font: "11px system-ui, sans-serif",
  ...more,
});

const sizeOf = (box) => ({ width: Math.max(box.clientWidth, 60), height: Math.max(box.clientHeight, 40) });
const COLOURS = { x: "--x", y: "--y", z: "--z", norm: "--muted", value: "--ink", angle: "--torque" };
const shortNumber = (x) => (Math.abs(x) >= 1e5 || (x !== 0 && Math.abs(x) < 1e-3) ? x.toExponential(1) : x.toFixed(Math.abs(x) < 10 ? 3 : 1));

/** Returns an extreme pair as text: "1.200", or "1.200 to 1.300" if they differ. */
function rangeText(pair, factor) {
  if (!pair) return "–";
  const [low, high] = pair.map((x) => shortNumber(factor * x));
  return low === high ? low : `${low} to ${high}`;
}

/**
 * Returns the range of an axis. By default it contains zero and has a minimum height, so that noise in free space does not look
 * like force. fit: the range of the data alone, for small changes of a large value.
 */
function valueRange(low, high, minimum, fit) {
  if (fit && low !== null && high !== null) {
    const least = Math.max(1e-9 * Math.max(Math.abs(low), Math.abs(high)), 1e-9 * minimum);
    const room = Math.max(0.06 * (high - low), (least - (high - low)) / 2);
    return [low - room, high + room];
  }
  const from = Math.min(low ?? 0, 0), to = Math.max(high ?? 0, minimum);
  const room = 0.06 * (to - from);
  return [from < 0 ? from - room : 0, to + room];
}

/** One plot. The window, the cursor and the data are those of all plots. */
class Curve {
  /** series: [{label, name, channel, factor, unit, colour, scale, minimum}]; the first ones are drawn behind the others. */
  constructor(id, series, plots) {
    this.box = $(id);
    this.name = this.box.previousElementSibling.firstChild.textContent.trim();
    this.wanted = series;
    this.plots = plots;
    this.legend();
    this.readout = make("div", { className: "readout", hidden: true });
    this.readout.setAttribute("aria-hidden", "true");  // the time cursor says the same
    const scales = [...new Map(series.map((one) => [one.scale, one])).values()];
    this.plot = new uPlot({
      ...sizeOf(this.box),
      legend: { show: false },
      cursor: { y: false, points: { show: false }, drag: { x: true, y: false, setScale: false, dist: LEAST_DRAG_px, click: () => {} },
        sync: { key: "plots", scales: ["x", null] }, bind: { dblclick: () => () => plots.release() } },
      padding: [6, scales.length > 1 ? 0 : 14, 0, 0],
      scales: {
        x: { time: false, range: () => plots.window },
        ...Object.fromEntries(scales.map(({ scale, minimum }) => [scale, { range: (u, low, high) => valueRange(low, high, minimum, plots.fit) }])),
      },
      axes: [
        axis({ size: 20, gap: 5, splits: (u, number, from, to) => plots.timeTicks(from, to, u.bbox.width / devicePixelRatio),
          values: (u, ticks) => plots.timeLabels(ticks) }),
        ...scales.map(({ scale, colour }, i) => axis({ size: 46, gap: 3, scale, side: i === 0 ? 3 : 1, space: 22,
          grid: { show: i === 0, stroke: () => css("--line"), width: 1 }, values: (u, ticks) => axisLabels(ticks),
          ...(scales.length > 1 ? { stroke: () => css(COLOURS[colour]) } : {}) })),
      ],
      series: [{}, ...series.map((one) => this.line(one, false))],
      hooks: {
        setCursor: [(u) => plots.showCursor(u)],
        setSelect: [(u) => this.zoom(u)],
        draw: [(u) => this.playhead(u)],
      },
    }, [[], ...series.map(() => [])], this.box);
    this.box.append(this.readout);
    this.box.setAttribute("role", "img");
    this.plot.over.addEventListener("mousedown", (event) => (this.pressed_px = event.clientX));
    this.plot.over.addEventListener("click", (event) => this.click(event));
  }

  /** A norm is a wide pale line behind its components, so that it hides none of them. The compared recording is dashed. */
  line({ label, colour, scale }, compared) {
    const norm = colour === "norm";
    return { label, scale, width: norm ? (compared ? 2 : 3.5) : 1.3, alpha: norm ? 0.4 : 1, dash: compared ? [5, 4] : undefined,
      stroke: () => css(COLOURS[colour]), points: { show: false } };
  }

  legend() {
    this.box.previousElementSibling.append(make("span", { className: "series" }, ...this.wanted.map(({ label, colour }) =>
      make("span", {}, make("i", { className: `c-${colour}` }), label))));
  }

  compare() {
    for (const one of this.wanted) this.plot.addSeries(this.line(one, true));
  }

  click(event) {
    if (Math.abs(event.clientX - this.pressed_px) >= LEAST_DRAG_px) return;  // the end of a drag
    this.plots.pick(this.plot.posToVal(event.offsetX, "x"), event.detail > 1);
  }

  zoom(u) {
    if (u.select.width <= 0) return;
    const [from, to] = [u.select.left, u.select.left + u.select.width].map((at) => u.posToVal(at, "x"));
    u.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
    if (!u.cursor.event) return;  // a plot that only follows the cursor of another one
    this.plots.hold(from, to);
  }

  playhead(u) {
    const t = this.plots.playhead;
    if (t === null) return;
    const { left, top, width, height } = u.bbox;
    const x = u.valToPos(t, "x", true);
    if (x < left || x > left + width + 1) return;
    u.ctx.save();
    u.ctx.fillStyle = css("--ink");
    u.ctx.fillRect(x - devicePixelRatio / 2, top, devicePixelRatio, height);
    u.ctx.restore();
  }

  /** data: rows of the shown and, if there is one, of the compared recording. */
  draw(data, [from, to]) {
    const wanted = this.wanted.map(({ channel, factor }) => [channel, factor]);
    const tables = data.map((rows) => rows.columns(from, to, wanted));
    this.plot.setData(tables.length > 1 ? uPlot.join(tables) : tables[0]);
  }

  values(data, t) {
    return data.map((rows, i) => this.wanted.map(({ label, channel, factor, unit, colour }) => ({
      colour, label, compared: i > 0, text: `${rangeText(rows.valueAt(channel, t), factor)} ${unit}` })));
  }

  showReadout(data, t, text, left) {
    this.readout.hidden = t === null;
    if (t === null) return;
    this.readout.style.left = left > this.plot.over.clientWidth / 2 ? `${this.plot.over.offsetLeft + 2}px` : "auto";
    this.readout.style.right = left > this.plot.over.clientWidth / 2 ? "auto" : "4px";
    this.readout.replaceChildren(make("b", { textContent: text }), ...this.values(data, t).flat().map(({ colour, label, compared, text: value }) =>
      make("span", {}, make("i", { className: `c-${colour}${compared ? " dashed" : ""}` }), `${label} ${value}`)));
  }

  /** The text alternative of the plot: its extremes. */
  describe(data, [from, to], when) {
    const parts = data.flatMap((rows, i) => this.wanted.map(({ label, channel, factor, unit }) =>
      `${i > 0 ? "compared, " : ""}${label} ${rangeText(rows.extremes(channel, from, to), factor)} ${unit}`));
    this.box.setAttribute("aria-label", `${this.name}, ${when}: ${parts.join("; ")}`);
  }
}

/** Histogram with logarithmic bins from 1 us, 12 per decade. */
class Times {
  constructor(id) {
    this.box = document.getElementById(id);
    this.deadline_us = 0;
    const bars = uPlot.paths.bars({ size: [1, Infinity], align: 1, gap: 1 });
    const steps = uPlot.paths.stepped({ align: 1 });
    const decades = ["1 us", "10 us", "100 us", "1 ms", "10 ms", "100 ms"];
    this.plot = new uPlot({
      ...sizeOf(this.box),
      legend: { show: false },
      cursor: { show: false },
      padding: [8, 22, 0, 0],
      scales: { x: { time: false, range: () => [0, 60] }, y: { range: (u, low, high) => [0, Math.max(high ?? 0, 1) * 1.08] } },
      axes: [
        axis({ size: 20, gap: 5, splits: () => [0, 12, 24, 36, 48, 60], values: () => decades }),
        axis({ size: 44, gap: 3, splits: () => [0, 1, 2, 3, 4], values: () => ["0", "10", "100", "1k", "10k"] }),
      ],
      series: [{},
        { paths: bars, width: 0, fill: () => css("--tool"), points: { show: false } },
        { paths: steps, width: 1.6, stroke: () => css("--force"), points: { show: false } }],
      hooks: { draw: [(u) => this.mark(u)] },
    }, [[], [], []], this.box);
  }

  mark(u) {
    if (!(this.deadline_us > 1)) return;
    const x = u.valToPos(12 * Math.log10(this.deadline_us), "x", true);
    const { top, height } = u.bbox;
    u.ctx.save();
    u.ctx.strokeStyle = u.ctx.fillStyle = css("--bad");
    u.ctx.lineWidth = 2 * devicePixelRatio;
    u.ctx.beginPath();
    u.ctx.moveTo(x, top);
    u.ctx.lineTo(x, top + height);
    u.ctx.stroke();
    u.ctx.font = `${11 * devicePixelRatio}px system-ui, sans-serif`;
    u.ctx.fillText("deadline", x + 5 * devicePixelRatio, top + 11 * devicePixelRatio);
    u.ctx.restore();
  }

  draw({ tick_duration, wake_latency }, deadline_us) {
    this.deadline_us = deadline_us;
    const height = (count) => Math.log10(1 + count);  // a single late tick stays visible beside ten thousand others
    this.plot.setData([tick_duration.bins.map((_, i) => i), tick_duration.bins.map(height), wake_latency.bins.map(height)]);
  }
}

export class Plots {
  /** seek: receives a time of the recording that was selected in a plot. changed: called when the window or the controls change. */
  constructor({ seek, changed }) {
    this.seek = seek;
    this.changed = changed;
    this.span_s = 10;
    this.window = [-10, 0];
    this.held = null;      // a window that does not move; null: the window ends at the present time
    this.fit = false;
    this.now = 0;
    this.playhead = null;
    this.history = new History();
    this.frozen = null;    // the history while live plots are paused
    this.recorded = [new Rows()];
    this.cursor = null;    // time under the cursor
    this.describedAt = -Infinity;
    this.recording = false;
    this.duration = 0;     // of the recording [s]
    const xyz = (name, factor, unit, minimum) => [
      { label: "norm", channel: name, factor, unit, colour: "norm", scale: "y", minimum },
      ...["x", "y", "z"].map((a) => ({ label: a, channel: `${name}_${a}`, factor, unit, colour: a, scale: "y", minimum }))];
    this.curves = [
      new Curve("plot-force", xyz("force", 1, "N", 1), this),
      new Curve("plot-torque", xyz("torque", 1e3, "mN·m", 10), this),
      new Curve("plot-depth", [
        { label: "distance", channel: "depth", factor: 1e3, unit: "mm", colour: "value", scale: "y", minimum: 0.5 },
        { label: "rotation", channel: "angle", factor: 180 / Math.PI, unit: "°", colour: "angle", scale: "angle", minimum: 0.5 }], this),
      new Curve("plot-energy", [{ label: "T", channel: "energy", factor: 1e6, unit: "kg·mm²", colour: "value", scale: "y", minimum: 0.05 }], this),
    ];
    this.times = new Times("plot-times");
    this.all = [...this.curves, this.times];
    const observer = new ResizeObserver(() => this.all.forEach(({ plot, box }) => plot.setSize(sizeOf(box))));
    this.all.forEach(({ box }) => observer.observe(box));
    $("span").onchange = () => this.setSpan(Number($("span").value));
    $("pause").onclick = () => this.pause();
    $("fit-values").onclick = () => this.toggleFit();
    $("whole").onclick = () => this.release();
    $("plot-cursor").oninput = () => this.moveCursor(Number($("plot-cursor").value));
    $("plot-cursor").onblur = () => this.setCursor(null);
    this.showControls();
  }

  // --- window of time ---

  setSpan(span_s) {
    this.span_s = span_s;
    this.release();
  }

  /** Shows this range until release(). Live plots pause. */
  hold(from, to) {
    const width = Math.max(to - from, MINIMUM_WINDOW_s);
    this.held = this.within(from, width);
    if (!this.recording) this.frozen ??= this.history.frozen();
    this.showControls();
    this.redraw();
  }

  /** Returns to the window that ends at the present time. */
  release() {
    this.held = this.frozen = null;
    this.showControls();
    this.redraw();
  }

  pause() {
    if (this.recording) return;
    if (this.held) this.release();
    else this.hold(...this.window);
  }

  /** factor: below 1 zooms in about the cursor or the middle of the window. */
  zoom(factor) {
    const [from, to] = this.window, at = this.cursor ?? (from + to) / 2;
    if (factor * (to - from) > 600) return;
    this.hold(at - factor * (at - from), at + factor * (to - at));
  }

  toggleFit() {
    this.fit = !this.fit;
    this.showControls();
    this.redraw();
  }

  showControls() {
    $("pause").textContent = this.held ? "Resume plots" : "Pause plots";
    $("pause").setAttribute("aria-pressed", String(this.held !== null));
    $("fit-values").setAttribute("aria-pressed", String(this.fit));
    $("whole").disabled = this.held === null;
  }

  /** A click in a recording selects its time. The window then rests while that time is in it. */
  pick(t, again) {
    if (!this.recording) return;
    if (again) return this.seek(this.before);  // a double click only returns to the moving window
    this.before = this.now;
    this.held ??= [...this.window];
    this.showControls();
    this.seek(t);
  }

  /** Returns a window. The window of a recording is moved and shortened so that it lies within the recording. */
  within(from, width) {
    if (!this.recording) return [from, from + width];
    const length = Math.max(Math.min(width, this.duration), MINIMUM_WINDOW_s);
    const start = Math.max(Math.min(from, this.duration - length), 0);
    return [start, start + length];
  }

  follow(now) {
    this.now = now;
    if (!this.held) return (this.window = this.within(now - this.span_s, this.span_s));
    const width = this.held[1] - this.held[0];
    if (this.recording && now > this.held[1]) this.held = this.within(now - width, width);
    if (this.recording && now < this.held[0]) this.held = this.within(now, width);
    this.window = this.held;
  }

  /** Time axes of live plots count back from the end of the window; those of a recording count from its start. */
  timeTicks(from, to, width_px) {
    const step = TIME_STEPS_s.find((one) => ((to - from) / one) * LABEL_px <= width_px) ?? TIME_STEPS_s.at(-1);
    this.step_s = step;
    const origin = this.recording ? 0 : this.now, ticks = [];
    for (let k = Math.ceil((from - origin) / step - 1e-6); k <= (to - origin) / step + 1e-6; ++k) ticks.push(origin + k * step);
    return ticks;
  }

  timeLabels(ticks) {
    return ticks.map((t) => this.timeText(t, this.step_s));
  }

  timeText(t, step_s) {
    if (this.recording) return timeText(t, step_s);
    return Math.abs(t - this.now) < step_s / 100 ? "now" : timeText(t - this.now, step_s);
  }

  // --- data ---

  /** recorded: the name of a recording of this duration [s]; compared: the name of the second one, or undefined. */
  showRecording(recorded, duration, compared) {
    this.recording = true;
    this.duration = duration;
    this.held = this.frozen = null;
    if (compared && this.recorded.length === 1) {
      this.recorded.push(new Rows());
      for (const curve of this.curves) curve.compare();
    }
    $("compared").hidden = !compared;
    $("compared").textContent = compared ? `solid: ${recorded}; dashed: ${compared}` : "";
    this.showControls();
  }

  setColumns(number, rows) {
    this.recorded[number] = rows;
    this.describedAt = -Infinity;  // the text alternatives change with the curves
    this.redraw();
  }

  data() {
    if (this.recording) return this.recorded;
    return [(this.frozen ?? this.history).rowsFor(...this.window)];
  }

  /** Returns the range of curves that the plots of a recording need, and the number of columns. */
  request() {
    return [...this.window, Math.min(Math.max(this.curves[0].plot.over.clientWidth, 200), 1000)];
  }

  draw(now) {
    if (this.held && !this.recording) return this.describe();
    this.follow(now);
    this.redraw();
  }

  redraw() {
    if (!this.held) this.follow(this.now);
    else this.window = this.held;
    this.playhead = this.recording && this.now < this.window[1] ? this.now : null;
    const data = this.data();
    for (const curve of this.curves) curve.draw(data, this.window);
    this.showReadout();
    this.describe();
  }

  describe() {
    if (performance.now() < this.describedAt + DESCRIBE_INTERVAL_MS) return;
    this.describedAt = performance.now();
    const [from, to] = this.window, data = this.data();
    const when = `${this.timeText(from, 0.1)} to ${this.timeText(to, 0.1)}`;
    for (const curve of this.curves) curve.describe(data, this.window, when);
  }

  // --- cursor ---

  showCursor(u) {
    if (u !== this.curves[0].plot) return;  // the cursors of all plots move together
    const left = u.cursor.left;
    this.cursor = left >= 0 ? u.posToVal(left, "x") : null;
    this.left = left;
    this.showReadout();
  }

  showReadout() {
    if (!this.curves) return;
    const t = this.cursor === null ? null : this.curves[0].plot.posToVal(this.left, "x");
    this.cursor = t;
    for (const curve of this.curves) curve.showReadout(t === null ? [] : this.data(), t, t === null ? "" : this.timeText(t, (this.window[1] - this.window[0]) / 1000), this.left);
    const value = t === null ? "no cursor" : `${this.timeText(t, 0.01)}: ` + this.curves.map((curve) =>
      `${curve.name} ${curve.values(this.data(), t).flat().map(({ label, text, compared }) => `${compared ? "compared " : ""}${label} ${text}`).join(", ")}`).join("; ");
    if ($("plot-cursor").getAttribute("aria-valuetext") !== value) $("plot-cursor").setAttribute("aria-valuetext", value);
  }

  /** share: place in the window, 0 to 1000. */
  moveCursor(share) {
    this.setCursor((share / 1000) * (this.curves[0].plot.over.clientWidth - 1));
  }

  /** left: pixels from the left edge of the plots; null: no cursor. */
  setCursor(left) {
    for (const { plot } of this.curves) plot.setCursor({ left: left ?? -10, top: left === null ? -10 : 5 }, true, false);
  }

  drawTimes(times, deadline_us) {
    this.times.draw(times, deadline_us);
  }

  recolour() {
    for (const { plot } of this.all) plot.redraw(false, true);
  }
}
