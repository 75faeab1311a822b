// SPDX-License-Identifier: GPL-3.0-or-later
// One plot over time. Its window of time, its cursor and its data are those of all plots (plots.js).
import uPlot from "uplot";
import { axisLabels } from "./axis_labels.js";
import { $, make } from "./elements.js";
import { axis, css, sizeOf } from "./plot_style.js";

const LEAST_DRAG_px = 4;  // a shorter one is a click
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
export class Curve {
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
