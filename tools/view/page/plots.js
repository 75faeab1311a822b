// SPDX-License-Identifier: GPL-3.0-or-later
// Plots of the last ten seconds, and the histogram of tick durations.
import uPlot from "uplot";

const SPAN_S = 10;
const CHANNELS = ["force_x", "force_y", "force_z", "force", "torque_x", "torque_y", "torque_z", "torque", "energy", "depth", "angle"];

export const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

/** The received history of the last ten seconds: two points per bucket, its minimum and its maximum. */
export class History {
  constructor() {
    this.clear();
  }

  clear() {
    this.times = [];
    this.values = CHANNELS.map(() => []);
  }

  add({ reset, rows, width, numbers }) {
    if (reset) this.clear();
    for (let i = 0; i < rows; ++i) {
      const row = numbers.subarray(i * width, (i + 1) * width);
      const before = this.times.length > 0 ? this.times[this.times.length - 1] : row[0];
      if (row[0] - before > 0.1) this.push(before + 0.001, () => null);  // a gap in the data
      this.push(row[0], (k) => row[1 + 2 * k]);
      this.push(row[0] + 0.005, (k) => row[2 + 2 * k]);
    }
    this.dropOld();
  }

  push(time, value) {
    this.times.push(time);
    this.values.forEach((values, k) => {
      const x = value(k);
      values.push(Number.isNaN(x) ? null : x);
    });
  }

  dropOld() {
    const oldest = this.times[this.times.length - 1] - SPAN_S;
    const first = this.times.findIndex((t) => t >= oldest);
    if (first < 500) return;
    this.times.splice(0, first);
    for (const values of this.values) values.splice(0, first);
  }

  /** Returns the times relative to `now`, and the named channels multiplied by their factors. */
  columns(now, wanted) {
    return [
      this.times.map((t) => t - now),
      ...wanted.map(([name, factor]) =>
        this.values[CHANNELS.indexOf(name)].map((x) => (x === null ? null : x * factor))),
    ];
  }
}

/** Returns a range with a minimum height, so that noise in free space does not look like force. */
const range = (minimum) => (u, low, high) => {
  const from = Math.min(low ?? 0, 0), to = Math.max(high ?? 0, minimum);
  const room = 0.06 * (to - from);
  return [from < 0 ? from - room : 0, to + room];
};

const axis = (more = {}) => ({
  stroke: () => css("--muted"),
  grid: { stroke: () => css("--line"), width: 1 },
  ticks: { show: false },
  font: "11px system-ui, sans-serif",
  ...more,
});

const sizeOf = (box) => ({ width: Math.max(box.clientWidth, 60), height: Math.max(box.clientHeight, 40) });

function legend(box, series) {
  const list = document.createElement("span");
  list.className = "series";
  for (const { label, colour } of series) {
    const one = document.createElement("span");
    const stroke = document.createElement("i");
    stroke.className = "c-" + colour;
    one.append(stroke, label);
    list.append(one);
  }
  box.previousElementSibling.append(list);
}

const COLOURS = { x: "--x", y: "--y", z: "--z", all: "--ink" };

class Curve {
  /** series: [{label, channel, factor, colour}] */
  constructor(id, series, minimum) {
    this.box = document.getElementById(id);
    this.wanted = series.map(({ channel, factor }) => [channel, factor]);
    legend(this.box, series);
    this.plot = new uPlot({
      ...sizeOf(this.box),
      legend: { show: false },
      cursor: { show: false },
      padding: [6, 16, 0, 0],
      scales: { x: { time: false, range: () => [-SPAN_S, 0] }, y: { range: range(minimum) } },
      axes: [axis({ size: 20, gap: 5, values: (u, at) => at.map((t) => (t === 0 ? "now" : `${t} s`)) }), axis({ size: 44, gap: 3 })],
      series: [{}, ...series.map(({ label, colour }) => ({
        label, width: colour === "all" ? 1.6 : 1.2, stroke: () => css(COLOURS[colour]), points: { show: false },
      }))],
    }, this.wanted.map(() => []).concat([[]]), this.box);
  }

  draw(history, now) {
    this.plot.setData(history.columns(now, this.wanted));
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
  constructor() {
    const xyz = (name, factor) => ["x", "y", "z"].map((a) => ({ label: a, channel: `${name}_${a}`, factor, colour: a }));
    this.curves = [
      new Curve("plot-force", [...xyz("force", 1), { label: "norm", channel: "force", factor: 1, colour: "all" }], 1),
      new Curve("plot-torque", [...xyz("torque", 1e3), { label: "norm", channel: "torque", factor: 1e3, colour: "all" }], 10),
      new Curve("plot-depth", [{ label: "mm", channel: "depth", factor: 1e3, colour: "all" },
                               { label: "°", channel: "angle", factor: 180 / Math.PI, colour: "z" }], 0.5),
      new Curve("plot-energy", [{ label: "T", channel: "energy", factor: 1e6, colour: "all" }], 0.05),
    ];
    this.times = new Times("plot-times");
    this.all = [...this.curves, this.times];
    const observer = new ResizeObserver(() => this.all.forEach(({ plot, box }) => plot.setSize(sizeOf(box))));
    this.all.forEach(({ box }) => observer.observe(box));
  }

  draw(history, now) {
    for (const curve of this.curves) curve.draw(history, now);
  }

  drawTimes(times, deadline_us) {
    this.times.draw(times, deadline_us);
  }

  recolour() {
    for (const { plot } of this.all) plot.redraw(false, true);
  }
}
