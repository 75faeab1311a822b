// SPDX-License-Identifier: GPL-3.0-or-later
// The page shows the numbers and the scene of the recording, compared with the columns that h5py reads.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { writeFileSync } from "node:fs";
import { file, finished, open, test, text, until, view } from "./browser.mjs";

// In virtual time ticks have no duration; the test sets the duration of one tick.
const COLUMNS = `
import h5py, json, sys
with h5py.File(sys.argv[1], "r+") as f:
    row = f["ticks"][7000]
    row["stage_ns"][1] = 1234567
    f["ticks"][7000] = row
ticks = h5py.File(sys.argv[1])["ticks"][:]
begin = int(ticks["now_ns"][0])
rows = []
for i in map(int, sys.argv[2:]):
    r = ticks[i % len(ticks)]
    rows.append({"t": (int(r["now_ns"]) - begin) * 1e-9, "tick": int(r["tick"]), "state": int(r["state"]),
                 **{k: [float(x) for x in r[k]] for k in ("X_WP", "X_WQ", "F_out")},
                 "energy": float(r["energy"]), "contacts": int(r["contacts"]), "authority": float(r["authority"])})
last_ten = ticks[ticks["now_ns"] > int(ticks["now_ns"][-1]) - 10 * 10**9]
print(json.dumps({"rows": rows, "count": len(ticks), "end": (int(ticks["now_ns"][-1]) - begin) * 1e-9,
                  "most_force_N": float(max((last_ten["F_out"][:, :3] ** 2).sum(1) ** 0.5)),
                  "longest_us": float(last_ten["stage_ns"].sum(1).max()) * 1e-3}))`;
const STATES = ["disconnected", "self-test", "disarmed", "waiting", "ramping", "active", "degraded", "releasing", "fault", "stopped", "shutdown"];

const near = (got, expected, within, what) => assert.ok(Math.abs(got - expected) <= within, `${what}: ${got}, and ${expected} was recorded`);
const length3 = ([x, y, z]) => Math.hypot(x, y, z);

