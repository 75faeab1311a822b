// SPDX-License-Identifier: GPL-3.0-or-later
// Finds and makes elements of the page.
export const $ = (id) => document.getElementById(id);

export const make = (tag, properties = {}, ...children) => {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(...children);
  return element;
};
