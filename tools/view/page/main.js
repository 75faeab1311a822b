// SPDX-License-Identifier: GPL-3.0-or-later
// The page of wrenchctl view: shows incoming messages and sends the requests of the user.
import { Connection } from "./connection.js";
import { ToolDrag } from "./drag.js";
import { Drawer } from "./drawer.js";
import { $ } from "./elements.js";
import { GamepadDrag } from "./gamepad.js";
import { showMeasure } from "./measure.js";
import { Rows } from "./curve_data.js";
import { Overview } from "./overview.js";
import { Plots } from "./plots.js";
import { World } from "./world.js";

const root = document.documentElement;
const PLOT_INTERVAL_MS = 50;
const HEARTBEAT_INTERVAL_MS = 100;
const DRAW_TIMEOUT_MS = 2000;
const STATES = { gone: "connection lost" };
const ARMED = ["waiting", "ramping", "active", "degraded"];

const world = new World($("canvas"));
const plots = new Plots({ seek: (t) => select(t) });
const overview = new Overview($("overview"), { seek: (t) => select(t) });

let mode = "none";
let page = 0;
let faults = {};
let frame = null;
let link = null;
let rate_Hz = 0;
let lastFault = null;
let waits = null;  // the last event that says what the loop waits for
let times = null;
let connected = false;
let sceneTriangles = 0;

const set = (id, text) => {
  const element = $(id);
  if (element.textContent !== text) element.textContent = text;
};
/** Makes a sentence of a table text, which has no capital and no full stop. */
const sentence = (text) => (text === "" ? "" : text[0].toUpperCase() + text.slice(1) + (/[.!?]$/.test(text) ? "" : "."));
const fixed = (x, digits) => (x === null || x === undefined ? "–" : x.toFixed(digits));
const length3 = ([x, y, z]) => Math.hypot(x, y, z);
const ago = (s) => (s < 100 ? `${s.toFixed(0)} s` : s < 6000 ? `${(s / 60).toFixed(0)} min` : `${(s / 3600).toFixed(1)} h`);
const running = (tick) => (rate_Hz > 0 ? `running for ${ago(tick / rate_Hz)}` : "–");
const readable = (name) => name.replaceAll("_", " ");

// --- display ---

function showState(state) {
  const chip = $("state");
  set("state", STATES[state] ?? readable(state));
  if (chip.dataset.state !== state) chip.dataset.state = state;
}

function showFrame(now) {
  const { F } = now;
  set("force", fixed(length3(F.slice(0, 3)), 2));
  set("torque", fixed(1e3 * length3(F.slice(3)), 1));
  set("depth", now.depth_m === null ? "–" : fixed(1e3 * now.depth_m, 3));
  set("angle", now.angle_rad === null ? "–" : fixed((180 / Math.PI) * now.angle_rad, 2));
  set("energy", now.energy === null ? "–" : fixed(1e6 * now.energy, 3));
  set("authority", fixed(100 * now.authority, 0));
  set("contacts", String(now.contact_count));
  set("time", mode === "recording" ? `${now.t.toFixed(3)} s` : running(now.tick));
  set("tick", String(now.tick) + (now.missed ? `, ${now.missed} missed` : ""));
  set("proxy-initialization", readable(now.proxy_initialization));
  set("limits", now.limits === "" ? "none" : now.limits);
  showContacts(now.contacts);
  $("no-contact-list").hidden = now.contacts.length > 0 || now.contact_count === 0;
  if (mode === "recording" || connected) showState(now.state);
  showCause(now);
  if (mode === "recording") showPlayer(now);
}

function showContacts(contacts) {
  const body = $("contacts-held").tBodies[0];
  while (body.rows.length > contacts.length) body.deleteRow(-1);
  while (body.rows.length < contacts.length) {
    const row = body.insertRow();
    for (let i = 0; i < 5; ++i) row.insertCell();
    const meter = document.createElement("meter");
    meter.max = 1;
    row.cells[0].append(meter, document.createElement("span"));
  }
  contacts.forEach(({ load_fraction, force_N, obstacle, tool, on }, i) => {
    const [cell, ...others] = body.rows[i].cells;
    cell.firstChild.value = load_fraction ?? 0;
    cell.lastChild.textContent = ` ${fixed(100 * (load_fraction ?? 0), 0)} %`;
    [`${fixed(force_N, 2)} N`, obstacle, tool, on].forEach((text, k) => {
      if (others[k].textContent !== text) others[k].textContent = text;
    });
  });
}

