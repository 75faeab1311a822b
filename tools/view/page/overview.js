// SPDX-License-Identifier: GPL-3.0-or-later
// The force of the whole recording above the slider; a click or a drag goes to that time. The slider is its keyboard path.
import { css } from "./plot_style.js";

export class Overview {
  /** seek: receives the selected time [s]. */
  constructor(canvas, { seek }) {
    this.canvas = canvas;
    this.duration = 0;
    this.rows = [];
    this.changed = true;
    const select = ({ clientX }) => {
      const { left, width } = canvas.getBoundingClientRect();
      seek((this.duration * Math.min(Math.max(clientX - left, 0), width)) / width);
    };
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      select(event);
    });
    canvas.addEventListener("pointermove", (event) => canvas.hasPointerCapture(event.pointerId) && select(event));
    new ResizeObserver(() => (this.changed = true)).observe(canvas);
  }

  setDuration(duration) {
    this.duration = duration;
    this.rows = [];
  }

  /** recording: 0 the shown one, 1 the compared one. */
  setRows(recording, rows) {
    this.rows[recording] = rows;
    this.changed = true;
  }

  draw(t) {
    if (!this.changed && t === this.t) return;
    this.changed = false;
    this.t = t;
    const { canvas } = this, context = canvas.getContext("2d");
    canvas.width = Math.round(canvas.clientWidth * devicePixelRatio);
    canvas.height = Math.round(canvas.clientHeight * devicePixelRatio);
    const { width, height } = canvas;
    const all = this.rows.map((rows) => rows?.columns(0, this.duration, [["force", 1]]) ?? [[], []]);
    const most = all.reduce((high, [, values]) => values.reduce((a, b) => Math.max(a, b ?? 0), high), 1e-3);
    all.forEach(([times, values], number) => {
      context.strokeStyle = css(number === 0 ? "--force" : "--second");
      context.setLineDash(number === 0 ? [] : [4 * devicePixelRatio, 3 * devicePixelRatio]);
      context.lineWidth = devicePixelRatio;
      context.beginPath();
      let pen = false;
      times.forEach((time, i) => {
        if (values[i] === null) return (pen = false);
        const x = (width * time) / this.duration, y = height - 1 - ((height - 2) * values[i]) / most;
        if (pen) context.lineTo(x, y);
        else context.moveTo(x, y);
        pen = true;
      });
      context.stroke();
    });
    context.fillStyle = css("--ink");
    context.fillRect((width * t) / this.duration - devicePixelRatio, 0, 2 * devicePixelRatio, height);
  }
}
