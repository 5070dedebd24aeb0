/* A table of designs as people save it: what castblast.specs.tables.table reads is read here too. */
const numberForm = /^[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?$/;
const commaForm = /^[+-]?\d*,\d+(?:[eE][+-]?\d+)?$/;
const remarkForm = /^\s*(?:#|\/\/)/;

/** Text of a file in UTF-8, UTF-16 with a mark, or Windows-1252. */
export function decoded(buffer) {
  const bytes = new Uint8Array(buffer);
  if (bytes[0] === 0xff && bytes[1] === 0xfe) return new TextDecoder("utf-16le").decode(bytes);
  if (bytes[0] === 0xfe && bytes[1] === 0xff) return new TextDecoder("utf-16be").decode(bytes);
  try {
    return new TextDecoder("utf-8", { fatal: true }).decode(bytes);
  } catch {
    return new TextDecoder("windows-1252").decode(bytes);
  }
}

/** Head without what people write in many ways: case, blanks, dashes, dots, underscores. */
export const plainHead = (head) => head.trim().toLowerCase().replace(/[\s_\-.:/]+/g, "_").replace(/^_+|_+$/g, "");

function separatorOf(head) {
  const outside = head.replace(/"[^"]*"|\[[^\]]*\]|\([^)]*\)/g, "");
  return [";", "\t", ","].find((separator) => outside.includes(separator)) ?? ",";
}

/** Records of a table, each with its line, and what separates the cells; remarks and blank rows are left out. */
export function parseTable(text) {
  const records = [];
  let separator = null, record = [], field = "", quoted = false, line = 1, start = 1;
  const close = () => { record.push(field.trim()); field = ""; };
  const finish = () => {
    close();
    if (record.some((cell) => cell !== "")) records.push({ line: start, cells: record });
    record = [];
  };
  const whole = text.replace(/^\ufeff/, "").replace(/\r\n?/g, "\n");
  let i = 0;
  const restOfLine = () => { const end = whole.indexOf("\n", i); return whole.slice(i, end < 0 ? whole.length : end); };
  for (; i < whole.length; i += 1) {
    if (!quoted && !record.length && field === "" && (i === 0 || whole[i - 1] === "\n")) {
      start = line;
      const rest = restOfLine();
      const said = separator === null && rest.match(/^sep=([;,\t|])\s*$/i);
      if (remarkForm.test(rest) || said) {
        if (said) [, separator] = said;
        i += rest.length;
        line += 1;
        continue;
      }
      if (separator === null && rest.trim() !== "") separator = separatorOf(rest);
    }
    const c = whole[i];
    if (c === "\n") line += 1;
    if (quoted) {
      if (c !== '"') field += c;
      else if (whole[i + 1] === '"') { field += '"'; i += 1; } else quoted = false;
    } else if (c === '"' && field.trim() === "") { quoted = true; field = ""; }
    else if (c === separator) close();
    else if (c === "\n") finish();
    else field += c;
  }
  finish();
  return { records, separator: separator ?? "," };
}

/** Factor to SI of a unit of a variable; null: not one of its units. */
export function unitFactor(name, unit) {
  const own = facts.variables[name].unit;
  const known = facts.table.units[own] ?? {};
  if (Object.hasOwn(known, unit)) return known[unit];
  if (unit === own || (own === "1" && unit === "")) return 1;
  const system = Object.keys(systems).find((key) => unitOf(name, key).unit === unit);
  return system ? 1 / unitOf(name, system).factor : null;
}

/** Number of a cell in SI, NaN for a blank one; what is none throws. */
function cellNumber(cell, { name, unit, factor }, separator, signs) {
  if (cell === "") return NaN;
  const [, digits, behind] = cell.match(/^([+-]?[\d.,]+(?:[eE][+-]?\d+)?)\s*([^\d\s].*)?$/) ?? [];
  let text = digits ?? cell, scale = factor;
  if (behind !== undefined) {
    scale = unit === "" ? unitFactor(name, behind) : null;
    if (scale === null) throw new Error("a number is needed");
  } else if (unit === "" && facts.variables[name].unit !== "1") throw new Error(`no unit given, such as ${facts.variables[name].unit}`);
  if (separator !== "," && commaForm.test(text)) { signs.comma = true; text = text.replace(",", "."); }
  else if (text.includes(".")) signs.point = true;
  if (!numberForm.test(text)) throw new Error(text.includes(",") ? "a number is needed, without thousands separators" : "a number is needed");
  if (signs.comma && signs.point) throw new Error("a comma beside decimal points; write numbers without thousands separators");
  return Number(text) * scale;
}

function readHead(cell, names) {
  const [, written, square, round] = cell.match(/^([^[(]*?)\s*(?:\[([^\]]*)\]|\((.*)\))?$/) ?? [null, cell];
  const plain = plainHead(written);
  const name = names.find((known) => known === written || plainHead(known) === plain);
  const kind = name === "explosive" ? "text" : name ? "number" : facts.table.ids.includes(plain) ? "id" : plain ? "unknown" : "blank";
  return { head: cell, name: name ?? written, kind, unit: (square ?? round ?? "").trim(), factor: 1 };
}

/* Units that stand in a second row of heads. */
function takeUnitRow(columns, record) {
  const given = columns.map((column, j) => ({ column, unit: (record?.cells[j] ?? "").replace(/^[[(]|[\])]$/g, "").trim() }))
    .filter(({ column, unit }) => column.kind === "number" && unit && facts.variables[column.name].unit !== "1");
  if (!given.length || given.some(({ column, unit }) => column.unit || /^[\d.,+-]/.test(unit))) return false;
  if (given.every(({ column, unit }) => unitFactor(column.name, unit) === null)) return false;
  for (const { column, unit } of given) column.unit = unit;
  return true;
}

/** Rows of a table: line, id, explosive and numbers in SI by name (what is blank is left out); faults by line. */
export function readTable(text, names) {
  const { records, separator } = parseTable(text);
  const faults = [];
  if (!records.length) return { rows: [], idHead: null, faults: ["the file is empty"] };
  const [{ line, cells }, ...rest] = records;
  while (cells.length && cells.at(-1) === "") cells.pop();
  const columns = cells.map((cell) => readHead(cell, ["explosive", ...names]));
  if (columns[0].kind === "blank") columns[0].kind = "id";
  const seen = new Set();
  for (const { head, name, kind } of columns) {
    const key = kind === "id" ? "an id" : name;
    if (kind === "unknown") faults.push(`line ${line}: column '${head}': unknown column`);
    if (kind !== "blank" && seen.has(key)) faults.push(`line ${line}: column '${head}': given twice`);
    seen.add(key);
  }
  if (takeUnitRow(columns, rest[0])) rest.shift();
  for (const column of columns) {
    if (column.kind !== "number" || column.unit === "") continue;
    column.factor = unitFactor(column.name, column.unit);
    if (column.factor === null) faults.push(`line ${line}: column '${column.head}': unit '${column.unit}' is not known`);
  }
  if (!rest.length && !faults.length) faults.push("holds heads only; at least one row is needed");
  const idAt = columns.findIndex(({ kind }) => kind === "id");
  const idHead = idAt < 0 ? null : columns[idAt].name || "row";
  if (faults.length) return { rows: [], idHead, faults };
  const signs = { comma: false, point: false };
  const rows = rest.map((record) => readRow(record, columns, idAt, separator, signs, faults)).filter((row) => row !== null);
  return { rows, idHead, faults };
}

function readRow({ line, cells }, columns, idAt, separator, signs, faults) {
  const place = `line ${line}${idAt >= 0 && cells[idAt] ? ` (${columns[idAt].name || "row"} '${cells[idAt]}')` : ""}`;
  if (cells.length < columns.length || cells.slice(columns.length).some((cell) => cell !== "")) {
    faults.push(`line ${line}: ${cells.length} cells for ${columns.length} heads`);
    return null;
  }
  const row = { line, place, id: idAt < 0 ? null : cells[idAt], explosive: "", values: {} };
  const before = faults.length;
  columns.forEach((column, j) => {
    if (column.kind === "text") row.explosive = cells[j];
    else if (column.kind === "blank" && cells[j] !== "") faults.push(`line ${line}: '${cells[j]}' has no head`);
    if (column.kind !== "number") return;
    try {
      const value = cellNumber(cells[j], column, separator, signs);
      if (!Number.isNaN(value)) row.values[column.name] = value;
    } catch (fault) {
      faults.push(`${place}: ${column.name}: ${cells[j]}: ${fault.message}`);
    }
  });
  return faults.length > before ? null : row;
}

/** A cell of CSV: quoted where it must be, and never a formula of a spreadsheet. */
export function csvCell(value) {
  const text = String(value);
  const safe = /^[=+\-@\t\r\n]/.test(text) && !numberForm.test(text) ? `'${text}` : text;
  return /[",;\t\n\r]/.test(safe) ? `"${safe.replaceAll('"', '""')}"` : safe;
}