test(async () => {
  const recording = file("run.h5");
  await finished("wrenchd", ["--virtual-time", "--seconds", "12", "--arm", "--record", recording, "--control", "none"]);
  const script = file("columns.py");
  writeFileSync(script, COLUMNS);
  const numbers = [100, 2500, 3210, 4000, 5555, 6789, -1];
  const columns = JSON.parse(execFileSync("/usr/bin/python3", [script, recording, ...numbers.map(String)]));
  assert.ok(columns.rows.some(({ state, contacts }) => STATES[state] === "active" && contacts > 0));

  // A marker of an experiment, as record.mark writes it while a recording runs in wall time.
  execFileSync("/usr/bin/python3", ["-c", `
import sys, h5py
with h5py.File(sys.argv[1], "r+") as file:
    events = file["events"]
    events.resize(len(events) + 1, 0)
    row = events[-1]
    row["name"], row["text"], row["conditions"] = b"marker", b"trial 3", b'{"stiffness":2000}'
    row["time_ns"] = file["ticks"]["now_ns"][0] + 3_000_000_000
    events[-1] = row
`, recording]);
  const { url } = await view([recording]);
  const page = await open(url);
  await until("the scene is there", () => page.evaluate(() => window.view?.world().ghost && window.view.frame() !== null));
  assert.equal(await page.locator("#stop").isVisible(), false);
  near(Number(await page.locator("#scrub").getAttribute("max")), columns.end, 1e-6, "its end");

  for (const row of columns.rows) {
    await page.evaluate((t) => {
      const slider = document.getElementById("scrub");
      slider.step = "any";
      slider.value = t;
      slider.dispatchEvent(new Event("input"));
    }, row.t + 1e-5);
    await until(`tick ${row.tick} is shown`, async () => (await text(page, "tick")) === String(row.tick));
    const what = `tick ${row.tick}`;
    assert.equal(await text(page, "state"), STATES[row.state], what);
    assert.equal(await text(page, "marker"), row.t >= 3 ? "trial 3 (stiffness 2000), at 3.00 s" : "none until now", what);
    near(Number(await text(page, "force")), length3(row.F_out), 0.00501, `${what}, force`);
    near(Number(await text(page, "torque")), 1e3 * length3(row.F_out.slice(3)), 0.0501, `${what}, torque`);
    const gap = [0, 1, 2].map((i) => row.X_WQ[i] - row.X_WP[i]);
    near(Number(await text(page, "depth")), 1e3 * length3(gap), 0.000501, `${what}, penetration`);
    near(Number(await text(page, "energy")), 1e6 * row.energy, 0.000501, `${what}, energy`);
    near(Number(await text(page, "authority")), 100 * row.authority, 0.501, `${what}, authority`);
    assert.equal(await text(page, "contacts"), String(row.contacts), what);
    const world = await page.evaluate(() => window.view.world());
    row.X_WP.forEach((x, i) => near(world.ghost[i], x, 1e-6, `${what}, ghost`));
    row.X_WQ.forEach((x, i) => near(world.tool[i], x, 1e-6, `${what}, tool`));
    const force = row.F_out.slice(0, 3);
    if (length3(force) > 0.1) force.forEach((x, i) => near(world.force[i], x / length3(force), 1e-5, `${what}, arrow`));
  }

  // At the end: the curves and the histogram have the extremes of single ticks.
  await until("the curves of the end", () => page.evaluate((end) => Math.abs(window.view.history().time(window.view.history().rows - 1) - end) < 0.1, columns.end));
  const most = await page.evaluate(() => window.view.history().extremes("force", -Infinity, Infinity)[1]);
  near(most, columns.most_force_N, 1e-9, "the greatest force of the curve");
  const longest = await until("the histogram", () => page.evaluate(() => window.view.times()?.tick_duration.max_us));
  near(longest, columns.longest_us, 1e-6, "the longest tick");
  assert.ok((await page.evaluate(() => window.view.world().triangles)) > 20);

  // A drag in a plot zooms, a click goes to its time, and a double click returns. The cursor shows the values of all plots.
  const box = await page.locator("#plot-force .u-over").boundingBox();
  const at = (share) => [box.x + share * box.width, box.y + box.height / 2];
  await page.mouse.move(...at(0.6));
  assert.equal(await page.locator(".readout:visible").count(), 4);
  assert.match(await page.locator("#plot-force .readout").textContent(), /norm [\d.]+.* N.*x .* N/);
  await page.mouse.down();
  await page.mouse.move(...at(0.7), { steps: 4 });
  await page.mouse.up();
  const [from, to] = await until("the zoom", () => page.evaluate(() => window.view.plots().held));
  near(to - from, 1, 0.1, "the width of the zoom");
  await page.keyboard.press("0");
  assert.equal(await page.evaluate(() => window.view.plots().held), null);
  await page.mouse.click(...at(0.5));
  await until("the time of the click", async () => Math.abs(Number.parseFloat(await text(page, "play-time")) - (columns.end - 5)) < 0.1);
  await page.mouse.dblclick(...at(0.8));
  assert.equal(await page.evaluate(() => window.view.plots().held), null);

  // The text alternatives have the extremes of the shown curves.
  const alternative = () => page.locator("#plot-force").getAttribute("aria-label");
  const shownForce = await page.evaluate(() => window.view.history().extremes("force", ...window.view.plots().window)[1].toFixed(3));
  await until("the text alternative of the end", async () => (await alternative()).includes(`norm 0.000 to ${shownForce} N`));

  // The overview goes to a time of the whole recording.
  const strip = await page.locator("#overview").boundingBox();
  await page.mouse.click(strip.x + strip.width / 4, strip.y + strip.height / 2);
  await until("a quarter of the recording", async () => Math.abs(Number.parseFloat(await text(page, "play-time")) - columns.end / 4) < 0.05);

  // Keys: to the beginning, a tick, a tenth of a second, play, pause.
  await page.keyboard.press("Home");
  await until("the beginning", async () => (await text(page, "play-time")) === "0.000 s");
  await until("a window that begins with the recording", () => page.evaluate(() => window.view.plots().window.join() === "0,10"));
  await page.keyboard.press("ArrowRight");
  await until("a tenth of a second", async () => (await text(page, "play-time")) === "0.100 s");
  await page.keyboard.press("Space");
  await until("it plays", async () => Number.parseFloat(await text(page, "play-time")) > 1);
  assert.equal(await text(page, "play"), "Pause");
  await page.keyboard.press("Space");
  assert.equal(await text(page, "play"), "Play");
  assert.deepEqual(page.complaints(), []);
  await page.close();
  await compared(recording);
});

/** A second, shorter recording: its curves and its tool are shown while it lasts. */
async function compared(recording) {
  const other = file("other.h5");
  await finished("wrenchd", ["--virtual-time", "--seconds", "6", "--arm", "--record", other, "--control", "none"]);
  const { url } = await view([recording, "--compare", other]);
  const page = await open(url);
  await until("the scene is there", () => page.evaluate(() => window.view?.world().ghost && window.view.frame() !== null));
  assert.match(await text(page, "compared"), /^solid: run\.h5; dashed: other\.h5$/);
  assert.equal(await text(page, "key-second"), "other.h5");
  await page.locator("#scrub").focus();
  await page.keyboard.press("End");
  await until("the end without the second tool", () => page.evaluate(() => window.view.frame().t > 11 && !window.view.world().second));
  for (let i = 0; i < 8; ++i) await page.keyboard.press("Shift+ArrowLeft");
  await until("both tools", () => page.evaluate(() => window.view.frame().t < 5 && window.view.world().tool && window.view.world().second));
  await until("the curves of both", () => page.evaluate(() => window.view.plots().data().length === 2 &&
    window.view.plots().data().every((rows) => rows.extremes("force", 3, 5)?.[1] > 0.1)));
  const lines = await page.evaluate(() => window.view.plots().curves[0].plot.series.map(({ dash }) => Boolean(dash)));
  assert.deepEqual(lines, [false, false, false, false, false, true, true, true, true]);
  assert.match(await page.locator("#plot-force").getAttribute("aria-label"), /; compared, norm [\d.]+/);
  assert.deepEqual(page.complaints(), []);
}
