/* The page: one state, drawn whenever it changes. */
import { network, selfTest } from "../model.js";
import { answerBatch, batchTemplate, csvText } from "./batch.js";
import { decoded } from "./table.js";
import { buildControls, buildTabs, showRange, showValue } from "./controls.js";
import { domainWords } from "./domain.js";
import { resultsOf, sensitivityOf, validRange } from "./answers.js";
import { firstDesign, fromHash, inputNames, toHash } from "./design.js";
import { htmlNode } from "./drawing.js";
import { ratiosOf, refusals, valuesAtBurden } from "./rule.js";
import { benchFigure, energyFigure, holeFigure, place, pressureFigure, tornadoFigure } from "./figures.js";

const at = (id) => document.getElementById(id);
const noHistories = "The pressure histories of the dataset did not come with this page.";
const state = { design: firstDesign(), kept: null, system: "metric" };
let pending = 0, resting = 0;

const usable = (design) => inputNames.every((name) => Number.isFinite(design.values[name]));
const copyOf = ({ explosive, values }) => ({ explosive, values: { ...values } });

function showResults(result, other) {
  const { system } = state;
  const cell = (row) => htmlNode(
    "li", { class: row.exact ? "result exact" : "result" },
    htmlNode("span", { class: "name" }, row.title),
    htmlNode("output", { class: "value", id: `value-${row.key}`, "data-si": row.value, "data-lower": row.lower, "data-upper": row.upper }, shownValue(row, system)),
    htmlNode("span", { class: "range" }, row.exact ? row.note : shownEnds(row, system)),
    ...(row.flight === undefined ? [] : [htmlNode("span", { class: "range" }, `${row.note} ${withUnit(row.variable, row.flight, system, 3)} \u00d7 ${digits(facts.throw.factor, 2)}`)]),
    ...(other ? [difference(row, other)] : []),
  );
  at("results").replaceChildren(...result.rows.map(cell));
  const speed = result.rows.find(({ key }) => key === "burden_velocity");
  at("glance").textContent = speed ? `${speed.title} ${shownValue(speed, system)} (${shownEnds(speed, system)}; ${network.basis.split(":")[0]})` : "";
}

function difference(row, other) {
  const old = other.rows.find(({ key }) => key === row.key);
  if (!old) return htmlNode("span", { class: "difference" }, "");
  const change = row.value / old.value - 1;
  return htmlNode("span", { class: "difference" }, `${signed(change)} on ${shownValue(old, state.system)}`);
}

const signed = (share) => `${share < 0 ? "\u2212" : "+"}${Math.abs(100 * share).toFixed(1)}\u00a0%`;

function showDomain(result) {
  const { title, text, reasons } = domainWords(state.design, result, state.system);
  const badge = at("domain");
  badge.dataset.domain = at("glance").dataset.domain = result.domain;
  badge.replaceChildren(
    htmlNode("strong", {}, title), htmlNode("span", {}, ` ${text}`),
    ...(reasons.length ? [htmlNode("ul", {}, ...reasons.map((reason) => htmlNode("li", {}, reason)))] : []),
  );
  at("results-panel").dataset.domain = result.domain;
}

function showFigures(result) {
  const { design, kept, system } = state;
  const pressure = pressureFigure(design, kept, system);
  place("pressure-figure", pressure, noHistories);
  place("energy-figure", energyFigure(design), noHistories);
  place("bench-figure", benchFigure(result, system), "This network gives no burden velocity.");
  const hole = holeFigure(result, system);
  place("hole-figure", hole, "");
  at("hole-legend").replaceChildren(...hole.legend.map(([kind, title, radius, row, variable]) => htmlNode(
    "li", {}, htmlNode("i", { class: kind }), `${title}: ${withUnit(variable, radius, system, 3)}`,
    row ? ` (${shownEnds(row, system)})` : " (given)",
  )));
  const speed = result.rows.find(({ key }) => key === "burden_velocity");
  place("tornado-figure", speed ? tornadoFigure(sensitivityOf(design), speed, system) : null, "No part of any range lies inside the training domain here.");
}

function showNothing(lead, reasons) {
  const badge = at("domain");
  badge.dataset.domain = at("glance").dataset.domain = "invalid";
  at("glance").textContent = "No answer: see the reasons above";
  badge.replaceChildren(htmlNode("strong", {}, "No answer"), htmlNode("span", {}, ` ${lead}`), htmlNode("ul", {}, ...reasons.map((reason) => htmlNode("li", {}, reason))));
  at("results-panel").dataset.domain = "invalid";
  for (const id of ["results", "hole-legend", "derived"]) at(id).replaceChildren();
  for (const id of ["pressure-figure", "energy-figure", "bench-figure", "hole-figure", "tornado-figure"]) place(id, null, `No answer: ${lead.toLowerCase()}`);
}

/* Why a design has no answer: an input that is no number, or no bench that can hold it. */
function withoutAnswer(design) {
  const names = inputNames.filter((name) => !Number.isFinite(design.values[name])).map(titleOf);
  if (names.length) return { lead: "An input is not a usable number.", reasons: names };
  const reasons = refusals(design, state.system);
  return reasons.length ? { lead: "No bench can hold this design.", reasons } : null;
}

/* Some hundred answers: when the hand rests, so that a slider stays smooth. */
function laterRanges() {
  clearTimeout(resting);
  resting = setTimeout(showRanges, 80);
}

function showRanges() {
  const ready = usable(state.design);
  for (const column of network.inputs) showRange(column.name, ready ? validRange(state.design, column, state.ratios) : null, state.system);
}

