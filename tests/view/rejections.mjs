// SPDX-License-Identifier: GPL-3.0-or-later
// The server rejects requests without the token, and requests from other web pages.
import assert from "node:assert/strict";
import http from "node:http";
import net from "node:net";
import { networkInterfaces } from "node:os";
import { test, view } from "./browser.mjs";

function ask(url, { path, headers = {}, method = "GET" } = {}) {
  const { port, pathname } = new URL(url);
  return new Promise((done, failed) => {
    const request = http.request({ host: "127.0.0.1", port, path: path ?? pathname, headers, method }, (response) => {
      let body = "";
      response.on("data", (data) => (body += data));
      response.on("end", () => done({ status: response.statusCode, headers: response.headers, body }));
    });
    request.on("upgrade", (response, socket) => {
      socket.destroy();
      done({ status: response.statusCode });
    });
    request.on("error", failed);
    request.end();
  });
}

const reachable = (host, port) => new Promise((done) => {
  const socket = net.connect({ host, port }, () => done(true));
  socket.on("error", () => done(false));
  setTimeout(() => done(false), 2000);
});

test(async () => {
  const { url } = await view(["--socket", "/nowhere/control.sock"]);
  const { port, host, pathname } = new URL(url);
  const status = async (more) => (await ask(url, more)).status;

  const page = await ask(url);
  assert.equal(page.status, 200);
  assert.match(page.body, /<title>wrenchd/);
  assert.match(page.headers["content-security-policy"], /default-src 'none'/);
  assert.equal(page.headers["referrer-policy"], "no-referrer");
  assert.equal(await status({ headers: { Host: `localhost:${port}` } }), 200);
  assert.equal(await status({ path: `${pathname}main.js` }), 200);

  // The token.
  const wrong = pathname.replace(/[0-9a-f](?=\/$)/, (digit) => (digit === "0" ? "1" : "0"));
  for (const path of ["/", "/index.html", wrong, pathname.slice(0, -2) + "/", `${pathname.slice(0, -1)}0/`, "/favicon.ico"])
    assert.equal(await status({ path }), 403, path);
  // Files that are not part of the page.
  for (const name of ["../../../../etc/passwd", "%2e%2e/%2e%2e/etc/passwd", "/etc/passwd", "nothing.js"])
    assert.equal(await status({ path: pathname + name }), 404, name);
  assert.equal(await status({ method: "POST" }), 405);
  // Host and Origin.
  for (const other of ["evil.example", `evil.example:${port}`, "127.0.0.1", `127.0.0.1:${Number(port) + 1}`])
    assert.equal(await status({ headers: { Host: other } }), 403, other);
  for (const other of ["http://evil.example", `https://${host}`, `http://${host}.evil.example`, "null"])
    assert.equal(await status({ headers: { Origin: other } }), 403, other);

  const upgrade = { Connection: "Upgrade", Upgrade: "websocket", "Sec-WebSocket-Version": "13", "Sec-WebSocket-Key": "AAAAAAAAAAAAAAAAAAAAAA==" };
  const live = (headers, path = `${pathname}live`) => status({ path, headers: { ...upgrade, ...headers } });
  assert.equal(await live({ Origin: `http://${host}` }), 101);
  assert.equal(await live({}), 403);
  assert.equal(await live({ Origin: "http://evil.example" }), 403);
  assert.equal(await live({ Origin: `http://${host}`, Host: "evil.example" }), 403);
  assert.equal(await live({ Origin: `http://${host}` }, `${wrong}live`), 403);

  // This machine's other addresses.
  for (const addresses of Object.values(networkInterfaces()))
    for (const { address, internal } of addresses)
      if (!internal) assert.equal(await reachable(address, port), false, address);
});
