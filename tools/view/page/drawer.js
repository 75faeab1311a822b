// SPDX-License-Identifier: GPL-3.0-or-later
// The drawer sends the user's changes to the running daemon, shows the result or the reason of a rejection, and undoes changes.
import { $, make } from "./elements.js";
import { EventList } from "./event_list.js";
import { RenderingValues, changesText } from "./rendering_values.js";

const REFRESH_INTERVAL_MS = 1000;
const SHOWN = ["rendering.get", "workspace.get", "scene.get", "record.status", "status"];

export class Drawer {
  /** call: calls a method of the daemon; returns a promise of its result. clocks: as for EventList. */
  constructor({ call, clocks }) {
    this.call = call;
    this.undos = [];
    this.values = new RenderingValues({ change: (params) => this.render(params), problem: (text) => this.say(text, true) });
    this.events = new EventList(clocks);
    $("settings").onclick = () => this.toggle();
    $("drawer-close").onclick = () => this.toggle(false);
    $("undo").onclick = () => this.undo();
    $("load").onclick = () => this.load($("scene-file").value.trim());
    $("scale").onchange = () => this.workspace({ scale: $("scale").valueAsNumber });
    $("clutched").onchange = () => this.workspace({ clutched: $("clutched").checked });
    $("recentre").onclick = () => this.workspace({ recentre: true });
    $("record").onclick = () => this.record();
    $("mark-form").onsubmit = (event) => {
      event.preventDefault();
      this.mark();
    };
    setInterval(() => !$("drawer").hidden && this.refresh(), REFRESH_INTERVAL_MS);
  }

  toggle(open = $("drawer").hidden) {
    $("drawer").hidden = !open;
    $("settings").setAttribute("aria-expanded", String(open));
    $(open ? "drawer-close" : "settings").focus();
    if (!open) return;
    this.refresh();
    this.events.show();
  }

  setScenes(names) {
    $("scene-names").replaceChildren(...names.map((value) => make("option", { value })));
  }

  event(event) {
    this.events.add(event);
    if (!$("drawer").hidden) this.events.show();
  }

  /** Says what a request did, or why it was rejected. */
  say(text, bad = false) {
    $("drawer-result").textContent = text;
    $("drawer-result").className = bad ? "problem" : "";
  }

  /** Calls a method and shows what the daemon then holds. Says the reason and returns null if the daemon rejects the call. */
  async request(method, params = {}) {
    let result = null;
    try {
      result = await this.call(method, params);
    } catch (error) {
      this.say(error.message, true);
    }
    if (document.activeElement?.matches("#drawer input[type=number], #drawer input[type=range], #drawer select")) document.activeElement.blur();
    this.refresh();
    return result;
  }

  async refresh() {
    if (this.refreshing) return;
    this.refreshing = true;
    try {
      const [rendering, workspace, scene, recording, status] = await Promise.all(SHOWN.map((method) => this.call(method, {})));
      this.values.show(rendering.settings, status.stiffness_scale);
      this.showWorkspace(workspace);
      this.sceneFile = $("scene-now").textContent = scene.file;
      this.showRecording(recording);
      if (this.lost) this.say("");
      this.lost = false;
    } catch (error) {
      this.lost = true;
      this.say(error.message, true);
    }
    this.refreshing = false;
  }

  /** back: undoes a change; returns a promise of false if the daemon rejects it. */
  remember(text, back) {
    this.undos.push({ text, back });
    this.showUndo();
  }

  async undo() {
    const last = this.undos.pop();
    if (last && !(await last.back())) this.undos.push(last);
    this.showUndo();
  }

  showUndo() {
    const last = this.undos[this.undos.length - 1];
    $("undo").disabled = !last;
    $("undo").title = last ? `undo: ${last.text}` : "";
  }

  async render(params, undoing = false) {
    const result = await this.request("rendering.set", params);
    if (!result) return false;
    const { changed } = result, text = changesText(changed);
    this.say(text === "" ? "Nothing changes: the daemon has this value already." : `${undoing ? "Undone: " : ""}${text}.`);
    if (changed.length > 0 && !undoing)
      this.remember(text, () => this.render(this.values.request(changed.map(({ name, before }) => [name, before])), true));
    return true;
  }

  async load(file, undoing = false) {
    if (file === "") return this.say("Name a scene file, as in scenes/hares.toml.", true);
    const before = this.sceneFile;
    this.say(`Loading ${file} …`);
    if (!(await this.request("scene.load", { file }))) return false;
    this.say(`${undoing ? "Undone: " : "Loaded: "}${file}.`);
    if (!undoing) this.remember(`load ${file}`, () => this.load(before, true));
    return true;
  }

  showWorkspace(workspace) {
    this.present = workspace;
    if (document.activeElement !== $("scale")) $("scale").value = workspace.scale;
    $("clutched").checked = workspace.clutched;
  }

  /** params: one of scale, clutched and recentre. */
  async workspace(params, undoing = false) {
    const before = this.present, [name] = Object.keys(params);
    if (Number.isNaN(params.scale)) return this.say("scale: expected a number from 0.1 to 10.", true);
    const result = await this.request("workspace.set", params);
    if (!result) return false;
    this.say(name === "recentre" ? "The tool is at the handle." : `${undoing ? "Undone: " : ""}${name}: ${result[name]}.`);
    if (name !== "recentre" && !undoing) this.remember(`${name}: ${result[name]}`, () => this.workspace({ [name]: before[name] }, true));
    return true;
  }

  showRecording({ running, failure, directory }) {
    this.recording = running !== null;
    $("record").textContent = running ? "End the recording" : "Record";
    $("mark").disabled = !running;
    $("recording").textContent = running ? `${running.file}: ${running.ticks} ticks${running.lost ? `, ${running.lost} lost` : ""}`
      : failure ?? `not recording; files go to ${directory ?? "the directory of wrenchd.toml"}`;
  }

  async record() {
    const ends = this.recording;
    const result = await this.request(ends ? "record.stop" : "record.start");
    if (result) this.say(ends ? `Recorded ${result.ticks} ticks in ${result.file}.` : `Recording to ${result.file}.`);
  }

  async mark() {
    const label = $("mark-label").value.trim();
    if (label === "") return this.say("Type a label for the marker, as in 'trial 3'.", true);
    if (await this.request("record.mark", { label })) this.say(`Marked: ${label}.`);
  }
}
