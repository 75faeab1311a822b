// SPDX-License-Identifier: GPL-3.0-or-later
// The look of all plots: colours of the theme, axes, size.

export const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

export const axis = (more = {}) => ({
  stroke: () => css("--muted"),
  grid: { stroke: () => css("--line"), width: 1 },
  ticks: { show: false },
  font: "11px system-ui, sans-serif",
  ...more,
});

export const sizeOf = (box) => ({ width: Math.max(box.clientWidth, 60), height: Math.max(box.clientHeight, 40) });
