// SPDX-License-Identifier: GPL-3.0-or-later
// Operation by keyboard alone; light and dark; narrow and wide.
import assert from "node:assert/strict";
import { daemon, open, test, text, until, view } from "./browser.mjs";

test(async () => {
  const wrenchd = await daemon();
  const { url } = await view(["--socket", wrenchd.socket]);
  const state = async () => (await wrenchd.status()).state;
  const page = await open(url, { viewport: { width: 1000, height: 600 } });
  await until("the page shows the state", async () => (await text(page, "state")) === "disarmed");

  // Stop by Space and by Escape, also if the focus is on a button.
  for (const key of ["Space", "Escape"]) {
    await until("it is armed", async () => {
      const now = await state();
      if (now === "fault" || now === "stopped") await page.keyboard.press("k");
      if (now === "disarmed") await page.keyboard.press("a");
      return now === "active";
    });
    await page.locator("#theme").focus();
    await page.keyboard.press(key);
    await until(`${key} stops`, async () => (await state()) === "stopped");
    await until(`${key}: the page shows that it is stopped`, async () => (await text(page, "state")) === "stopped");
    assert.equal(await page.evaluate(() => document.documentElement.dataset.theme), "auto");
  }
  await page.keyboard.press("k");
  await until("k acknowledges", async () => (await state()) === "disarmed");

  await until("the page shows that it may be armed", () => page.locator("#arm").isEnabled());

  // The focus is visible.
  await page.locator("#arm").focus();
  const visited = ["arm"];
  for (let i = 0; i < 9; ++i) {
    await page.keyboard.press("Tab");
    const { id, outline } = await page.evaluate(() => {
      const style = getComputedStyle(document.activeElement);
      return { id: document.activeElement.id, outline: style.outlineStyle !== "none" && Number.parseFloat(style.outlineWidth) >= 2 };
    });
    visited.push(id);
    if (id !== "") assert.ok(outline, `the focus on ${id} is not seen`);
  }
  for (const id of ["arm", "stop", "fit", "theme", "help", "canvas"]) assert.ok(visited.includes(id), `${id} of ${visited}`);
  assert.ok(visited.indexOf("arm") < visited.indexOf("stop") && visited.indexOf("stop") < visited.indexOf("canvas"));

  // The controls of the plots have names and are reached by Tab; the time cursor reads the values to a screen reader.
  await page.locator("#follow").focus();
  const controls = [["span", "combobox", "Span"], ["pause", "button", "Pause plots"], ["fit-values", "button", "Fit values"],
    ["plot-cursor", "slider", "Time cursor of the plots"]];
  for (const [id, role, name] of controls) {
    await page.keyboard.press("Tab");
    assert.equal(await page.evaluate(() => document.activeElement.id), id);
    assert.equal(await page.getByRole(role, { name, exact: true }).getAttribute("id"), id);
  }
  await page.keyboard.press("ArrowLeft");
  await until("the values at the cursor", async () => /norm [\d.]+.* N/.test(await page.locator("#plot-cursor").getAttribute("aria-valuetext")));
  await page.keyboard.press("p");
  assert.equal(await page.getByRole("button", { name: "Resume plots", exact: true }).getAttribute("aria-pressed"), "true");
  assert.ok(await page.getByRole("button", { name: "Unzoom", exact: true }).isEnabled());
  const plotted = () => page.evaluate(() => window.view.plots().window);
  const paused = await plotted(), tick = Number.parseInt(await text(page, "tick"), 10);
  await until("the daemon goes on while the plots rest", async () => Number.parseInt(await text(page, "tick"), 10) > tick + 200);
  assert.deepEqual(await plotted(), paused);
  await page.keyboard.press("0");
  for (const [name, span_s] of [["1 min", 60], ["10 min", 600], ["10 s", 10]]) {
    await page.locator("#span").selectOption(name);
    await until(`${name} until now`, async () => {
      const [from, to] = await plotted();
      return Math.abs(to - from - span_s) < 1e-6 && to > paused[1];
    });
  }
  assert.ok(await page.getByRole("button", { name: "Pause plots", exact: true }).isVisible());

  // Each plot has a text alternative with its values.
  const plots = page.locator("#curves [role=img]");
  assert.equal(await plots.count(), 4);
  await until("the text alternatives", async () => {
    const labels = await plots.evaluateAll((all) => all.map((one) => one.getAttribute("aria-label")));
    return labels.every((label) => /: \w+ -?[\d.]+( to -?[\d.]+)? (N|mN·m|mm|kg·mm²)/.test(label));
  });

  await page.keyboard.press("?");
  await until("the keys are listed", () => page.locator("#keys").isVisible());
  await page.keyboard.press("Enter");
  await until("the list is closed", async () => !(await page.locator("#keys").isVisible()));

  const ground = () => page.evaluate(() => getComputedStyle(document.body).backgroundColor);
  const light = await ground();
  await page.keyboard.press("t");
  await page.keyboard.press("t");
  assert.notEqual(await ground(), light);

  // Nothing is cut off, or wider than the window.
  for (const [width, height] of [[1280, 720], [1920, 1080], [420, 800]]) {
    await page.setViewportSize({ width, height });
    const spills = await page.evaluate(() => {
      const wide = document.documentElement.scrollWidth > innerWidth;
      const outside = [...document.querySelectorAll("button, .state, output, figcaption")].filter((e) => {
        const box = e.getBoundingClientRect();
        return box.width > 0 && (box.left < -1 || box.right > innerWidth + 1);
      });
      return [wide, ...outside.map((e) => e.id || e.className)];
    });
    assert.deepEqual(spills, [false], `${width} x ${height}`);
    if (width > 900) {
      const high = await page.evaluate(() => document.documentElement.scrollHeight <= innerHeight);
      assert.ok(high, `${width} x ${height} has to be scrolled`);
    }
  }
  assert.deepEqual(page.complaints(), []);
});
