// SPDX-License-Identifier: GPL-3.0-or-later
// The drawer: changes the rendering, the scene, the workspace and the recording of the running daemon, and lists its events.
// Every change of a value or of the scene can be undone.
const REFRESH_INTERVAL_MS = 1000;
const MAX_EVENTS = 200;
const FIRST = [/\.method$/, /\.law$/, /stiffness/, /damping/, /friction/];  // values outside of "More values", in this order
const SPRING = /^wrench\.(energy_stiffness|stiffness\.)/;                   // values that the stability bound scales
const LEVELS = { info: 0, warning: 1, error: 2 };

const $ = (id) => document.getElementById(id);
const make = (tag, properties = {}, ...children) => {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(...children);
  return element;
};
const rounded = (x) => (typeof x === "number" ? String(Number(x.toPrecision(6))) : String(x));
const withUnit = (value, unit) => (unit === "" ? rounded(value) : `${rounded(value)} ${unit}`);
const rank = (name) => FIRST.findIndex((pattern) => pattern.test(name));
/** "wrench.stiffness.linear_N_per_m" is "stiffness, linear" for a reader; the unit stands beside the value. */
const readable = (name) => name.replace(/^[a-z]+\./, "").replace(/_(per_s2|N.*|Hz)$/, "").replaceAll("_", " ").replace(".", ", ");
/** The gain that a component belongs to: the daemon takes both components together. */
const gainOf = (name) => /^(.*)\.(linear|angular)_[^.]*$/.exec(name)?.[1];

/** Parameters of rendering.set for values by their dotted names. */
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

/** The range of a slider: twice the present value, or what the daemon accepts if the value is zero. */
function sliderEnd({ value, expected }) {
  const most = Number(/ to ([0-9.e+]+)/.exec(expected)?.[1] ?? 1);
  return value > 0 ? Math.min(2 * value, most) : Math.min(most, 1);
}

export class Drawer {
  /** call: calls a method of the daemon; returns a promise of its result. clocks: returns the time of the newest tick and of the wall clock [s]. */
  constructor({ call, clocks }) {
    this.call = call;
    this.clocks = clocks;
    this.settings = [];
    this.rows = new Map();
    this.undos = [];
    this.events = [];
    $("settings").onclick = () => this.toggle();
    $("drawer-close").onclick = () => this.toggle(false);
    $("undo").onclick = () => this.undo();
    $("load").onclick = () => this.load($("scene-file").value.trim());
    $("scale").onchange = () => this.workspace({ scale: Number($("scale").value) });
    $("clutched").onchange = () => this.workspace({ clutched: $("clutched").checked });
    $("recentre").onclick = () => this.workspace({ recentre: true });
    $("record").onclick = () => this.record();
    $("mark-form").onsubmit = (event) => {
      event.preventDefault();
      this.mark();
    };
    $("event-level").onchange = $("event-text").oninput = () => this.showEvents();
    setInterval(() => !$("drawer").hidden && this.refresh(), REFRESH_INTERVAL_MS);
  }

  toggle(open = $("drawer").hidden) {
    $("drawer").hidden = !open;
    $("settings").setAttribute("aria-expanded", String(open));
    if (open) {
      this.refresh();
      this.showEvents();
      $("drawer-close").focus();
    } else {
      $("settings").focus();
    }
  }

  setScenes(names) {
    $("scene-names").replaceChildren(...names.map((value) => make("option", { value })));
  }

  /** Says what a request did, or why the daemon rejected it. */
  say(text, bad = false) {
    $("drawer-result").textContent = text;
    $("drawer-result").className = bad ? "problem" : "";
  }

  /** Calls a method; says the reason and returns null if it is rejected. */
  async request(method, params = {}) {
    try {
      return await this.call(method, params);
    } catch (error) {
      this.say(error.message, true);
      return null;
    }
  }

