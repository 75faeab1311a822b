// SPDX-License-Identifier: GPL-3.0-or-later
// The plots over time: they share one window of time and one cursor.
import { timeText } from "./axis_labels.js";
import { Curve } from "./curve.js";
import { History, Rows } from "./curve_data.js";
import { $ } from "./elements.js";
import { sizeOf } from "./plot_style.js";
import { TickDurations } from "./tick_durations.js";

const MINIMUM_WINDOW_s = 2e-3;
const TIME_STEPS_s = [0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 30, 60, 120, 300, 600];
const LABEL_px = 62;  // width of a label of the time axis with its distance to the next one
const DESCRIBE_INTERVAL_MS = 2000;

export class Plots {
  /** seek: receives a time of the recording that was selected in a plot. */
  constructor({ seek }) {
    this.seek = seek;
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
    this.times = new TickDurations("plot-times");
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
