/* Many designs: a table in, CSV out. */
import { network, predictRow } from "../model.js";
import { completed, inputNames } from "./design.js";
import { throwOf } from "./answers.js";
import { completedInputs, refusals } from "./rule.js";
import { csvCell, plainHead, readTable } from "./table.js";

/* Inputs that a table may give; those that the network cannot see must say what it was trained on. */
const tableInputs = [...new Set([...inputNames, ...Object.keys(facts.rule.defaults), ...facts.rule.completions.map(({ name }) => name)])];

function explosiveOf(text) {
  const name = text === "" ? "anfo" : network.explosives.includes(text) ? text : facts.table.explosives[plainHead(text)];
  return network.explosives.indexOf(name);
}

/* Inputs of the network of one row: given, else completed from the row itself; reasons against it. */
function designOf(values) {
  const full = completedInputs(values);
  const own = Object.fromEntries(inputNames.map((name) => [name, full[name]]));
  const expected = completedInputs(own);
  const reasons = refusals({ values: own }, "metric");
  for (const name of Object.keys(values)) {
    if (inputNames.includes(name)) continue;
    const apart = Math.abs(values[name] - expected[name]);
    if (apart > 1e-9 * Math.abs(expected[name]) + 1e-12) reasons.push(`${spaced(name)} ${withUnit(name, values[name], "metric")}: this network was trained on ${withUnit(name, expected[name], "metric")}`);
  }
  return { own, reasons };
}

/** Answer a table: heading and rows of the result, and faults by line. */
export function answerBatch(text) {
  const { rows: given, idHead, faults } = readTable(text, tableInputs);
  const outputHeads = network.outputs.flatMap(({ name, unit }) => [`${name} [${unit}]`, `${name}_prediction_lower [${unit}]`, `${name}_prediction_upper [${unit}]`]);
  const thrown = ["free_flight_distance [m]", "throw_distance [m]", "throw_distance_prediction_lower [m]", "throw_distance_prediction_upper [m]"];
  const header = [...(idHead === null ? [] : [idHead]), "explosive", ...network.inputs.map(({ name, unit }) => `${name} [${unit}]`), ...outputHeads, ...thrown, "domain", "inputs_at_fault"];
  const speedAt = network.outputs.findIndex(({ name }) => name === "burden_velocity");
  const rows = [];
  for (const { place, id, explosive, values } of given) {
    const position = explosiveOf(explosive);
    if (position < 0) {
      faults.push(`${place}: explosive '${explosive || "anfo"}' is not one of ${network.explosives.join(", ")}`);
      continue;
    }
    const { own, reasons } = designOf(values);
    faults.push(...reasons.map((reason) => `${place}: ${reason}`));
    if (reasons.length) continue;
    const row = inputNames.map((name) => own[name]);
    const answer = predictRow(position, row);
    const height = completed({ values: own }).bench_height;
    const way = speedAt < 0 ? ["", "", "", ""] : Object.values(throwOf(answer.values[speedAt], height));
    rows.push([...(idHead === null ? [] : [id]), network.explosives[position], ...row, ...network.outputs.flatMap((_, k) => [answer.values[k], known(answer.predictionLower[k]), known(answer.predictionUpper[k])]), ...way, answer.domain, inputNames.filter((_, k) => answer.offending[k]).join(" ")]);
  }
  return { header, rows, faults };
}

const known = (value) => (Number.isNaN(value) ? "" : value);
/** CSV text of a heading and rows. */
export const csvText = (header, rows) => [header, ...rows].map((row) => row.map(csvCell).join(",")).join("\n") + "\n";

/** A file to start from: this design and its explosives. */
export function batchTemplate(design) {
  const header = ["explosive", ...network.inputs.map(({ name, unit }) => (unit === "1" ? name : `${name} [${unit}]`))];
  return csvText(header, network.explosives.map((kind) => [kind, ...inputNames.map((name) => design.values[name])]));
}
