// SPDX-License-Identifier: GPL-3.0-or-later
// The WebSocket to wrenchctl view: what comes in is handed on by its type, and a lost connection is tried again.

const KIND_MESH = 1;
const KIND_HISTORY = 2;
const KIND_COARSE = 3;

/** A mesh: its number, corners with normals, which of them are triangles, and lines; metres. */
function meshOf(buffer) {
  const [kind, number, corners, triangles, points] = new Uint32Array(buffer, 0, 5);
  const floats = 20, indices = floats + 24 * corners, lines = indices + 12 * triangles;
  return {
    number,
    coarse: kind === KIND_COARSE,
    positions: new Float32Array(buffer, floats, 3 * corners),
    normals: new Float32Array(buffer, floats + 12 * corners, 3 * corners),
    triangles: new Uint32Array(buffer, indices, 3 * triangles),
    lines: new Float32Array(buffer, lines, 3 * points),
  };
}

/** Stretches of time: rows of [time, least and greatest of each channel]. */
function historyOf(buffer) {
  const [, anew, rows, width] = new Uint32Array(buffer, 0, 4);
  return { anew: anew === 1, rows, width, numbers: new Float64Array(buffer, 16, rows * width) };
}

export class Connection {
  /** hear: an object of functions by the type of the message; mesh, history, lost. */
  constructor(hear) {
    this.hear = hear;
    this.open();
  }

  open() {
    const address = new URL("live", location.href);
    address.protocol = "ws:";
    this.socket = new WebSocket(address);
    this.socket.binaryType = "arraybuffer";
    this.socket.onmessage = (event) => this.take(event.data);
    this.socket.onclose = () => {
      this.hear.lost();
      setTimeout(() => this.open(), 1000);
    };
  }

  take(data) {
    if (typeof data !== "string") {
      const kind = new Uint32Array(data, 0, 1)[0];
      if (kind === KIND_MESH || kind === KIND_COARSE) this.hear.mesh(meshOf(data));
      if (kind === KIND_HISTORY) this.hear.history(historyOf(data));
      return;
    }
    const message = JSON.parse(data);
    this.hear[message.type]?.(message);
  }

  say(type, more = {}) {
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify({ type, ...more }));
  }
}