function showBanner(level, title, message, remedy) {
  $("banner").hidden = false;
  $("banner").dataset.level = level;
  set("banner-title", title);
  set("banner-message", message);
  set("banner-remedy", remedy);
}

/** Shows the present cause of a fault or stop, if any. */
function showCause(now) {
  if (mode === "live" && !connected) return;
  const cause = now.cause;
  const bad = now.state === "fault" || now.state === "stopped" || now.state === "degraded" || now.state === "disconnected";
  const waiting = now.state === "waiting" || now.state === "self_test";
  if (!waiting) waits = null;
  if (waiting && waits && mode === "live") {
    showBanner("warn", now.state === "waiting" ? "No force yet" : "Self-test", sentence(link?.status?.no_force ?? waits.text), "");
  } else if (cause === "none" || !bad) {
    $("banner").hidden = true;
  } else {
    const known = faults[cause] ?? link?.status?.cause ?? { message: "", cure: "" };
    const stopped = now.state === "stopped";
    const cure = sentence(known.cure) + (stopped && mode === "live" && !/cknowledge/.test(known.cure) ? " Then acknowledge." : "");
    const before = mode === "live" && link?.status?.before_cause?.[0];
    const message = sentence(known.message) + (before ? ` Before it: ${sentence(`${before.message}: ${before.cure}`)}` : "");
    showBanner(now.state === "degraded" ? "warn" : "bad", stopped ? "Stopped" : `Fault: ${readable(cause)}`, message, cure);
  }
  // The daemon says when the fault was raised, on the clock of the ticks. The page may have been opened later.
  if (mode === "live") {
    const fault = link?.status?.last_fault;
    lastFault = fault ? { cause: fault.name, t: 1e-9 * fault.time_ns } : null;
  }
  if (mode === "recording") {
    lastFault = lastFaultAt(now.t);
    showMarkerAt(now.t);
  }
  if (lastFault) {
    const known = faults[lastFault.cause];
    const when = mode === "recording" ? `at ${lastFault.t.toFixed(2)} s` : `${ago(Math.max(now.t - lastFault.t, 0))} ago`;
    set("last-fault", `${readable(lastFault.cause)}, ${when}` + (known ? `: ${known.message}; ${known.cure}` : ""));
  } else {
    set("last-fault", mode === "recording" ? "none until now" : "none");
  }
}

function showLink() {
  connected = link.connected;
  if (!connected) {
    showState("gone");
    showBanner("bad", "No connection to wrenchd", link.error, frame ? "The page shows the last received data." : "");
    set("about", "");
  }
  showButtons();  // immediately, not with the next frame
  const status = link.status;
  if (!status) return;
  const percent = status.limits.authority < 1 ? `, ${Math.round(100 * status.limits.authority)} % applied, because the device has no watchdog` : "";
  set("about", `${status.scene.file.split("/").pop().replace(/\.toml$/, "").replaceAll("_", " ")} · ` +
    `${status.device.profile}${status.device.simulated ? ", simulated" : ""} · ${status.rates.rate_Hz} Hz`);
  $("about").title = status.scene.file;
  set("force-limits", `${status.limits.max_force_N} N, ${status.limits.max_torque_Nm} N·m${percent}`);
  set("armed-by", status.armed_by ?? "–");
  set("device", status.device.present ? "present" : "absent");
}

function showButtons() {
  const state = connected ? frame?.state : "";
  $("arm").disabled = state !== "disarmed";
  $("disarm").disabled = !ARMED.includes(state);
  $("acknowledge").disabled = state !== "fault" && state !== "stopped";
  $("stop").disabled = !connected;
}

function showTimes() {
  const line = ({ p50_us, p99_9_us, max_us }) => `p50 ${p50_us.toFixed(0)} · p99.9 ${p99_9_us.toFixed(0)} · max ${max_us.toFixed(0)} us`;
  set("times-duration", line(times.tick_duration));
  set("times-late", line(times.wake_latency));
  plots.drawTimes(times, rate_Hz > 0 ? 1e6 / rate_Hz : 0);
}

