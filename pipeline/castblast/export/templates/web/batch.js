/* Many designs: CSV in, CSV out. */
import { network, predictRow } from "../model.js";
import { completed, inputNames } from "./design.js";
import { throwOf } from "./answers.js";
import { refusals } from "./rule.js";

/** Records of a CSV text; quotes, and comma or semicolon. */
export function parseCsv(text) {
  const separator = (text.split("\n", 1)[0].match(/;/g) ?? []).length > 0 ? ";" : ",";
  const records = [];
  let record = [], field = "", quoted = false;
  const close = () => { record.push(field.trim()); field = ""; };
  const finish = () => { close(); if (record.some((cell) => cell !== "")) records.push(record); record = []; };
  for (let i = 0; i < text.length; i += 1) {
    const c = text[i];
    if (quoted) {
      if (c !== '"') field += c;
      else if (text[i + 1] === '"') { field += '"'; i += 1; } else quoted = false;
    } else if (c === '"') quoted = true;
    else if (c === separator) close();
    else if (c === "\n") finish();
    else if (c !== "\r") field += c;
  }
  finish();
  return records;
}

/* Factor to SI of a heading such as "ucs [MPa]"; without a unit it is SI; null: not known. */
function headingFactor(name, unit) {
  if (unit === undefined || unit === "" || unit === facts.variables[name].unit) return 1;
  const systemOfUnit = Object.keys(systems).find((system) => unitOf(name, system).unit === unit);
  if (systemOfUnit) return 1 / unitOf(name, systemOfUnit).factor;
  return unit === "deg" && facts.variables[name].unit === "rad" ? Math.PI / 180 : null;
}

function readHeading(cells) {
  const faults = [];
  const columns = cells.map((cell) => {
    const [, name, unit] = cell.replace(/^\ufeff/, "").match(/^\s*([^[\]]*?)\s*(?:\[(.*)\])?\s*$/) ?? [];
    if (name === "explosive" || !inputNames.includes(name)) return { name };
    const factor = headingFactor(name, unit);
    if (factor === null) faults.push(`column ${name}: unit [${unit}] is not known`);
    return { name, factor };
  });
  for (const name of ["explosive", ...inputNames]) {
    if (!columns.some((column) => column.name === name)) faults.push(`column ${name} is missing`);
  }
  return { columns, faults };
}

/** Answer a CSV text: heading and rows of the result, and faults by line. */
export function answerBatch(text) {
  const [heading, ...records] = parseCsv(text);
  if (!heading) return { header: [], rows: [], faults: ["the file is empty"] };
  const { columns, faults } = readHeading(heading);
  const outputHeads = network.outputs.flatMap(({ name, unit }) => [`${name} [${unit}]`, `${name}_prediction_lower [${unit}]`, `${name}_prediction_upper [${unit}]`]);
  const thrown = ["free_flight_distance [m]", "throw_distance [m]", "throw_distance_prediction_lower [m]", "throw_distance_prediction_upper [m]"];
  const header = ["explosive", ...network.inputs.map(({ name, unit }) => `${name} [${unit}]`), ...outputHeads, ...thrown, "domain", "inputs_at_fault"];
  if (faults.length) return { header, rows: [], faults };
  const speedAt = network.outputs.findIndex(({ name }) => name === "burden_velocity");
  const rows = [];
  records.forEach((cells, i) => {
    const given = {};
    columns.forEach(({ name, factor }, j) => { given[name] = name === "explosive" || factor === undefined ? cells[j] : cells[j] ? Number(cells[j]) * factor : NaN; });
    const position = network.explosives.indexOf(given.explosive);
    const wrong = inputNames.filter((name) => !(given[name] > 0 || given[name] === 0) || !Number.isFinite(given[name]));
    if (position < 0) faults.push(`line ${i + 2}: explosive "${given.explosive ?? ""}" is not one of ${network.explosives.join(", ")}`);
    if (wrong.length) faults.push(`line ${i + 2}: no number of at least 0 in ${wrong.join(", ")}`);
    if (position < 0 || wrong.length) return;
    const impossible = refusals({ values: Object.fromEntries(inputNames.map((name) => [name, given[name]])) }, "metric");
    faults.push(...impossible.map((reason) => `line ${i + 2}: ${reason}`));
    if (impossible.length) return;
    const row = inputNames.map((name) => given[name]);
    const answer = predictRow(position, row);
    const height = completed({ values: given }).bench_height;
    const way = speedAt < 0 ? ["", "", "", ""] : Object.values(throwOf(answer.values[speedAt], height));
    rows.push([given.explosive, ...row, ...network.outputs.flatMap((_, k) => [answer.values[k], known(answer.predictionLower[k]), known(answer.predictionUpper[k])]), ...way, answer.domain, inputNames.filter((_, k) => answer.offending[k]).join(" ")]);
  });
  return { header, rows, faults };
}

const known = (value) => (Number.isNaN(value) ? "" : value);
/** CSV text of a heading and rows. */
export const csvText = (header, rows) => [header, ...rows].map((row) => row.join(",")).join("\n") + "\n";

/** A file to start from: this design and its explosives. */
export function batchTemplate(design) {
  const header = ["explosive", ...network.inputs.map(({ name, unit }) => `${name} [${unit}]`)];
  return csvText(header, network.explosives.map((kind) => [kind, ...inputNames.map((name) => design.values[name])]));
}
