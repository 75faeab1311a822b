// SPDX-License-Identifier: GPL-3.0-or-later
// The WebSocket to wrenchctl view: passes messages to handlers by their type, and reconnects after a loss.

const KIND_MESH = 1;
const KIND_HISTORY = 2;
const KIND_SIMPLIFIED = 3;
const KIND_PLOTS = 4;
const KIND_OVERVIEW = 5;

/** Decodes a mesh: its number, vertices with normals, triangle indices, and lines; lengths in metres. */
function meshOf(buffer) {
  const [kind, number, vertices, triangles, points] = new Uint32Array(buffer, 0, 5);
  const floats = 20, indices = floats + 24 * vertices, lines = indices + 12 * triangles;
  return {
    number,
    simplified: kind === KIND_SIMPLIFIED,
    positions: new Float32Array(buffer, floats, 3 * vertices),
    normals: new Float32Array(buffer, floats + 12 * vertices, 3 * vertices),
    triangles: new Uint32Array(buffer, indices, 3 * triangles),
    lines: new Float32Array(buffer, lines, 3 * points),
  };
}

/** Decodes history buckets: rows of [time, minimum and maximum of each channel]. */
function historyOf(buffer) {
  const [, reset, rows, width] = new Uint32Array(buffer, 0, 4);
  return { reset: reset === 1, rows, width, numbers: new Float64Array(buffer, 16, rows * width) };
}

/** Decodes the columns of a recording: 0 is the shown one, 1 the compared one. */
function columnsOf(buffer) {
  const [, recording, rows, width] = new Uint32Array(buffer, 0, 4);
  const [from, to] = new Float64Array(buffer, 16, 2);
  return { recording, from, to, rows, numbers: new Float64Array(buffer, 32, rows * width) };
}

export class Connection {
  /** handlers: functions by message type, and mesh, history, columns, overview, lost. */
  constructor(handlers) {
    this.handlers = handlers;
    this.calls = new Map();  // promises of calls without a reply, by their id
    this.lastCall = 0;
    this.open();
  }

  open() {
    const address = new URL("live", location.href);
    address.protocol = "ws:";
    this.socket = new WebSocket(address);
    this.socket.binaryType = "arraybuffer";
    this.socket.onmessage = (event) => this.take(event.data);
    this.socket.onclose = () => {
      for (const { reject } of this.calls.values()) reject(new Error("The connection to wrenchctl view has ended."));
      this.calls.clear();
      this.handlers.lost();
      setTimeout(() => this.open(), 1000);
    };
  }

  take(data) {
    if (typeof data !== "string") {
      const kind = new Uint32Array(data, 0, 1)[0];
      if (kind === KIND_MESH || kind === KIND_SIMPLIFIED) this.handlers.mesh(meshOf(data));
      if (kind === KIND_HISTORY) this.handlers.history(historyOf(data));
      if (kind === KIND_PLOTS) this.handlers.columns(columnsOf(data));
      if (kind === KIND_OVERVIEW) this.handlers.overview(columnsOf(data));
      return;
    }
    const message = JSON.parse(data);
    if (message.type === "result") return this.settle(message);
    this.handlers[message.type]?.(message);
  }

  settle({ id, result, error }) {
    const call = this.calls.get(id);
    this.calls.delete(id);
    if (error === "") call?.resolve(result);
    else call?.reject(new Error(error));
  }

  /** Calls a method of the daemon. Returns a promise of its result, which rejects with the daemon's reason. */
  call(method, params) {
    if (this.socket.readyState !== WebSocket.OPEN) return Promise.reject(new Error("There is no connection to wrenchctl view."));
    const id = ++this.lastCall;
    this.send("call", { id, method, params });
    return new Promise((resolve, reject) => this.calls.set(id, { resolve, reject }));
  }

  send(type, more = {}) {
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify({ type, ...more }));
  }
}