function showTriangleCount() {
  if (sceneTriangles === 0) return;
  const shown = world.triangles();
  set("note", shown < sceneTriangles ? `${sceneTriangles.toLocaleString("en")} triangles, drawn with ${shown.toLocaleString("en")}` : "");
}

let toastEnds = 0;
function toast(text) {
  $("toast").hidden = false;
  set("toast", text);
  toastEnds = performance.now() + 6000;
}

// --- playback of a recording ---

const player = { duration: 0, t: 0, playing: false, requested: false, changes: [], markers: [] };

/** Returns a marker as one line: its label and its conditions. */
function markerText({ label, conditions }) {
  const set = Object.entries(conditions ?? {}).map(([name, value]) => `${name} ${value}`).join(", ");
  return set === "" ? label : `${label} (${set})`;
}

function showMarkerAt(t) {
  const before = player.markers.filter((one) => one.t <= t);
  const last = before[before.length - 1];
  set("marker", last ? `${markerText(last)}, at ${last.t.toFixed(2)} s` : "none until now");
}

function lastFaultAt(t) {
  let last = null;
  for (const one of player.changes) if (one.t <= t && one.cause !== "none") last = { cause: one.cause, t: one.t };
  return last;
}

function showMarks() {
  $("marks").replaceChildren(...player.changes.map(({ t, state }, i) => {
    const mark = document.createElement("i");
    const end = player.changes[i + 1]?.t ?? player.duration;
    mark.dataset.state = state;
    mark.style.left = `${(100 * t) / player.duration}%`;
    mark.style.width = `${(100 * (end - t)) / player.duration}%`;
    return mark;
  }), ...player.markers.map((marker) => {
    const mark = document.createElement("b");
    mark.style.left = `${(100 * marker.t) / player.duration}%`;
    mark.title = markerText(marker);
    return mark;
  }));
}

function showPlayer() {
  set("play-time", `${player.t.toFixed(3)} s`);
  set("play", player.playing ? "Pause" : "Play");
  if (document.activeElement !== $("scrub") || player.playing) $("scrub").value = player.t;
}

/** Requests one frame at a time, so that a slow machine skips frames and shows no delay. */
function seek(t) {
  player.t = Math.min(Math.max(t, 0), player.duration);
  player.stale = true;
}

/** Goes to a time that the user has selected, and pauses. */
function select(t) {
  play(false);
  seek(t);
}

/** Requests the curves of the plots' window, one request at a time. */
function requestColumns() {
  const range = plots.request(), key = range.join();
  if (player.columnsRequested || key === player.columnsKey) return;
  player.columnsRequested = true;
  player.columnsKey = key;
  connection.send("plot", { range });
}

function requestFrame() {
  if (player.requested || !player.stale) return;
  player.requested = true;
  player.stale = false;
  connection.send("at", { t: player.t });
}

function play(on) {
  if (on && player.t >= player.duration) seek(0);
  player.playing = on;
  showPlayer();
}

// --- incoming messages ---

