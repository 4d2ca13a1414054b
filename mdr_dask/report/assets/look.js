"use strict";
// Functions that the scripts of this page share: colours with enough contrast to the background, numbers and texts.
const report = {};
(() => {
  const LIGHT = { ink: "#1b1f24", soft: "#57606a", paper: "#ffffff", grid: "#e2e6ea", line: "#8b949e" };
  const DARK = { ink: "#e6e9ed", soft: "#a5adb6", paper: "#15181c", grid: "#2c3238", line: "#6e7681" };
  const LEAST_CONTRAST = 3; // of lines and markers to the background, as WCAG 2.1 requires for graphics
  const dark = matchMedia("(prefers-color-scheme: dark)");

  report.light = LIGHT;
  report.dark = dark;
  report.printing = false;
  report.palette = () => (dark.matches && !report.printing ? DARK : LIGHT);

  const channels = (hex) => [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16));
  const luminance = (hex) => {
    const [red, green, blue] = channels(hex).map((value) => {
      const part = value / 255;
      return part <= 0.04045 ? part / 12.92 : ((part + 0.055) / 1.055) ** 2.4;
    });
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue;
  };
  report.contrast = (one, other) => {
    const [high, low] = [luminance(one), luminance(other)].sort((a, b) => b - a);
    return (high + 0.05) / (low + 0.05);
  };
  const mixed = (one, other, part) => {
    const [from, to] = [channels(one), channels(other)];
    return "#" + from.map((value, k) => Math.round(value + part * (to[k] - value)).toString(16).padStart(2, "0")).join("");
  };

  // Return a colour of a figure, changed towards the text colour until its contrast to the background is sufficient.
  report.legible = (hex, palette) => {
    let found = hex;
    for (let part = 0.1; report.contrast(found, palette.paper) < LEAST_CONTRAST && part < 1; part += 0.1) found = mixed(hex, palette.ink, part);
    return found;
  };
  report.shade = (colours, part) => colours[Math.max(0, Math.min(colours.length - 1, Math.round(part * (colours.length - 1))))];

  report.escaped = (text) => String(text).replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;").replace(/"/g, "&quot;");

  report.number = (value) => {
    if (value === null || value === undefined) return "-";
    if (typeof value !== "number") return String(value);
    const size = Math.abs(value);
    const text = size !== 0 && (size >= 1e5 || size < 1e-3) ? value.toExponential(4) : value.toPrecision(5);
    return text.includes("e") ? text.replace(/\.?0*e/, "e").replace("e+", "e") : text.includes(".") ? text.replace(/\.?0+$/, "") : text;
  };

  // Create an element. Texts of a store become text nodes or attributes and are never read as markup.
  report.element = (tag, attributes = {}, ...children) => {
    const made = document.createElement(tag);
    for (const [name, value] of Object.entries(attributes)) {
      if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
      else if (value !== false && value !== null && value !== undefined) made.setAttribute(name, value === true ? "" : value);
    }
    made.append(...children);
    return made;
  };

  // Return a label as elements. Only sub and sup elements are kept, the only ones in labels of this page.
  report.labelled = (html) => {
    const parts = document.createDocumentFragment();
    const read = new DOMParser().parseFromString(html, "text/html").body;
    const copy = (from, to) => {
      for (const node of from.childNodes) {
        if (node.nodeType === Node.TEXT_NODE) to.append(node.data);
        else if (["SUB", "SUP"].includes(node.nodeName)) to.append(copy(node, document.createElement(node.nodeName)));
        else to.append(node.textContent);
      }
      return to;
    };
    return copy(read, parts);
  };

  report.saved = (name, content, type) => {
    const address = URL.createObjectURL(content instanceof Blob ? content : new Blob([content], { type }));
    const link = report.element("a", { href: address, download: name });
    document.body.append(link);
    link.click();
    link.remove();
    setTimeout(() => URL.revokeObjectURL(address), 10000);
  };
})();
