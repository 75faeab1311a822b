// SPDX-License-Identifier: GPL-3.0-or-later
// Does the view reach the servo loop? A daemon runs, wrenchctl view reads it, and a page is drawn in headless Chromium.
// The view alternately runs and is paused (SIGSTOP); the script compares the ticks of both kinds of slices.
// Prints a line "view key value ...", and ends with 1 where p99.9 differs by more than --most-us.
//
//   node prove_view.mjs [--slices 10] [--slice-s 1] [--seed 1] [--most-us 50] [wrenchd's arguments, as --scene FILE]
import { execFileSync } from "node:child_process";
import { readdirSync, readFileSync, writeFileSync } from "node:fs";
import { chromiumLaunch, daemon, file, sleep, test, TooSlow, until, view } from "../view/browser.mjs";

const options = { slices: 10, "slice-s": 1, seed: 1, "most-us": 50 };
const words = process.argv.slice(2);
for (let i = 0; i + 1 < words.length;) {
  const name = words[i].replace(/^--/, "");
  if (name in options) [, options[name]] = words.splice(i, 2).map(Number);
  else ++i;
}

const TIMES = `
import h5py, json, sys
import numpy as np
ticks = h5py.File(sys.argv[1])["ticks"][:]
slices = json.load(open(sys.argv[2]))
took, late, at = ticks["stage_ns"].sum(1) * 1e-3, ticks["wake_latency_ns"] * 1e-3, ticks["now_ns"]
out = {}
for kind, drawn in (("quiet", False), ("viewed", True)):
    chosen = np.zeros(len(ticks), bool)
    for s in slices:
        if s["drawn"] == drawn: chosen |= (at >= s["begin_ns"]) & (at < s["end_ns"])
    for name, x in (("tick", took), ("late", late)):
        for q, text in ((50, "p50"), (99.9, "p99_9"), (100, "max")):
            out[f"{kind}_{name}_{text}_us"] = round(float(np.percentile(x[chosen], q)), 1)
    out[f"{kind}_ticks"] = int(chosen.sum())
print(json.dumps(out))`;

/** The process and all that it has started. */
function family(pid) {
  const children = new Map();
  for (const name of readdirSync("/proc").filter((n) => /^\d+$/.test(n))) {
    try {
      const parent = Number(/^PPid:\s*(\d+)/m.exec(readFileSync(`/proc/${name}/status`, "utf8"))[1]);
      children.set(parent, [...(children.get(parent) ?? []), Number(name)]);
    } catch { /* it has ended */ }
  }
  const all = [pid];
  for (let i = 0; i < all.length; ++i) all.push(...(children.get(all[i]) ?? []));
  return all;
}

function signal(pids, name) {
  for (const pid of pids)
    try {
      process.kill(pid, name);
    } catch { /* it has ended */ }
}

const now_ns = () => Number(process.hrtime.bigint());  // CLOCK_MONOTONIC, as the ticks have it
const random = ((state) => () => (state = (state * 1103515245 + 12345) % 2147483648) / 2147483648)(options.seed);

test(async () => {
  const recording = file("run.h5");
  const wrenchd = await daemon(["--arm", "--record", recording, ...words]);
  const server = await view(["--socket", wrenchd.socket]);
  const { page, pid } = await chromiumLaunch(server.url);
  await until("the scene is drawn", () => page.evaluate(() => window.view?.world().tool && window.view.world().drawn > 5), 120000);
  await sleep(2000);

  const slices = [];
  let frames = 0, seconds = 0;
  const drawn = () => page.evaluate(() => window.view.world().drawn);
  for (let pair = 0; pair < options.slices; ++pair) {
    const first = random() < 0.5;
    for (const on of [first, !first]) {
      const all = [...family(pid), server.child.pid];
      signal(all, on ? "SIGCONT" : "SIGSTOP");
      if (on) await until("the page draws again", async () => (await drawn()) > 0);
      await sleep(200);
      const before = on ? await drawn() : 0;
      const begin_ns = now_ns();
      await sleep(1000 * options["slice-s"]);
      const end_ns = now_ns();
      if (on) {
        frames += (await drawn()) - before;
        seconds += options["slice-s"];
      }
      slices.push({ begin_ns, end_ns, drawn: on });
    }
  }
  signal([...family(pid), server.child.pid], "SIGCONT");
  const triangles = await page.evaluate(() => window.view.world().triangles);
  wrenchd.child.kill("SIGTERM");
  await wrenchd.ended;
  writeFileSync(file("slices.json"), JSON.stringify(slices));
  writeFileSync(file("times.py"), TIMES);
  const times = JSON.parse(execFileSync("/usr/bin/python3", [file("times.py"), recording, file("slices.json")]));
  const difference = times.viewed_tick_p99_9_us - times.quiet_tick_p99_9_us;
  const line = { ...times, difference_us: difference.toFixed(1), frames_per_s: (frames / seconds).toFixed(1), triangles, seed: options.seed };
  console.log("view " + Object.entries(line).flat().join(" "));
  if (frames === 0) throw new TooSlow("nothing was drawn: there was nothing to measure");
  if (difference > options["most-us"]) throw new TooSlow(`p99.9 of a tick is ${difference.toFixed(1)} us longer while the view runs`);
}, null);
