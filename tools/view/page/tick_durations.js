// SPDX-License-Identifier: GPL-3.0-or-later
// The histogram of tick durations and wake latencies beside their deadline.
import uPlot from "uplot";
import { axis, css, sizeOf } from "./plot_style.js";

/** Histogram with logarithmic bins from 1 us, 12 per decade. */
export class TickDurations {
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
