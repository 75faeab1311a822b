// SPDX-License-Identifier: GPL-3.0-or-later
// The events of the daemon since the page was opened, newest first, filtered by level and text.
import { $, make } from "./elements.js";

const MAX_EVENTS = 200;
const LEVELS = { info: 0, warning: 1, error: 2 };

export class EventList {
  /** clocks: returns {tick_s, wall_s}: time of the newest tick [s], null before the first one, and the wall clock [s]. */
  constructor(clocks) {
    this.clocks = clocks;
    this.events = [];
    $("event-level").onchange = $("event-text").oninput = () => this.show();
  }

  add(event) {
    this.events.unshift(event);
    this.events.length = Math.min(this.events.length, MAX_EVENTS);
  }

  show() {
    const least = LEVELS[$("event-level").value], wanted = $("event-text").value.trim().toLowerCase();
    const { tick_s, wall_s } = this.clocks();
    const shown = this.events.filter(({ level, text, name }) => LEVELS[level] >= least && `${name} ${text}`.toLowerCase().includes(wanted));
    $("event-list").replaceChildren(...shown.map(({ time_ns, level, text, fault }) => {
      const at = tick_s === null ? "" : new Date(1e3 * (wall_s - tick_s + 1e-9 * time_ns)).toTimeString().slice(0, 8);
      const line = make("li", {}, make("time", { textContent: at }), ` ${text}`);
      line.dataset.level = level;
      if (fault?.cure && !text.includes(fault.cure)) line.append(make("span", { className: "remedy", textContent: fault.cure }));
      return line;
    }));
    $("no-events").hidden = shown.length > 0;
  }
}
