// SPDX-License-Identifier: GPL-3.0-or-later
// Shared by the tests of the page: the programs, and a browser with software rendering.
import { spawn } from "node:child_process";
import { existsSync, mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { pathToFileURL } from "node:url";
import { busyText } from "../support/machine_load.mjs";

const binaries = process.env.WRENCHD_BINARY_DIR;
export const source = process.env.WRENCHD_SOURCE_DIR;
const CHROMIUM = "/usr/bin/chromium";
const SKIPPED = 77;

export const sleep = (ms) => new Promise((done) => setTimeout(done, ms));

/** A condition that needs a rate in wall time does not hold. On a machine that is too busy the test then skips. */
export class TooSlow extends Error {}

async function poll(holds, limit_ms) {
  for (const end = Date.now() + limit_ms; Date.now() < end; await sleep(50)) {
    const value = await holds();
    if (value) return value;
  }
  return null;
}

/** Waits until the condition is true; otherwise throws TooSlow with the given text. */
export async function until(what, holds, limit_ms = 60000) {
  const value = await poll(holds, limit_ms);
  if (value) return value;
  throw new TooSlow(`not within ${limit_ms} ms: ${what}`);
}

/** Waits until the condition is true; otherwise the test fails whatever the load. For what wrenchd guarantees. */
export async function must(what, holds, limit_ms) {
  if (!await poll(holds, limit_ms)) throw new Error(`violation, not within ${limit_ms} ms: ${what}`);
}

const running = [];
const directory = mkdtempSync(join(tmpdir(), "wrenchd-view-"));
export const file = (name) => join(directory, name);

/** A program that runs beside the test; out: its output. */
export function start(program, words) {
  // Flight recordings are written to the directory of the test.
  const child = spawn(join(binaries, program), words, { env: { ...process.env, XDG_STATE_HOME: directory } });
  const one = { child, out: "", err: "", ended: new Promise((done) => child.on("close", done)) };
  child.stdout.on("data", (data) => (one.out += data));
  child.stderr.on("data", (data) => (one.err += data));
  running.push(one);
  return one;
}

export async function finished(program, words) {
  const one = start(program, words);
  const code = await one.ended;
  if (code !== 0) throw new Error(`${program} ${words.join(" ")} ended with ${code}: ${one.err}`);
  return one.out;
}

/** A daemon with the simulated device. Its loop may be late on a shared machine, which the tests tolerate. */
export async function daemon(more = []) {
  const socket = file("control.sock");
  const one = start("wrenchd", ["--realtime", "best_effort", "--control", socket, ...more]);
  await until("the daemon answers", () => existsSync(socket) && /disarmed/.test(one.err));
  return { ...one, socket, status: async () => JSON.parse(await finished("wrenchctl", ["status", "--json", "--socket", socket])) };
}

/** wrenchctl view, and the address that it prints. */
export async function view(words) {
  const one = start("wrenchctl", ["view", ...words]);
  const url = await until(`an address (${one.err})`, () => /http:\S+/.exec(one.out)?.[0]);
  return { ...one, url };
}

const ARGUMENTS = ["--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking",
  "--disable-component-update", "--disable-sync", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"];

async function playwright() {
  if (!existsSync(CHROMIUM)) {
    console.log(`skipped: ${CHROMIUM} is not there; install the package chromium`);
    await end(SKIPPED);
  }
  const library = join(process.env.WRENCHD_TEST_LIBRARIES, "node_modules/playwright-core/index.mjs");
  return (await import(pathToFileURL(library))).chromium;
}

/** Chromium with low priority, because software rendering would take all processors from the daemon. */
function niced(by) {
  const program = file("chromium");
  writeFileSync(program, `#!/bin/sh\nexec nice -n ${by} ${CHROMIUM} "$@"\n`, { mode: 0o700 });
  return program;
}

/** A page in a browser of its own, whose process is known. */
export async function chromiumLaunch(url) {
  const server = await (await playwright()).launchServer({ executablePath: niced(19), args: ARGUMENTS });
  browser = await (await playwright()).connect(server.wsEndpoint());
  const page = await browser.newPage({ viewport: { width: 1280, height: 720 } });
  page.setDefaultTimeout(120000);
  await page.goto(url);
  return { page, pid: server.process().pid };
}

let browser;
/** A page; every console error fails the test. */
export async function open(url, options = {}) {
  browser ??= await (await playwright()).launch({ executablePath: niced(5), args: ARGUMENTS });
  const page = await browser.newPage({ viewport: { width: 1280, height: 720 }, ...options });
  page.setDefaultTimeout(60000);
  const complaints = [];
  page.on("pageerror", (error) => complaints.push(error.message));
  page.on("console", (message) => ["error", "warning"].includes(message.type()) && complaints.push(message.text()));
  page.on("request", (request) => !request.url().startsWith(new URL(url).origin) && !request.url().startsWith("data:") && complaints.push(`asks for ${request.url()}`));
  await page.goto(url);
  // Ignores warnings about slow software rendering.
  const own = () => complaints.filter((text) => !/GPU stall|GL Driver|swiftshader/i.test(text));
  return Object.assign(page, { complaints: own });
}

export const text = (page, id) => page.locator(`#${id}`).textContent();

async function endPrograms() {
  await browser?.close();
  browser = undefined;
  for (const { child } of running) if (child.exitCode === null) child.kill("SIGTERM");
  await Promise.race([Promise.all(running.map(({ ended }) => ended)), sleep(5000)]);
  for (const { child } of running) if (child.exitCode === null) child.kill("SIGKILL");
}

async function end(code) {
  await endPrograms();
  rmSync(directory, { recursive: true, force: true });
  process.exit(code);
}

/** Runs a test, ends all programs that it started, and exits with its result. If the test was too slow and the machine
 * is too busy without these programs, exits with 77. limit_s: the test is too slow after this time, which is less than the
 * time that ctest allows; null: no limit. */
export async function test(run, limit_s = 240) {
  try {
    const limit = limit_s === null ? [] : [sleep(1000 * limit_s).then(() => {
      throw new TooSlow(`the test does not end within ${limit_s} s`);
    })];
    await Promise.race([run(), ...limit]);
    await end(0);
  } catch (error) {
    console.error(error);
    for (const { err } of running) if (err !== "") console.error(err.trimEnd().split("\n").slice(-12).join("\n"));
    await endPrograms();  // their load is not measured
    const busy = error instanceof TooSlow || error.name === "TimeoutError" ? await busyText() : null;
    if (busy) console.log(busy);
    await end(busy ? SKIPPED : 1);
  }
}
