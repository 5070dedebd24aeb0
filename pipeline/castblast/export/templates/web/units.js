/* Units: a quantity is SI inside and shown in the system of the reader. */
const systems = { metric: "Metric", us: "US field", si: "SI" };
const usUnits = {
  "m": ["ft", 1 / 0.3048], "kg m-3": ["lb/ft\u00b3", 1 / 16.01846337396014],
  "m s-1": ["ft/s", 1 / 0.3048], "Pa": ["ksi", 1 / 6894757.293168361],
};
const usSpecial = {
  hole_diameter: ["in", 1 / 0.0254], charge_diameter: ["in", 1 / 0.0254],
  expanded_hole_radius: ["in", 1 / 0.0254], powder_factor: ["lb/yd\u00b3", 0.764554857984 / 0.45359237],
};
const prettyUnits = {
  "kg m-3": "kg/m\u00b3", "m s-1": "m/s", "deg": "\u00b0", "rad": "rad", "us": "\u00b5s", "1": "", "MJ m-1": "MJ/m",
};

/** Unit and factor of a variable in a system: shown = SI * factor. */
export function unitOf(name, system) {
  const variable = facts.variables[name] ?? { unit: "1", shown: "1", factor: 1 };
  const pretty = (unit) => prettyUnits[unit] ?? unit;
  if (system === "si") return { unit: pretty(variable.unit), factor: 1 };
  const us = system === "us" ? usSpecial[name] ?? usUnits[variable.unit] : undefined;
  if (us) return { unit: us[0], factor: us[1] };
  return { unit: pretty(variable.shown), factor: variable.factor };
}

/** A number with `digits` significant digits, without an exponent where people read it. */
export function digits(value, count = 4) {
  if (!Number.isFinite(value)) return "\u2013";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e7 || size < 1e-4) return value.toExponential(count - 1).replace("e+", "e");
  return String(Number(value.toPrecision(count)).toFixed(Math.max(0, count - 1 - Math.floor(Math.log10(size)))));
}

/** A quantity with its unit. */
export function withUnit(name, value, system, count = 4) {
  const { unit, factor } = unitOf(name, system);
  return `${digits(value * factor, count)}${unit && unit !== "\u00b0" ? "\u00a0" : ""}${unit}`;
}

/** A value with figures that its band bears out. */
export const shownValue = (row, system) => withUnit(row.variable, row.value, system, row.exact ? 4 : 3);
/** Ends of the band of a result: two figures where they lie far apart. */
export function shownEnds({ variable, lower, upper }, system) {
  if (!Number.isFinite(lower)) return "no band is stated";
  const count = upper > 1.9 * lower ? 2 : 3;
  return `${digits(lower * unitOf(variable, system).factor, count)} to ${withUnit(variable, upper, system, count)}`;
}

/** A round number of an axis. */
export const tickText = (value) => String(Number(value.toPrecision(4)));
/** Name of a variable in words for people. */
export const titleOf = (name) => sentence(facts.variables[name]?.title ?? spaced(name));
export const percent = (share, count = 2) => `${digits(100 * share, count)}\u00a0%`;
export const sentence = (text) => text.charAt(0).toUpperCase() + text.slice(1);
export const spaced = (name) => name.replaceAll("_", " ");
