// SPDX-License-Identifier: GPL-3.0-or-later
// The values of rendering.get as rows: label, input, unit, and a slider with the stability bound for the values that people tune.
import { $, make } from "./elements.js";

const FIRST = [/\.method$/, /\.law$/, /stiffness/, /damping/, /friction/];  // values outside of "More values", in this order
const SPRING = /^wrench\.(energy_stiffness|stiffness\.)/;                   // values that the stability bound scales

const rounded = (x) => (typeof x === "number" ? String(Number(x.toPrecision(6))) : String(x));
const withUnit = (value, unit) => (unit === "" ? rounded(value) : `${rounded(value)} ${unit}`);
const rank = (name) => FIRST.findIndex((pattern) => pattern.test(name));
/** Returns the name without section and unit: "stiffness, linear" for "wrench.stiffness.linear_N_per_m". */
const readable = (name) => name.replace(/^[a-z]+\./, "").replace(/_(per_s2|N.*|Hz)$/, "").replaceAll("_", " ").replace(".", ", ");
/** Returns the gain of a component; the daemon takes both components of a gain together. */
const gainOf = (name) => /^(.*)\.(linear|angular)_[^.]*$/.exec(name)?.[1];

/** Returns the parameters of rendering.set for values by their dotted names. */
function nested(values) {
  const params = {};
  for (const [name, value] of values) {
    const keys = name.split(".");
    const last = keys.pop();
    let table = params;
    for (const key of keys) table = table[key] ??= {};
    table[last] = value;
  }
  return params;
}

/** Returns the end of a slider: twice the value, at most what the daemon accepts; at most 1 if the value is zero. */
function sliderEnd({ value, expected }) {
  const most = Number(/ to ([0-9.e+]+)/.exec(expected)?.[1] ?? 1);
  return Math.min(value > 0 ? 2 * value : 1, most);
}

/** Returns the result of rendering.set as text: "law: energy to pid". */
export const changesText = (changed) =>
  changed.map(({ name, unit, before, now }) => `${readable(name)}: ${rounded(before)} to ${withUnit(now, unit)}`).join("; ");

export class RenderingValues {
  /** change: receives the parameters of rendering.set; problem: receives the reason why an input is no value. */
  constructor({ change, problem }) {
    this.change = change;
    this.problem = problem;
    this.settings = [];
    this.rows = new Map();
  }

  /** settings: of the result of rendering.get. scale: share of the stiffness that the stability bound leaves, 0 to 1. */
  show(settings, scale) {
    const same = settings.length === this.settings.length && settings.every(({ name }, i) => name === this.settings[i].name);
    this.settings = settings;
    if (!same) this.makeRows();
    for (const setting of settings) this.showValue(setting, scale);
  }

  /** Returns the parameters of rendering.set for pairs of name and value; the other component of a gain keeps its value. */
  request(values) {
    const all = new Map(values);
    const gains = new Set([...all.keys()].map(gainOf));
    for (const { name, value } of this.settings) if (gainOf(name) && gains.has(gainOf(name)) && !all.has(name)) all.set(name, value);
    return nested(all);
  }

  makeRows() {
    this.rows = new Map(this.settings.map((setting) => [setting.name, this.makeRow(setting)]));
    const names = [...this.rows.keys()];
    const elements = (some) => some.sort((a, b) => rank(a) - rank(b)).map((name) => this.rows.get(name).element);
    $("values").replaceChildren(...elements(names.filter((name) => rank(name) >= 0)));
    $("more-values").replaceChildren(...elements(names.filter((name) => rank(name) < 0)));
  }

  makeRow({ name, unit, words, expected }) {
    const id = `value-${name.replaceAll(".", "-")}`;
    const row = { note: make("p", { className: "value-note", id: `${id}-note` }) };
    if (words) {
      row.input = make("select", { id }, ...words.map((word) => make("option", { value: word, textContent: word })));
    } else {
      row.input = make("input", { id, type: "number", step: "any" });
    }
    row.input.title = expected;
    row.input.setAttribute("aria-describedby", row.note.id);
    row.input.onchange = () => this.setValue(name, words ? row.input.value : row.input.valueAsNumber);
    row.element = make("div", { className: "value" }, make("label", { htmlFor: id, textContent: readable(name) }), row.input,
      make("span", { className: "unit", textContent: unit }));
    if (!words && rank(name) >= 0) this.addSlider(row, name);
    row.element.append(row.note);
    return row;
  }

  addSlider(row, name) {
    row.slider = make("input", { type: "range", min: 0, max: 0 });
    row.slider.setAttribute("aria-label", `${readable(name)}, slider`);
    row.slider.oninput = () => (row.input.value = rounded(Number(row.slider.value)));
    row.slider.onchange = () => this.setValue(name, Number(row.slider.value));
    row.bound = make("i", { className: "bound", hidden: true });
    row.element.append(make("div", { className: "slider" }, row.slider, row.bound));
  }

  /** Shows a value, unless the user is changing it. */
  showValue(setting, scale) {
    const { name, value, unit, unused } = setting;
    const row = this.rows.get(name);
    const number = typeof value === "number", matrix = Array.isArray(value);
    const busy = document.activeElement === row.input || document.activeElement === row.slider;
    row.element.classList.toggle("unused", unused !== undefined);
    row.input.disabled = matrix;
    if (!busy && !matrix) row.input.value = rounded(value);
    const bound = SPRING.test(name) && unused === undefined && number && scale < 1 ? scale * value : null;
    if (row.slider && number) {
      if (!busy && (value > Number(row.slider.max) || Number(row.slider.max) === 0)) {
        row.slider.max = sliderEnd(setting);
        row.slider.step = Number(row.slider.max) / 200;
      }
      if (!busy) row.slider.value = value;
      row.bound.hidden = bound === null;
      if (bound !== null) row.bound.style.left = `${Math.min(100, (100 * bound) / Number(row.slider.max))}%`;
    }
    row.note.textContent = matrix ? "a matrix; change it with wrenchctl set" : unused ?? (bound === null ? "" :
      `the stability bound allows ${withUnit(bound, unit)}: ${Math.round(100 * scale)} % is rendered`);
  }

  setValue(name, value) {
    const { expected } = this.settings.find((one) => one.name === name);
    if (typeof value === "number" && !Number.isFinite(value)) return this.problem(`${readable(name)}: expected ${expected}.`);
    this.change(this.request([[name, value]]));
  }
}
