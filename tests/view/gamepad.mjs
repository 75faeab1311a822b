// SPDX-License-Identifier: GPL-3.0-or-later
// With a shoulder button held, a gamepad moves and rotates the tool of a simulated device; afterwards the hand returns to its
// path. The browser has no gamepad, so the test gives it one.
import assert from "node:assert/strict";
import { sleep, test, text, until } from "./browser.mjs";
import { openRestingHand } from "./resting_hand.mjs";

const LEFT_SHOULDER = 4, RIGHT_SHOULDER = 5, BACK = 6, FORWARD = 7;

test(async () => {
  const { page, pose, rest } = await openRestingHand({ width: 360, height: 300 });
  await page.evaluate(() => {
    const pad = { connected: true, mapping: "standard", axes: [0, 0, 0, 0], buttons: Array.from({ length: 17 }, () => ({ pressed: false, value: 0 })) };
    window.pad = pad;
    navigator.getGamepads = () => [null, pad];  // a browser leaves empty places
    dispatchEvent(new Event("gamepadconnected"));
  });
  const set = (axes, pressed) => page.evaluate(({ axes, pressed }) => {
    window.pad.axes = axes;
    window.pad.buttons = window.pad.buttons.map((_, i) => ({ pressed: pressed.includes(i), value: Number(pressed.includes(i)) }));
  }, { axes, pressed });
  const isBack = async () => {
    const now = await pose();
    return Math.hypot(...now.slice(0, 3).map((x, i) => x - rest[i])) < 1e-3 && Math.hypot(...now.slice(3, 6)) < 0.01;
  };

  // Without a shoulder button the sticks move nothing.
  await set([1, -1, 1, 1], []);
  await sleep(500);
  assert.ok(!(await page.evaluate(() => window.view.dragging())) && (await isBack()));

  // Up on the stick is up on the screen, mostly up in the world. A stick at rest is never quite at zero.
  await set([0.1, -1, -0.1, 0.05], [LEFT_SHOULDER]);
  await until("the hand is higher", async () => (await pose())[2] > rest[2] + 0.02);
  await set([0, 0, 0, 0], [LEFT_SHOULDER]);
  let held = null;
  await until("the hand stays longer than a goal lasts", async () => {
    held = await pose();
    await sleep(700);
    return held[2] > rest[2] + 0.02 && Math.abs((await pose())[2] - held[2]) < 1e-3;
  });
  assert.ok(Math.hypot(...held.slice(3, 6)) < 0.02, "the small deflections rotate nothing");
  await set([0, 0, 0, 0], []);
  await until("the hand is back on its path", isBack);

  // However long the stick is held, the goal stays within 0.2 m.
  await set([1, 0, 0, 0], [RIGHT_SHOULDER]);
  const way_m = async () => Math.hypot(...(await pose()).slice(0, 3).map((x, i) => x - rest[i]));
  const isFarthest = async () => Math.abs((await way_m()) - 0.2) < 0.01;
  await until("the hand stays at its farthest", async () => (await isFarthest()) && (await sleep(1000), await isFarthest()));
  await set([0, 0, 0, 0], []);
  await until("the hand is back on its path", isBack);

  await set([0, 0, 1, 0], [RIGHT_SHOULDER]);
  await until("the hand is turned about the vertical", async () => (await pose())[5] > 0.15);
  await set([0, 0, 0, 0], []);
  await until("the hand is not turned any more", isBack);

  // The triggers move along the line of sight, which goes down from the camera.
  await set([0, 0, 0, 0], [LEFT_SHOULDER, BACK]);
  await until("the hand is nearer to the camera and higher", async () => (await pose())[2] > rest[2] + 0.01);
  await set([0, 0, 0, 0], [FORWARD]);
  await until("the hand is back on its path", isBack);

  // A gamepad that is unplugged while its button is pressed releases the hand.
  await set([0, -1, 0, 0], [LEFT_SHOULDER]);
  await until("the hand is higher before the gamepad is unplugged", async () => (await pose())[2] > rest[2] + 0.02);
  await page.evaluate(() => (navigator.getGamepads = () => [null, null]));
  await until("the hand is back on its path", isBack);
  assert.equal(await text(page, "toast"), "");
  assert.deepEqual(page.complaints(), []);
});
