/* The pictures of a design. */
import { completed } from "./design.js";
import { historyOf } from "./histories.js";
import { canvas, htmlNode, label, line, path, scaleOf, svgNode, ticks } from "./drawing.js";

/* Time until which the curve is drawn: 1.8 times the last moment that is 3 percent off its end. */
function shownTime({ time, pressure }) {
  const off = pressure.findLastIndex((p) => Math.abs(p / pressure.at(-1) - 1) > 0.03);
  return Math.min(time.at(-1), 1.8 * time[Math.max(off, 1)]);
}

/** Gas pressure over time with its band; the kept design dashed. */
export function pressureFigure(design, kept, system) {
  const curve = historyOf(design.explosive, completed(design));
  if (!curve) return null;
  const other = kept && historyOf(kept.explosive, completed(kept));
  const [W, H, left, right, top, bottom] = [420, 270, 40, 10, 14, 40];
  const time = unitOf("equilibrium_time", system);
  const pressure = system === "metric" ? { unit: "GPa", factor: 1e-9 } : unitOf("equilibrium_pressure", system);
  const end = shownTime(curve) * time.factor;
  const most = 1.05 * Math.max(...curve.upper, ...(other ? other.pressure : [])) * pressure.factor;
  const x = scaleOf(0, end, left, W - right);
  const y = scaleOf(0, most, H - bottom, top);
  const svg = canvas(W, H, `Gas pressure in the hole over time: peak ${digits(Math.max(...curve.pressure) * pressure.factor, 3)} ${pressure.unit}, end ${digits(curve.pressure.at(-1) * pressure.factor, 3)} ${pressure.unit} after ${digits(end, 3)} ${time.unit}`);
  for (const t of ticks(0, most, 5)) svg.append(line(left, y(t), W - right, y(t), "grid"), label(left - 7, y(t) + 4, tickText(t), "end"));
  for (const t of ticks(0, end, 6)) svg.append(line(x(t), H - bottom, x(t), H - bottom + 4, "axis"), label(x(t), H - bottom + 18, tickText(t), "middle"));
  const points = (c, key) => c.time.map((t, i) => [x(t * time.factor), y(c[key][i] * pressure.factor)]).filter(([place]) => place <= W - right);
  svg.append(path([...points(curve, "upper"), ...points(curve, "lower").reverse()], "band", true));
  if (other) svg.append(path(points(other, "pressure"), "curve kept"));
  svg.append(path(points(curve, "pressure"), "curve"), line(left, H - bottom, W - right, H - bottom, "axis"));
  svg.append(label(W - right, H - 5, `time [${time.unit}]`, "end", "axis-name"), label(left + 6, top + 9, `pressure [${pressure.unit}]`, "start", "axis-name"));
  return { svg, inside: curve.inside };
}

/** Energy shares with bands as bars. */
export function energyFigure(design) {
  const curve = historyOf(design.explosive, completed(design));
  if (!curve) return null;
  const shares = [...curve.shares].sort((a, b) => b.value - a.value);
  const [W, row, left] = [420, 36, 2];
  const most = Math.max(...shares.map(({ upper }) => upper)) * 1.75;
  const x = scaleOf(0, most, left, W - 8);
  const svg = canvas(W, shares.length * row + 4, `Energy of the explosive: ${shares.map((s) => `${s.title} ${percent(s.value, 2)}`).join(", ")}`);
  shares.forEach((share, i) => {
    const y = i * row;
    const value = Math.max(0, share.value);
    const shown = (part) => (100 * part).toFixed(Math.min(3, Math.max(1, Math.ceil(-Math.log10(100 * share.band)))));
    svg.append(
      label(left, y + 12, sentence(share.title), "start", "bar-name"),
      svgNode("rect", { x: left, y: y + 17, width: Math.max(0.5, x(value) - left).toFixed(1), height: 9, rx: 1.5, class: share.name === "gas_energy" ? "bar gas" : "bar" }),
      line(x(share.lower), y + 21.5, x(share.upper), y + 21.5, "whisker"),
      label(x(share.upper) + 7, y + 25.5, `${shown(value)}\u00a0% (${shown(share.lower)} to ${shown(share.upper)})`, "start", "bar-value"),
    );
  });
  return { svg };
}

/** The hole and what became of it, to scale. */
export function holeFigure(result, system) {
  const by = Object.fromEntries(result.rows.map((r) => [r.key, r]));
  const { full } = result;
  const crushed = by.crushed_zone_radius?.value ?? 0;
  const expanded = by.expanded_hole_radius?.value ?? 0;
  const outer = Math.max(crushed, expanded, full.hole_diameter / 2) * 1.08;
  const [W, H] = [300, 250];
  const f = 112 / outer;
  const svg = canvas(W, H, `Cross-section of the hole: drilled ${withUnit("hole_diameter", full.hole_diameter / 2, system, 3)}, expanded ${withUnit("expanded_hole_radius", expanded, system, 3)}, crushed to ${withUnit("crushed_zone_radius", crushed, system, 3)} radius`);
  const circle = (r, kind) => svgNode("circle", { cx: W / 2, cy: 125, r: (r * f).toFixed(2), class: kind });
  svg.append(circle(crushed, "crushed"), circle(expanded, "expanded"), circle(full.hole_diameter / 2, "drilled"));
  return { svg, legend: [
    ["crushed", "Crushed zone", crushed, by.crushed_zone_radius, "crushed_zone_radius"],
    ["expanded", "Expanded hole", expanded, by.expanded_hole_radius, "expanded_hole_radius"],
    ["drilled", "Drilled hole", full.hole_diameter / 2, null, "hole_diameter"],
  ] };
}