const connection = new Connection({
  hello(hello) {
    mode = root.dataset.mode = hello.mode;
    page = hello.page;
    faults = hello.faults;
    document.title = mode === "live" ? "wrenchd" : `${hello.name} – wrenchd`;
    if (mode !== "recording") return drawer.setScenes(hello.scenes);
    connected = true;
    rate_Hz = hello.rate_Hz;
    Object.assign(player, { duration: hello.duration_s, changes: hello.changes, markers: hello.markers, requested: false,
      columnsRequested: false, columnsKey: "", compared: hello.compared });
    plots.showRecording(hello.name, hello.duration_s, hello.compared?.name);
    overview.setDuration(hello.duration_s);
    $("key-second").hidden = !hello.compared;
    if (hello.compared) set("key-second", `${hello.compared.name}${hello.compared.same_scene ? "" : " (another scene)"}`);
    $("scrub").max = hello.duration_s;
    set("play-end", `${hello.duration_s.toFixed(3)} s`);
    set("about", `${hello.name} · recorded by wrenchd ${hello.recorded_by} · ${Math.round(rate_Hz)} Hz`);
    showMarks();
    seek(player.t);
  },
  link(message) {
    link = message;
    if (link.rate_Hz > 0) rate_Hz = link.rate_Hz;
    showLink();
  },
  mesh: (mesh) => world.mesh(mesh),
  scene(scene) {
    world.show(scene);
    sceneTriangles = scene.meshes.reduce((all, { triangles }) => all + triangles, 0);
    $("note").className = "";
    showTriangleCount();
    if (frame) world.take(frame);
  },
  no_scene({ error }) {
    sceneTriangles = 0;
    $("note").className = error === "" ? "" : "problem";
    set("note", error === "" ? "" : `The scene cannot be shown: ${error}`);
  },
  history: (message) => plots.history.add(message),
  columns({ recording, from, to, rows, numbers }) {
    if (recording === (player.compared ? 1 : 0)) player.columnsRequested = false;
    plots.setColumns(recording, new Rows(numbers, rows, (to - from) / Math.max(plots.request()[2], 2)));
  },
  overview: ({ recording, rows, numbers }) => overview.setRows(recording, new Rows(numbers, rows)),
  frame(now) {
    frame = now;
    player.requested = false;
    if (mode === "recording" && !player.playing) player.t = Math.min(player.t, player.duration);
    world.take(now);
  },
  times(now) {
    times = now;
    showTimes();
  },
  event({ event }) {
    drawer.event(event);
    if (event.name === "arming_rejected" || event.name === "reload") toast(event.text);
    if (event.name === "waits") waits = event;
    if (event.name === "marker") set("marker", markerText(event));
    if (event.name === "fault" && event.fault) lastFault = { cause: event.fault.name, t: 1e-9 * event.time_ns };
  },
  reply({ request, accepted, error }) {
    if (!accepted && request === "hand") {
      toolDrag.end();
      gamepadDrag.reject();
    }
    if (!accepted && error !== "") toast(request === "lease" ? error : `${request}: ${error}`);
  },
  lost() {
    connected = false;
    player.requested = false;
    showState("gone");
    showBanner("bad", "No connection to wrenchctl view", "The program that serves this page has ended or does not respond.",
      "Start wrenchctl view again and open the address that it prints. The page shows the last received data.");
    showButtons();
  },
});

// --- buttons, keys and mouse ---

const hand = {
  handPose: () => (mode === "live" && connected && link.status?.device.simulated ? frame?.hand ?? null : null),
  send: (goal) => connection.send("hand", goal),
};
const toolDrag = new ToolDrag(world, hand);
const gamepadDrag = new GamepadDrag(world, hand);

const drawer = new Drawer({
  call: (method, params) => connection.call(method, params),
  clocks: () => ({ tick_s: frame?.t ?? null, wall_s: Date.now() / 1e3 }),
});

const request = (name) => mode === "live" && connection.send(name);
$("arm").onclick = () => request("arm");
$("disarm").onclick = () => request("disarm");
$("acknowledge").onclick = () => request("acknowledge");
$("stop").onclick = () => request("stop");
$("fit").onclick = () => world.fit(frame?.p);
const look = (from) => world.fit(frame?.p, from);
const follow = (on) => {
  world.follow(on);
  $("follow").setAttribute("aria-pressed", String(on));
};
const toggleFollow = () => follow($("follow").getAttribute("aria-pressed") !== "true");
for (const from of ["top", "front", "side"]) $(`view-${from}`).onclick = () => look(from);
$("follow").onclick = toggleFollow;
$("help").onclick = () => $("keys").showModal();
$("play").onclick = () => play(!player.playing);
$("scrub").oninput = () => select(Number($("scrub").value));

const THEMES = ["auto", "light", "dark"];
function theme(name) {
  root.dataset.theme = name;
  set("theme", `Theme: ${name}`);
  try {
    localStorage.setItem("theme", name);
  } catch { /* the browser has no storage */ }
  world.recolour();
  plots.recolour();
  overview.changed = true;
}
const nextTheme = () => theme(THEMES[(THEMES.indexOf(root.dataset.theme) + 1) % THEMES.length]);
$("theme").onclick = nextTheme;
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => theme(root.dataset.theme));
try {
  theme(THEMES.find((name) => name === localStorage.getItem("theme")) ?? "auto");
} catch {
  theme("auto");
}