  async refresh() {
    if (this.refreshing) return;
    this.refreshing = true;
    try {
      const [rendering, workspace, scene, recording, status] = await Promise.all(
        ["rendering.get", "workspace.get", "scene.get", "record.status", "status"].map((method) => this.call(method, {})));
      this.showValues(rendering.settings, status.stiffness_scale);
      this.showWorkspace(workspace);
      this.sceneFile = scene.file;
      $("scene-now").textContent = scene.file;
      this.showRecording(recording);
      if (this.wasLost) this.say("");
      this.wasLost = false;
    } catch (error) {
      this.wasLost = true;
      this.say(error.message, true);
    }
    this.refreshing = false;
  }

  // --- values of the rendering ---

  showValues(settings, scale) {
    const same = settings.length === this.settings.length && settings.every(({ name }, i) => name === this.settings[i].name);
    this.settings = settings;
    if (!same) this.makeRows();
    for (const setting of settings) this.showValue(setting, scale);
  }

  makeRows() {
    this.rows.clear();
    const first = [], others = [];
    for (const setting of this.settings) {
      const row = this.makeRow(setting);
      this.rows.set(setting.name, row);
      (rank(setting.name) < 0 ? others : first).push([rank(setting.name), row.element]);
    }
    const elements = (rows) => rows.sort(([a], [b]) => a - b).map(([, element]) => element);
    $("values").replaceChildren(...elements(first));
    $("more-values").replaceChildren(...elements(others));
  }

  makeRow({ name, unit, words, expected }) {
    const id = `value-${name.replaceAll(".", "-")}`;
    const row = { note: make("p", { className: "value-note", id: `${id}-note` }) };
    if (words) {
      row.input = make("select", { id }, ...words.map((word) => make("option", { value: word, textContent: word })));
    } else {
      row.input = make("input", { id, type: "number", step: "any" });
      if (rank(name) >= 0) {
        row.slider = make("input", { type: "range", min: 0 });
        row.slider.setAttribute("aria-label", `${readable(name)}, slider`);
        row.slider.oninput = () => (row.input.value = rounded(Number(row.slider.value)));
        row.slider.onchange = () => this.setValue(name, Number(row.slider.value));
        row.bound = make("i", { className: "bound", hidden: true });
      }
    }
    row.input.title = expected;
    row.input.setAttribute("aria-describedby", row.note.id);
    row.input.onchange = () => this.setValue(name, words ? row.input.value : row.input.valueAsNumber);
    row.element = make("div", { className: "value" }, make("label", { htmlFor: id, textContent: readable(name) }), row.input,
      make("span", { className: "unit", textContent: unit }));
    if (row.slider) row.element.append(make("div", { className: "slider" }, row.slider, row.bound));
    row.element.append(row.note);
    return row;
  }

  showValue(setting, scale) {
    const { name, value, unit, unused } = setting;
    const row = this.rows.get(name);
    const number = typeof value === "number";
    const isMatrix = Array.isArray(value);
    row.element.classList.toggle("unused", unused !== undefined);
    row.input.disabled = isMatrix;
    const busy = document.activeElement === row.input || document.activeElement === row.slider;
    if (!busy && !isMatrix) row.input.value = number ? rounded(value) : value;
    const bound = SPRING.test(name) && unused === undefined && number && scale < 1 ? scale * value : null;
    if (row.slider && number) {
      if (!busy && !(value <= Number(row.slider.max) && row.shown === name)) {
        row.slider.max = sliderEnd(setting);
        row.slider.step = Number(row.slider.max) / 200;
        row.shown = name;
      }
      if (!busy) row.slider.value = value;
      row.bound.hidden = bound === null;
      if (bound !== null) row.bound.style.left = `${Math.min(100, (100 * bound) / Number(row.slider.max))}%`;
    }
    row.note.textContent = isMatrix ? "a matrix; change it with wrenchctl set" : unused ?? (bound === null ? "" :
      `the stability bound allows ${withUnit(bound, unit)}: ${Math.round(100 * scale)} % is rendered`);
  }

