// SPDX-License-Identifier: GPL-3.0-or-later
// Labels of the ticks of an axis: always different from each other, also if the range is small beside its values.

const MOST_CHARACTERS = 7;  // of a label, in the width of an axis

const exponential = (x) => (x === 0 ? "0" : x.toExponential(2).replace(/\.?0+e/, "e").replace("e+", "e"));

/** Returns a number with the digits that an interval between ticks needs. */
function decimal(x, interval) {
  const digits = Math.max(0, -Math.floor(Math.log10(interval) + 1e-9));
  const text = digits > 100 ? exponential(x) : x.toFixed(digits);
  return Number(text) === 0 ? "0" : text;
}

/**
 * Returns the labels of ascending ticks. If no short labels differ, the first one is the value, rounded, and the others are
 * differences from it with a sign: "4.2", "+1e-9", "+2e-9".
 */
export function axisLabels(ticks) {
  if (ticks.length < 2) return ticks.map((x) => String(Number(x.toPrecision(4))));
  const interval = ticks[1] - ticks[0];
  const distinct = (labels) => new Set(labels).size === labels.length && labels.every((one) => one.length <= MOST_CHARACTERS);
  const plain = ticks.map((x) => decimal(x, interval));
  if (distinct(plain)) return plain;
  const short = ticks.map((x) => exponential(Math.abs(x) < interval / 2 ? 0 : x));
  if (distinct(short)) return short;
  return ticks.map((x, i) => (i === 0 ? String(Number(x.toPrecision(4))) : `+${exponential(Number((x - ticks[0]).toPrecision(3)))}`));
}

/** Returns a time as the ticks of a time axis need it: "2.5 s", "1:30". */
export function timeText(t_s, interval_s) {
  const sign = t_s < 0 ? "-" : "", t = Math.abs(t_s);
  if (t < 60 || interval_s < 1) return `${sign}${decimal(t, Math.min(interval_s, 1))} s`;
  const minutes = Math.floor(t / 60 + 1e-9), seconds = Math.round(t - 60 * minutes);
  return `${sign}${minutes}:${String(seconds).padStart(2, "0")}`;
}
