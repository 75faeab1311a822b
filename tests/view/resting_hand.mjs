// SPDX-License-Identifier: GPL-3.0-or-later
// The page on a simulated device whose hand rests 65 mm above the origin of the device base.
import assert from "node:assert/strict";
import { writeFileSync } from "node:fs";
import { daemon, file, open, text, until, view } from "./browser.mjs";

/** Returns the page, a function that reads the pose of the handle, and the pose at rest. */
export async function openRestingHand(viewport) {
  const hand = file("rest.toml"), config = file("wrenchd.toml");
  writeFileSync(hand, "repeats = false\n[[waypoint]]\ntime_s = 0.0\nposition_m = [0.0, 0.0, 0.065]\n");
  writeFileSync(config, `[simulation]\nhand_script = "${hand}"\n`);
  const wrenchd = await daemon(["--config", config]);
  const server = await view(["--socket", wrenchd.socket]);
  const page = await open(server.url, { viewport });
  await until("the page knows that the device is simulated", async () => (await text(page, "device")) === "present");
  await until("the tool is there", () => page.evaluate(() => window.view.world().ghost !== null && window.view.frame().q !== null));
  const pose = () => page.evaluate(() => window.view.frame().hand);
  const rest = await pose();
  assert.ok(Math.abs(rest[2] - 0.065) < 1e-3);
  return { page, pose, rest };
}