  /** The values of rendering.set: the new ones, and for gains the component that stays. */
  completed(values) {
    const all = new Map(values);
    for (const { name, value } of this.settings) {
      const gain = gainOf(name);
      if (gain && !all.has(name) && [...all.keys()].some((one) => gainOf(one) === gain)) all.set(name, value);
    }
    return nested(all);
  }

  async setValue(name, value) {
    const { expected } = this.settings.find((one) => one.name === name);
    if (typeof value === "number" && !Number.isFinite(value)) return this.say(`${readable(name)}: expected ${expected}.`, true);
    await this.change("rendering.set", this.completed([[name, value]]));
  }

  async change(method, params, undoing = false) {
    const result = await this.request(method, params);
    if (result) {
      const { changed } = result;
      const text = changed.map(({ name, unit, before, now }) => `${readable(name)}: ${withUnit(before, "")} to ${withUnit(now, unit)}`).join("; ");
      if (changed.length > 0 && !undoing)
        this.remember(text, () => this.change("rendering.set", this.completed(changed.map(({ name, before }) => [name, before])), true));
      this.say(text === "" ? "Nothing changes: the value was the same." : `${undoing ? "Undone: " : ""}${text}.`);
    }
    if (document.activeElement?.closest("#values, #more-values")) document.activeElement.blur();
    this.refresh();
  }

  // --- undo ---

  remember(text, back) {
    this.undos.push({ text, back });
    this.showUndo();
  }

  async undo() {
    const last = this.undos.pop();
    this.showUndo();
    if (last) await last.back();
  }

  showUndo() {
    const last = this.undos[this.undos.length - 1];
    $("undo").disabled = !last;
    $("undo").title = last ? `undo: ${last.text}` : "";
  }

  // --- scene, workspace, recording ---

  async load(file, undoing = false) {
    if (file === "") return this.say("Name a scene file, as in scenes/hares.toml.", true);
    const before = this.sceneFile;
    this.say(`Loading ${file} …`);
    const result = await this.request("scene.load", { file });
    if (result) {
      if (before && !undoing) this.remember(`scene ${before}`, () => this.load(before, true));
      this.say(`${undoing ? "Undone" : "Loaded"}: ${file}.`);
    }
    this.refresh();
  }

  showWorkspace({ scale, clutched }) {
    this.present = { scale, clutched };
    if (document.activeElement !== $("scale")) $("scale").value = rounded(scale);
    $("clutched").checked = clutched;
  }

  async workspace(params, undoing = false) {
    const before = this.present;
    const result = await this.request("workspace.set", params);
    if (result) {
      const [name] = Object.keys(params);
      if (name !== "recentre" && !undoing) this.remember(`${name} ${before[name]}`, () => this.workspace({ [name]: before[name] }, true));
      this.say(name === "recentre" ? "The tool is at the handle." : `${undoing ? "Undone: " : ""}${name}: ${rounded(result[name])}.`);
    }
    if (document.activeElement === $("scale")) $("scale").blur();
    this.refresh();
  }

  showRecording({ running, failure, directory }) {
    this.recording = running;
    $("record").textContent = running ? "End the recording" : "Record";
    $("mark").disabled = !running;
    $("recording").textContent = running ? `${running.file}: ${running.ticks} ticks${running.lost ? `, ${running.lost} lost` : ""}`
      : failure ?? `not recording; files go to ${directory ?? "the directory of wrenchd.toml"}`;
  }

  async record() {
    const result = await this.request(this.recording ? "record.stop" : "record.start");
    if (result) this.say(this.recording ? `Recorded ${result.ticks} ticks in ${result.file}.` : `Recording to ${result.file}.`);
    this.refresh();
  }

  async mark() {
    const label = $("mark-label").value.trim();
    if (label === "") return this.say("Type a label for the marker, as in 'trial 3'.", true);
    if (await this.request("record.mark", { label })) this.say(`Marked: ${label}.`);
  }

  // --- events ---

  event(event) {
    this.events.unshift(event);
    this.events.length = Math.min(this.events.length, MAX_EVENTS);
    if (!$("drawer").hidden) this.showEvents();
  }

  showEvents() {
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