const common = {
  f: () => world.fit(frame?.p),
  g: () => {
    world.showGhost = !world.showGhost;
    if (frame) world.take(frame);
  },
  1: () => look("top"),
  2: () => look("front"),
  3: () => look("side"),
  l: toggleFollow,
  p: () => plots.pause(),
  y: () => plots.toggleFit(),
  "+": () => plots.zoom(0.5),
  "-": () => plots.zoom(2),
  0: () => plots.release(),
  t: nextTheme,
  "?": () => ($("keys").open ? $("keys").close() : $("keys").showModal()),
};
const keys = {
  live: { " ": () => request("stop"), Escape: () => request("stop"), a: () => !$("arm").disabled && request("arm"),
    d: () => request("disarm"), s: () => drawer.toggle(), k: () => !$("acknowledge").disabled && request("acknowledge") },
  recording: { " ": () => play(!player.playing), ArrowLeft: (e) => seek(player.t - (e.shiftKey ? 1 : 0.1)),
    ArrowRight: (e) => seek(player.t + (e.shiftKey ? 1 : 0.1)), ",": () => seek(player.t - 1 / rate_Hz),
    ".": () => seek(player.t + 1 / rate_Hz), Home: () => seek(0), End: () => seek(player.duration) },
  none: {},
};
// In the capture phase, so that the stop key works independent of the focus.
addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.altKey || event.metaKey) return;
  const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
  // While text is typed, its letters and spaces are text.
  if (event.target.matches("input:not([type=range], [type=checkbox])") && key !== "Escape") return;
  if (event.target.id === "plot-cursor" && /^(Arrow|Page|Home|End)/.test(key)) return;  // its own keys
  if (event.target.id === "plot-cursor" && key === "Enter" && plots.cursor !== null) return plots.pick(plots.cursor, false);
  const own = keys[mode][key];
  if (!own && event.target instanceof HTMLSelectElement) return;
  const act = own ?? common[key];
  if (!act || (event.repeat && mode === "live")) return;
  if (!(key === "Escape" && $("keys").open)) event.preventDefault();
  if (mode === "recording" && own && key !== " ") play(false);
  event.stopPropagation();
  act(event);
}, { capture: true });

// --- every frame of the screen ---

let plotted = 0, drawnAt = 0, before = performance.now();
function draw(now) {
  requestAnimationFrame(draw);
  if (mode === "recording") {
    if (player.playing) {
      seek(player.t + (Number($("speed").value) * (now - before)) / 1000);
      if (player.t >= player.duration) play(false);
    }
    requestFrame();
  }
  before = now;
  drawnAt = now;
  if (frame) showFrame(frame);
  showButtons();
  world.draw(now);
  showMeasure(world);
  showTriangleCount();
  if (now - plotted > PLOT_INTERVAL_MS + 4 * (world.slow_ms ?? 0) && frame) {
    plotted = now;
    plots.draw(frame.t);
    if (mode === "recording") {
      requestColumns();
      overview.draw(player.t);
    }
  }
  if (toastEnds > 0 && now > toastEnds) {
    toastEnds = 0;
    $("toast").hidden = true;
  }
}
requestAnimationFrame(draw);

// The page sends heartbeats while it is visible and drawn.
setInterval(() => {
  const visible = document.visibilityState === "visible" && performance.now() - drawnAt < DRAW_TIMEOUT_MS;
  if (mode === "live" && visible) connection.send("heartbeat");
}, HEARTBEAT_INTERVAL_MS);

/** Access for tests and for the browser console. */
window.view = {
  frame: () => frame,
  page: () => page,
  world: () => world.inspect(),
  scale: () => world.scale(),
  dragging: () => Boolean(toolDrag.drag || gamepadDrag.drag),
  onScreen: (point) => world.onScreen(point),
  toolOnScreen: () => world.toolOnScreen(),
  history: () => plots.data()[0],
  plots: () => plots,
  arrows: () => world.arrows(),
  times: () => times,
  player,
  slow: () => (world.slow = true),
};
