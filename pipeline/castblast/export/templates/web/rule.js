/* The rule of a design, which comes as data from castblast.design.rule: what completes and refuses one. */
import { network } from "../model.js";

const ruleField = /\{(?:([\d.]+)\*)?(\w+)(?::(\w+))?\}/g;
const longNames = /\b[a-z]+(?:_[a-z]+)+\b/g;
/* Inputs that follow the burden alone: their ratio to it is what a blaster keeps. */
const followers = facts.rule.completions
  .filter(({ terms }) => Object.keys(terms).join() === "burden").map(({ name }) => name);

function summed(terms, full) {
  const parts = Object.entries(terms).map(([name, factor]) => factor * full[name]);
  return { total: parts.reduce((sum, part) => sum + part), size: Math.max(...parts.map(Math.abs)) };
}

/** All inputs of a design: given, else held in training, else completed. */
export function completedInputs(values) {
  const full = { ...facts.rule.defaults, ...facts.held, ...values };
  for (const { name, terms, unless } of facts.rule.completions) {
    if (full[name] !== undefined || full[unless] !== undefined) continue;
    const { total, size } = summed(terms, full);
    full[name] = Math.abs(total) <= facts.rule.round_off * size ? 0 : total;
  }
  return full;
}

/** Why no bench can hold a design, in words; empty if one can. */
export function refusals({ values }, system) {
  const reasons = [];
  for (const { name } of network.inputs) {
    const variable = facts.variables[name];
    if (!variable) continue;
    const margin = 1e-12 * Math.max(Math.abs(variable.lower), Math.abs(variable.upper));
    if (values[name] >= variable.lower - margin && values[name] <= variable.upper + margin) continue;
    reasons.push(`${titleOf(name)} ${withUnit(name, values[name], system)} is not plausible: ${withUnit(name, variable.lower, system)} to ${withUnit(name, variable.upper, system)}`);
  }
  const full = completedInputs(values);
  for (const { terms, message, given } of facts.rule.rules) {
    const { total, size } = summed(terms, full);
    if (!given.every((name) => values[name] !== undefined) || !(total < -facts.rule.round_off * size)) continue;
    const text = message.replace(longNames, (name) => (name in facts.variables ? spaced(name) : name));
    reasons.push(sentence(ruleWords(message, text, full, system)));
  }
  return reasons;
}

/* Fields are put in by their place: the spelling of names outside them has changed. */
function ruleWords(message, text, full, system) {
  const fields = [...message.matchAll(ruleField)];
  let i = 0;
  return text.replace(/\{[^}]*\}/g, () => {
    const [, factor, name, as] = fields[i];
    i += 1;
    return withUnit(as ?? name, Number(factor ?? 1) * full[name], system);
  });
}

/** Ratios to the burden of what follows it. */
export function ratiosOf({ values }) {
  const full = completedInputs(values);
  return Object.fromEntries(followers.map((name) => [name, full[name] / full.burden]));
}

/** Values of a design at another burden, with the ratios kept. */
export function valuesAtBurden({ values }, burden, ratios) {
  const moved = { ...values, burden };
  for (const name of followers) if (values[name] !== undefined) moved[name] = ratios[name] * burden;
  if (values.charge_length !== undefined && values.stemming_length === undefined) {
    moved.charge_length = completedInputs(values).bench_height - ratios.stemming_length * burden;
  }
  return moved;
}
