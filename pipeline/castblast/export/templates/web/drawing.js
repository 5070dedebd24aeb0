/* SVG by hand: elements, ticks, axes. */
const svgSpace = "http://www.w3.org/2000/svg";

/** An SVG element with attributes and children. */
export function svgNode(tag, attributes = {}, ...children) {
  const node = document.createElementNS(svgSpace, tag);
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  node.append(...children);
  return node;
}

/** An HTML element with attributes and children. */
export function htmlNode(tag, attributes = {}, ...children) {
  const node = document.createElement(tag);
  for (const [key, value] of Object.entries(attributes)) {
    if (value !== false && value !== null) node.setAttribute(key, value === true ? "" : value);
  }
  node.append(...children);
  return node;
}

/** A picture of a given size that scales, with a description for those who do not see it. */
export function canvas(width, height, description) {
  const svg = svgNode("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": description });
  svg.append(svgNode("title", {}, description));
  return svg;
}

export const label = (x, y, text, anchor = "start", kind = "tick") =>
  svgNode("text", { x: x.toFixed(1), y: y.toFixed(1), "text-anchor": anchor, class: kind }, text);

export const path = (points, kind, closed = false) => svgNode("path", {
  class: kind, d: points.map(([x, y], i) => `${i ? "L" : "M"}${x.toFixed(2)} ${y.toFixed(2)}`).join("") + (closed ? "Z" : ""),
});

export const line = (x1, y1, x2, y2, kind) => svgNode("line", { x1, y1, x2, y2, class: kind });

/** Round values between two ends, about `count` of them. */
export function ticks(low, high, count = 5) {
  const raw = (high - low) / count;
  if (!(raw > 0)) return [low];
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= raw);
  const found = [];
  for (let k = Math.ceil(low / step); k * step <= high * (1 + 1e-12); k += 1) found.push(Number((k * step).toPrecision(10)));
  return found;
}

/** Straight scale from data to picture. */
export const scaleOf = (from, to, start, end) => (x) => start + ((x - from) / (to - from)) * (end - start);
