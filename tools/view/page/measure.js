// SPDX-License-Identifier: GPL-3.0-or-later
// Draws the measures of the picture: the axes of the world as the camera sees them, and a length with the force whose arrow has it.
import { $ } from "./elements.js";

const AXIS_LENGTH = 20, LETTER_AT = 27;  // in units of the drawing
const HIDDEN_BELOW = 0.15;               // an axis along the line of sight has no letter

const digits = (x, count) => Number(x.toPrecision(count));

function lengthText(length_m) {
  if (length_m >= 1) return `${length_m} m`;
  return length_m >= 1e-3 ? `${digits(1e3 * length_m, 1)} mm` : `${digits(1e6 * length_m, 1)} um`;
}

function showAxis(name, x, y, away) {
  const axis = document.querySelector(`#triad [data-axis="${name}"]`);
  const [line, letter] = axis.children;
  line.setAttribute("x2", AXIS_LENGTH * x);
  line.setAttribute("y2", AXIS_LENGTH * y);
  letter.setAttribute("x", LETTER_AT * x);
  letter.setAttribute("y", LETTER_AT * y);
  letter.style.opacity = Math.hypot(x, y) < HIDDEN_BELOW ? 0 : 1;
  axis.style.opacity = away ? 0.6 : 1;
}

export function showMeasure(world) {
  const { right, up, forward } = world.screenAxes();
  ["x", "y", "z"].forEach((name, i) => showAxis(name, right[i], -up[i], forward[i] > 0.3));
  const { length_m, width_px, force_N } = world.scale();
  $("scale-text").textContent = `${lengthText(length_m)}; force arrows ${digits(force_N, 2)} N`;
  $("scale-line").style.width = `${width_px.toFixed(0)}px`;
}
