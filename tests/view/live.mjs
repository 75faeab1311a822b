// SPDX-License-Identifier: GPL-3.0-or-later
// A running daemon: the page shows it and arms it; the lease depends on the page's heartbeats.
import assert from "node:assert/strict";
import { daemon, must, open, sleep, test, text, until, view } from "./browser.mjs";

const ARMED = ["waiting", "ramping", "active", "degraded"];

test(async () => {
  const wrenchd = await daemon();
  const server = await view(["--socket", wrenchd.socket]);
  const state = async () => (await wrenchd.status()).state;
  const small = { viewport: { width: 700, height: 500 } };  // software rendering: a slow page loses its lease
  const page = await open(server.url, small);
  await until("the page shows the state", async () => (await text(page, "state")) === "disarmed");
  await until("the scene is there", () => page.evaluate(() => window.view.world().ghost !== null));
  assert.equal(await page.locator("#disarm").isDisabled(), true);

  const armed = async () => {
    await until("it is armed", async () => {
      const now = await state();
      if (now === "fault") await page.locator("#acknowledge").click();  // a busy machine
      if (now === "disarmed") await page.locator("#arm").click({ timeout: 15000 }).catch(() => {});
      return ARMED.includes(now);
    }, 120000);
  };

  // Armed: there is force, and the page shows it.
  await armed();
  await until("the page says who armed", async () => /process/.test(await text(page, "armed-by")));
  const { frame, world } = await until("a force is shown", async () => {
    await armed();
    const now = await page.evaluate(() => ({ frame: window.view.frame(), world: window.view.world() }));
    return Number(await text(page, "force")) > 0.5 && now.frame.contacts.length > 0 && now;
  });
  frame.p.forEach((x, i) => assert.ok(Math.abs(world.ghost[i] - x) < 1e-6));
  assert.equal(frame.contacts[0].obstacle, "table");

  // A disarm by the user is no fault. On a busy machine a slow page may lose its lease before; then the test arms again.
  await until("it is disarmed without a cause", async () => {
    await armed();
    await page.keyboard.press("d");
    await until("it is released", async () => ["disarmed", "fault"].includes(await state()));
    const { state: now, lease, cause } = await wrenchd.status();
    return now === "disarmed" && lease === null && cause === null;
  });

  // A page that hangs releases the lease. On a busy machine the daemon may act first; then the test arms again.
  await until("the page says why", async () => {
    await armed();
    const hung = page.evaluate(() => {
      for (const end = performance.now() + 4000; performance.now() < end;);
    });
    await must("it is disarmed while the page hangs", async () => !ARMED.includes(await state()), 3900);
    await hung;
    await sleep(500);
    return /this page was hidden or unresponsive/.test(await text(page, "toast"));
  });

  // The stop button works for every page.
  await armed();
  await page.locator("#stop").click();
  await until("it is stopped", async () => (await state()) === "stopped");
  await until("the banner says what to do", async () => /cknowledge/.test(await text(page, "banner-remedy")));
  await page.locator("#acknowledge").click();
  await until("it is disarmed again", async () => (await state()) === "disarmed");

  // A closed tab releases the lease.
  await armed();
  assert.deepEqual(page.complaints(), []);
  await page.close();
  await must("it is disarmed when the tab is closed", async () => !ARMED.includes(await state()), 3000);

  // The page shows that the daemon has ended, and shows a restarted daemon again.
  const again = await open(server.url, small);
  await until("the page shows the daemon", async () => (await text(again, "state")) === "disarmed");
  await again.evaluate(() => {  // whether Arm is disabled as soon as the loss is shown, before any further picture
    const shown = document.getElementById("state");
    window.armDisabledAtLoss = new Promise((seen) => {
      new MutationObserver(() => shown.textContent === "connection lost" && seen(document.getElementById("arm").disabled))
        .observe(shown, { childList: true, characterData: true, subtree: true });
    });
  });
  wrenchd.child.kill("SIGTERM");
  await wrenchd.ended;
  await until("the page says that it is gone", async () => (await text(again, "state")) === "connection lost");
  assert.match(await text(again, "banner-title"), /No connection to wrenchd/);
  assert.equal(await again.evaluate(() => window.armDisabledAtLoss), true);
  await daemon();
  await until("it is back", async () => (await text(again, "state")) === "disarmed");
  assert.equal(await again.locator("#banner").isVisible(), false);

  // The page shows that the view has ended.
  server.child.kill("SIGTERM");
  await until("the page reports that the server is gone", async () => /wrenchctl view/.test(await text(again, "banner-title")));
  await sleep(100);
});
