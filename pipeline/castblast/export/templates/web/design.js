/* A design: explosive and inputs in SI; its completion, and its form in the link. */
import { network } from "../model.js";
import { completedInputs } from "./rule.js";

export const inputNames = network.inputs.map(({ name }) => name);
const groupTitles = { rock: "Rock", hole: "Hole and charge", bench: "Bench", other: "Other" };

/** Inputs by group, in reading order. */
export function groupedInputs() {
  const groups = new Map();
  for (const role of ["bench", "hole", "rock", "other"]) {
    const found = network.inputs.filter(({ name }) => {
      const own = facts.variables[name]?.role ?? "other";
      return (own in groupTitles ? own : "other") === role;
    });
    if (found.length) groups.set(groupTitles[role], found);
  }
  return groups;
}

/** The design that the page starts with. */
export function firstDesign() {
  const values = Object.fromEntries(network.inputs.map(({ name, example }) => [name, example]));
  return { explosive: network.explosives[0], values };
}

/** All inputs of a design, and the mean burden in front of the hole. */
export function completed({ values }) {
  const full = completedInputs(values);
  full.mean_burden = full.burden + 0.5 * full.bench_height / Math.tan(full.face_angle);
  return full;
}

function written(design, prefix) {
  const parts = [[`${prefix}explosive`, design.explosive]];
  for (const name of inputNames) parts.push([prefix + name, String(design.values[name])]);
  return parts;
}

/** Text after # for a design, the kept one and the units. */
export function toHash(design, kept, system) {
  const parts = written(design, "");
  if (kept) parts.push(...written(kept, "b."));
  parts.push(["units", system]);
  return `#${new URLSearchParams(parts)}`;
}

function readDesign(parameters, prefix) {
  const explosive = parameters.get(`${prefix}explosive`);
  if (!network.explosives.includes(explosive)) return null;
  const values = {};
  for (const name of inputNames) {
    const text = parameters.get(prefix + name);
    const value = text === null || text.trim() === "" ? NaN : Number(text);
    if (!Number.isFinite(value)) return null;
    values[name] = value;
  }
  return { explosive, values };
}

/** Read what `toHash` wrote; what is missing or no design is null. */
export function fromHash(hash) {
  const parameters = new URLSearchParams(hash.replace(/^#/, ""));
  const system = parameters.get("units");
  return {
    design: readDesign(parameters, ""),
    kept: readDesign(parameters, "b."),
    system: Object.hasOwn(systems, system ?? "") ? system : null,
  };
}