function showSummary(full) {
  const parts = [["stemming length", "stemming_length"], ["charge length", "charge_length"], ["spacing", "spacing"]].filter(([, name]) => !inputNames.includes(name));
  at("derived").textContent = parts.map(([title, name]) => `${sentence(title)} ${withUnit(name, full[name], state.system, 3)}`).join(" \u00b7 ");
}

/* Draw everything; the link is written a little later, as browsers limit how often that may be. */
function draw() {
  for (const tab of at("explosives").children) {
    const chosen = tab.id === `tab-${state.design.explosive}`;
    tab.setAttribute("aria-selected", chosen);
    tab.tabIndex = chosen ? 0 : -1;
    if (chosen) at("results-panel").setAttribute("aria-labelledby", tab.id);
  }
  at("forget").hidden = !state.kept;
  const nothing = withoutAnswer(state.design);
  at("keep").disabled = nothing !== null;
  laterRanges();
  if (nothing) return showNothing(nothing.lead, nothing.reasons);
  const result = resultsOf(state.design);
  showResults(result, state.kept ? resultsOf(state.kept) : null);
  showDomain(result);
  showFigures(result);
  showSummary(result.full);
  clearTimeout(pending);
  pending = setTimeout(() => history.replaceState(null, "", toHash(state.design, state.kept, state.system)), 150);
  return result;
}

/* The burden slider takes spacing and stemming along; a field changes its own input alone. */
function change(name, value, source) {
  const { design } = state;
  const sliding = name === "burden" && source === "slider" && usable({ values: { ...design.values, burden: value } });
  if (sliding) design.values = valuesAtBurden(design, value, state.ratios);
  else design.values[name] = value;
  if (!sliding) keepRatios();
  for (const other of inputNames) showValue(other, design.values[other], state.system, other === name && source === "field");
  draw();
}

function keepRatios() {
  if (usable(state.design)) state.ratios = ratiosOf(state.design);
}

function rebuild() {
  buildControls(state.system, change);
  at("units").value = state.system;
  for (const name of inputNames) showValue(name, state.design.values[name], state.system, false);
  draw();
}

function restore(hash) {
  const { design, kept, system } = fromHash(hash);
  if (hash.length > 1 && !design) at("notice").textContent = "The link holds no complete design for this model; the usual design is shown.";
  state.design = design ?? state.design;
  state.kept = kept && withoutAnswer(kept) === null ? kept : null;
  if (kept && !state.kept) at("notice").textContent = "No bench can hold the kept design of the link; it was dropped.";
  keepRatios();
  state.system = system ?? state.system;
  rebuild();
}

function download(name, text) {
  const link = htmlNode("a", { href: URL.createObjectURL(new Blob([text], { type: "text/csv" })), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

function runBatch(text) {
  const start = performance.now();
  const { header, rows, faults } = answerBatch(text);
  const seconds = (performance.now() - start) / 1000;
  state.batch = csvText(header, rows);
  at("batch-save").disabled = rows.length === 0;
  const counts = ["inside", "unusual", "outside"].map((kind) => `${rows.filter((row) => row.at(-2) === kind).length} ${kind}`);
  at("batch-status").textContent = `${rows.length} designs in ${digits(seconds, 2)} s: ${counts.join(", ")}.${faults.length ? ` ${faults.length} faults.` : ""}`;
  at("batch-faults").replaceChildren(...faults.slice(0, 20).map((fault) => htmlNode("li", {}, fault)));
  return { rows: rows.length, faults, seconds };
}

buildTabs((name) => { state.design.explosive = name; draw(); });
at("units").replaceChildren(...Object.entries(systems).map(([key, title]) => htmlNode("option", { value: key }, title)));
at("units").addEventListener("change", () => { state.system = at("units").value; rebuild(); });
at("keep").addEventListener("click", () => { state.kept = copyOf(state.design); draw(); });
at("forget").addEventListener("click", () => { state.kept = null; draw(); at("keep").focus(); });
at("print").addEventListener("click", () => window.print());
at("copy").addEventListener("click", async () => {
  history.replaceState(null, "", toHash(state.design, state.kept, state.system));
  try { await navigator.clipboard.writeText(location.href); at("notice").textContent = "Link copied."; } catch { at("notice").textContent = "The link of this design stands in the address bar."; }
});
at("batch-template").addEventListener("click", () => download("designs.csv", batchTemplate(state.design)));
at("batch-save").addEventListener("click", () => download("answers.csv", state.batch));
at("batch-file").addEventListener("change", async () => { const file = at("batch-file").files[0]; if (file) runBatch(decoded(await file.arrayBuffer())); });
// What came with the event: the bar may have got the link of the present design meanwhile.
window.addEventListener("hashchange", (event) => restore(new URL(event.newURL).hash));
if (facts.histories) {
  const { rows, pressure_error_50: half, pressure_error_95: most, inside_band: covered, share_error_95: share } = facts.histories.held_out;
  at("history-error").textContent = `From simulated histories, by principal components: on ${rows} designs that the fit has not seen, half of all points are within ${percent(half)} and 95 % within ${percent(most)} of the simulated pressure; the shaded band holds ${percent(covered, 3)} of them. Energy shares: 95 % within ${percent(share)} of the energy of the explosive.`;
}
restore(location.hash);
const deviation = selfTest();
at("self-test").textContent = deviation < 1e-12 ? `Self-test passed: golden rows reproduced to ${deviation.toExponential(1)}.` : `Self-test FAILED (${deviation.toExponential(1)}): do not use this page in this browser.`;
at("self-test").classList.toggle("failed", !(deviation < 1e-12));
/** For scripts and tests. */
window.castblast = { state, resultsOf, sensitivityOf, refusals, answerBatch, runBatch, batchTemplate, network };
