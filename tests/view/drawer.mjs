// SPDX-License-Identifier: GPL-3.0-or-later
// The drawer changes values, scene, workspace and recording of the running daemon, undoes it, and says what the daemon rejects.
import assert from "node:assert/strict";
import { daemon, file, finished, open, test, text, until, view } from "./browser.mjs";

test(async () => {
  const wrenchd = await daemon();
  const settings = async () => Object.fromEntries(JSON.parse(await finished("wrenchctl", ["set", "--json", "--socket", wrenchd.socket]))
    .settings.map(({ name, value }) => [name, value]));
  const server = await view(["--socket", wrenchd.socket]);
  const page = await open(server.url, { viewport: { width: 1000, height: 700 } });
  await until("the page is live", async () => (await text(page, "state")) === "disarmed");
  const said = (what) => until(`"${what}"`, async () => (await text(page, "drawer-result")).includes(what));

  await page.keyboard.press("s");
  const stiffness = page.locator("#value-wrench-energy_stiffness_per_s2");
  await until("the values are there", async () => (await stiffness.count()) === 1 && (await stiffness.inputValue()) === "3000");

  // A number, and a word; each can be undone.
  await stiffness.fill("2000");
  await stiffness.press("Enter");
  await said("3000 to 2000 1/s2");
  assert.equal((await settings())["wrench.energy_stiffness_per_s2"], 2000);
  await page.locator("#value-wrench-law").selectOption("pid");
  await said("law: energy to pid");
  // Of a gain, the component that is not changed keeps its value.
  const linear = page.locator("#value-wrench-stiffness-linear_N_per_m");
  await linear.fill("500");
  await linear.press("Enter");
  await said("600 to 500 N/m");
  assert.equal((await settings())["wrench.stiffness.angular_Nm_per_rad"], 1.5);
  for (const back of ["500 to 600 N/m", "pid to energy", "2000 to 3000 1/s2"]) {
    await page.locator("#undo").click();
    await said(`Undone: `);
    await said(back);
  }
  await until("all is undone", () => page.locator("#undo").isDisabled());
  assert.equal((await settings())["wrench.energy_stiffness_per_s2"], 3000);

  // A value that the daemon rejects changes nothing, and the page says why.
  await stiffness.fill("-5");
  await stiffness.press("Enter");
  await until("the reason", async () => /energy_stiffness/.test(await text(page, "drawer-result")));
  assert.equal(await page.locator("#drawer-result").getAttribute("class"), "problem");
  await until("the value is the daemon's again", async () => (await stiffness.inputValue()) === "3000");

  // The bound is drawn where the daemon scales a stiffness that the device does not carry.
  await stiffness.fill("900000000");
  await stiffness.press("Enter");
  await until("the bound", async () => /the stability bound allows/.test(await text(page, "value-wrench-energy_stiffness_per_s2-note")));
  assert.equal(await page.locator("#value-wrench-energy_stiffness_per_s2 ~ .slider .bound").isVisible(), true);
  await page.locator("#undo").click();
  await said("to 3000 1/s2");

  // Scenes, by the names of the gallery or a file of one's own.
  const before = await text(page, "scene-now");
  assert.ok((await page.locator("#scene-names option").count()) >= 9);
  await page.locator("#scene-file").fill("scenes/staircase.toml");
  await page.locator("#load").click();
  await said("Loaded: scenes/staircase.toml");
  await until("the scene", async () => /staircase/.test(await text(page, "scene-now")));
  await page.locator("#undo").click();
  await until("the scene before", async () => (await text(page, "scene-now")) === before);
  await until("all is undone", () => page.locator("#undo").isDisabled());
  await page.locator("#scene-file").fill("scenes/no_such.toml");
  await page.locator("#load").click();
  await said("no_such.toml");

  await page.locator("#scale").fill("2");
  await page.locator("#scale").press("Enter");
  await said("scale: 2");
  await page.locator("#undo").click();
  await said("scale: 1");

  // A recording with a marker. A space in its label is text, and no stop.
  await page.locator("#record").click();
  await said("Recording to ");
  await until("a recording", async () => (await text(page, "record")) === "End the recording");
  await page.locator("#mark-label").click();
  await page.keyboard.type("trial 3");
  await page.keyboard.press("Enter");
  await said("Marked: trial 3.");
  await until("the marker", async () => (await text(page, "marker")) === "trial 3");
  await page.locator("#record").click();
  await said(`ticks in ${file("wrenchd")}`);
  assert.equal(await page.evaluate(() => window.view.frame().state), "disarmed");

  // The events, by level and by text, with the daemon's remedy.
  await page.locator("#drawer-close").click();
  await page.keyboard.press(" ");
  await until("the stop", () => page.evaluate(() => window.view.frame().state === "stopped"));
  await page.keyboard.press("s");
  await page.locator("#event-text").fill("stop");
  await until("the event", async () => /stop/.test(await text(page, "event-list")));
  assert.match(await text(page, "event-list"), /then acknowledge/);
  await page.locator("#event-text").fill("");
  await page.locator("#event-level").selectOption("error");
  const levels = await page.locator("#event-list li").evaluateAll((lines) => lines.map((line) => line.dataset.level));
  assert.ok(levels.length > 0 && levels.every((level) => level === "error"), levels.join());
  await page.locator("#event-text").fill("no event has this text");
  await until("none", () => page.locator("#no-events").isVisible());

  // Inside of the window at every size.
  for (const size of [{ width: 1600, height: 1000 }, { width: 800, height: 600 }, { width: 390, height: 844 }]) {
    await page.setViewportSize(size);
    const box = await page.locator("#drawer").boundingBox();
    assert.ok(box.x >= 0 && box.x + box.width <= size.width, JSON.stringify({ size, box }));
    assert.ok(await page.evaluate(() => document.documentElement.scrollWidth <= innerWidth), JSON.stringify(size));
  }
  assert.deepEqual(page.complaints(), []);
});
