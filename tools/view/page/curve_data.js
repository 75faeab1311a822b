// SPDX-License-Identifier: GPL-3.0-or-later
// Curves as rows of minimum and maximum per bucket of time: the history of a live signal, and columns of a recording.

export const CHANNELS = ["force_x", "force_y", "force_z", "force", "torque_x", "torque_y", "torque_z", "torque", "energy", "depth", "angle"];
const WIDTH = 1 + 2 * CHANNELS.length;  // numbers in a row: time, then minimum and maximum of each channel
const GAP_s = 0.1;                      // ticks that are further apart are not connected

/**
 * The levels of the live history. Each bucket of a coarse level has the extremes of the fine buckets in it; so ten minutes
 * need about 4 MB, and a plot of ten minutes draws about a thousand buckets.
 */
const LEVELS = [{ bucket_s: 0.01, kept_s: 70 }, { bucket_s: 0.06, kept_s: 660 }, { bucket_s: 0.6, kept_s: 660 }];
const MOST_ROWS = 1200;  // of a plot

/** Rows in ascending time. */
export class Rows {
  constructor(numbers = new Float64Array(0), rows = 0, spacing_s = 0) {
    this.numbers = numbers;
    this.rows = rows;
    this.spacing_s = spacing_s;
  }

  time(i) {
    return this.numbers[i * WIDTH];
  }

  /** Returns the number of the first row at this time or later. */
  index(t) {
    let low = 0, high = this.rows;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.time(middle) < t) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  /** Returns times and channels, each multiplied by its factor, as uPlot takes them: null where the data has a gap. */
  columns(from, to, wanted) {
    const times = [], values = wanted.map(() => []);
    const first = Math.max(this.index(from) - 1, 0), last = Math.min(this.index(to) + 1, this.rows);
    const gap = Math.max(GAP_s, 3 * this.spacing_s);
    const at = wanted.map(([name, factor]) => [1 + 2 * CHANNELS.indexOf(name), factor]);
    const push = (t, value) => {
      times.push(t);
      values.forEach((all, k) => all.push(value(k)));
    };
    for (let i = first; i < last; ++i) {
      const row = i * WIDTH, t = this.numbers[row];
      const next = i + 1 < last ? this.numbers[row + WIDTH] : t + 2 * this.spacing_s;
      const half = Math.min(next - t, gap) / 2;
      const number = (k, side) => {
        const x = this.numbers[row + at[k][0] + side] * at[k][1];
        return Number.isNaN(x) ? null : x;
      };
      push(t, (k) => number(k, 0));
      if (half > 0 && at.some(([c]) => this.numbers[row + c] !== this.numbers[row + c + 1])) push(t + half, (k) => number(k, 1));
      if (next - t > gap) push(t + 0.75 * gap, () => null);
    }
    return [times, ...values];
  }

  /** Returns the minimum and the maximum of a channel in the row at this time; null if there is none. */
  valueAt(channel, t) {
    const i = this.index(t + 1e-9) - 1;
    if (i < 0 || t - this.time(i) > Math.max(GAP_s, 3 * this.spacing_s)) return null;
    const at = i * WIDTH + 1 + 2 * CHANNELS.indexOf(channel);
    return Number.isNaN(this.numbers[at]) ? null : [this.numbers[at], this.numbers[at + 1]];
  }

  /** Returns the extremes of a channel in a range; null if it has no value there. */
  extremes(channel, from, to) {
    const at = 1 + 2 * CHANNELS.indexOf(channel);
    let low = Infinity, high = -Infinity;
    for (let i = this.index(from); i < this.rows && this.time(i) <= to; ++i) {
      const a = this.numbers[i * WIDTH + at], b = this.numbers[i * WIDTH + at + 1];
      if (a < low) low = a;
      if (b > high) high = b;
    }
    return high < low ? null : [low, high];
  }
}

/** Rows with a limit of their age; the memory is bounded by it. */
class Level extends Rows {
  constructor({ bucket_s, kept_s }) {
    const capacity = Math.ceil((1.25 * kept_s) / bucket_s);
    super(new Float64Array(capacity * WIDTH), 0, bucket_s);
    this.kept_s = kept_s;
  }

  add(row) {
    const number = Math.floor(row[0] / this.spacing_s + 1e-6);
    if (this.rows > 0 && number === this.number) return this.merge(row);
    this.number = number;
    if ((this.rows + 1) * WIDTH > this.numbers.length) {
      const old = Math.max(this.index(row[0] - this.kept_s), 1);
      this.numbers.copyWithin(0, old * WIDTH, this.rows * WIDTH);
      this.rows -= old;
    }
    this.numbers.set(row, this.rows++ * WIDTH);
  }

  merge(row) {
    const last = (this.rows - 1) * WIDTH;
    for (let k = 1; k < WIDTH; ++k) {
      const now = this.numbers[last + k], x = row[k];
      if (Number.isNaN(now) || (k % 2 === 1 ? x < now : x > now)) this.numbers[last + k] = x;
    }
  }

  copy() {
    return new Rows(this.numbers.slice(0, this.rows * WIDTH), this.rows, this.spacing_s);
  }
}

/** The received history of a live signal, ten minutes at most. */
export class History {
  constructor() {
    this.clear();
  }

  clear() {
    this.levels = LEVELS.map((level) => new Level(level));
  }

  add({ reset, rows, width, numbers }) {
    if (reset) this.clear();
    for (let i = 0; i < rows; ++i) {
      const row = numbers.subarray(i * width, (i + 1) * width);
      for (const level of this.levels) level.add(row);
    }
  }

  /** Returns the finest rows that cover the range and are few enough to draw. */
  rowsFor(from, to) {
    return this.levels.find((level) => (to - from) / level.spacing_s <= MOST_ROWS && (level.rows === 0 || level === this.levels.at(-1) ||
      level.time(0) <= from + level.spacing_s || level.time(0) <= this.levels.at(-1).time(0) + level.spacing_s)) ?? this.levels.at(-1);
  }

  /** Returns the history as it is now; what arrives later does not change it. */
  frozen() {
    const copy = new History();
    copy.levels = this.levels.map((level) => level.copy());
    return copy;
  }
}