/** Bench from the side to scale, with the flight of crest, middle and toe blocks. */
export function benchFigure(result, system) {
  const by = Object.fromEntries(result.rows.map((r) => [r.key, r]));
  const speed = by.burden_velocity;
  if (!speed) return null;
  const { full } = result;
  const h = full.bench_height;
  const lean = h / Math.tan(full.face_angle);
  const reach = (v, z) => v * Math.sqrt((2 * z) / 9.81);
  const back = 1.6 * full.burden + 0.12 * h;
  const way = by.throw_distance;
  const front = lean + full.burden + Math.max(reach(speed.upper, h), way.upper) * 1.04 + 0.05 * h;
  const [W, top, bottom] = [900, 26, 44];
  const f = Math.min((W - 20) / (back + front), 330 / h);
  const shift = (W - f * (back + front)) / 2;
  const X = (x) => shift + f * (x + back);
  const Z = (z) => top + f * (h - z);
  const H = top + f * h + bottom;
  const svg = canvas(W, Math.ceil(H), `Side view of the bench, ${withUnit("bench_height", h, system, 3)} high, burden ${withUnit("burden", full.burden, system, 3)}; thrown level at ${withUnit("burden_velocity", speed.value, system, 3)}, its mean comes to rest ${shownValue(way, system)} further, ${shownEnds(way, system)}`);
  const toe = full.burden + lean;
  svg.append(
    path([[X(-back), Z(h)], [X(0), Z(h)], [X(0), Z(0)], [X(-back), Z(0)]], "solid", true),
    path([[X(0), Z(h)], [X(full.burden), Z(h)], [X(toe), Z(0)], [X(0), Z(0)]], "thrown", true),
    line(0, Z(0), W, Z(0), "ground"),
  );
  const half = Math.max(1.6, (f * full.hole_diameter) / 2);
  const hole = (from, to, kind) => svg.append(svgNode("rect", { x: X(0) - half, y: Z(from), width: 2 * half, height: Math.max(0, Z(to) - Z(from)), class: kind }));
  hole(h, h - full.stemming_length, "stemming");
  hole(h - full.stemming_length, h - full.stemming_length - full.charge_length, "charge");
  for (const share of [1, 0.5]) {
    const z0 = share * h;
    const x0 = full.burden + (1 - share) * lean;
    const flight = (v, n = 40) => Array.from({ length: n + 1 }, (_, k) => {
      const t = (k / n) * Math.sqrt((2 * z0) / 9.81);
      return [X(x0 + v * t), Z(z0 - 0.5 * 9.81 * t * t)];
    });
    svg.append(path([...flight(speed.lower), ...flight(speed.upper).reverse()], "arc-band", true), path(flight(speed.value), share === 1 ? "arc" : "arc thin"));
  }
  const middle = full.burden / 2 + lean / 4;
  svg.append(
    line(X(middle), Z(0) + 12, X(middle + way.value), Z(0) + 12, "measure"),
    line(X(middle + way.lower), Z(0) + 12, X(middle + way.upper), Z(0) + 12, "whisker"),
    svgNode("circle", { cx: X(middle + way.value), cy: Z(0) + 12, r: 4, class: "landing" }),
    label(X(middle + way.value / 2), Z(0) + 32, `mean throw ${shownValue(way, system)} (${shownEnds(way, system)})`, "middle", "note"),
    label(X(0) - 8, Z(h) - 8, "hole", "middle", "note"),
  );
  return { svg };
}

/** Tornado: velocity over the part of each input's range that stays in the domain; the band shaded. */
export function tornadoFigure(lines, speed, system) {
  const { unit, factor } = unitOf("burden_velocity", system);
  const shown = lines.filter(({ low }) => low);
  if (!shown.length) return null;
  const [W, row, left, right, top] = [420, 42, 6, 8, 6];
  const low = Math.min(speed.lower, ...shown.map((l) => l.low.value)) * factor;
  const high = Math.max(speed.upper, ...shown.map((l) => l.high.value)) * factor;
  const x = scaleOf(0.9 * low, 1.05 * high, left, W - right);
  const bottom = top + shown.length * row;
  const svg = canvas(W, bottom + 40, `Velocity over the range of each input: ${shown.map((l) => `${spaced(l.name)} ${digits(l.low.value * factor, 3)} to ${digits(l.high.value * factor, 3)} ${unit}`).join(", ")}`);
  const ends = [x(speed.lower * factor), x(speed.upper * factor)];
  svg.append(path([[ends[0], top], [ends[1], top], [ends[1], bottom], [ends[0], bottom]], "band", true));
  for (const t of ticks(0.9 * low, 1.05 * high, 6)) svg.append(line(x(t), top, x(t), bottom, "grid"), label(x(t), bottom + 16, tickText(t), "middle"));
  shown.forEach((l, i) => {
    const y = top + i * row;
    const [a, b] = [x(l.low.value * factor), x(l.high.value * factor)];
    svg.append(
      svgNode("rect", { x: a, y: y + 19, width: Math.max(1, b - a), height: 11, rx: 1.5, class: "bar" }),
      label(left, y + 13, titleOf(l.name), "start", "bar-name"),
      label(W - right, y + 13, `${withUnit(l.name, l.low.x, system, 3)} \u2192 ${withUnit(l.name, l.high.x, system, 3)}`, "end", "tick"),
    );
  });
  svg.append(line(x(speed.value * factor), top, x(speed.value * factor), bottom, "now"), label(W - right, bottom + 33, `burden velocity [${unit}]`, "end", "axis-name"));
  return { svg };
}

/** Put a figure into its place, or say why there is none. */
export function place(id, figure, otherwise) {
  const box = document.getElementById(id);
  box.replaceChildren(figure ? figure.svg : htmlNode("p", { class: "missing" }, otherwise));
}
