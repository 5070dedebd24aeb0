/* Explosive tabs, sliders and number fields. */
import { network } from "../model.js";
import { groupedInputs } from "./design.js";
import { htmlNode } from "./drawing.js";

const sliderSteps = 1000;
const columnOf = Object.fromEntries(network.inputs.map((c) => [c.name, c]));

function toSlider({ lower, upper, log }, x) {
  const share = log ? Math.log(x / lower) / Math.log(upper / lower) : (x - lower) / (upper - lower);
  return Math.round(sliderSteps * Math.min(1, Math.max(0, share)));
}

function fromSlider({ lower, upper, log }, step) {
  const share = step / sliderSteps;
  const x = log ? lower * (upper / lower) ** share : lower + share * (upper - lower);
  return Math.min(upper, Math.max(lower, Number(x.toPrecision(4))));
}

function rangeWords({ name, lower, upper }, system) {
  const { unit, factor } = unitOf(name, system);
  return `${digits(lower * factor, 3)} to ${digits(upper * factor, 3)}${unit ? ` ${unit}` : ""}`;
}

/** Tabs of the explosives; `choose` gets the name. Arrow keys move as in any tab list. */
export function buildTabs(choose) {
  const list = document.getElementById("explosives");
  const names = network.explosives;
  list.replaceChildren(...names.map((name, i) => {
    const tab = htmlNode("button", { type: "button", role: "tab", id: `tab-${name}`, "aria-controls": "results-panel" }, sentence(spaced(name)).replace("Anfo", "ANFO").replace(" anfo", " ANFO"));
    tab.addEventListener("click", () => choose(name));
    tab.addEventListener("keydown", (event) => {
      const to = { ArrowRight: i + 1, ArrowDown: i + 1, ArrowLeft: i - 1, ArrowUp: i - 1, Home: 0, End: names.length - 1 }[event.key];
      if (to === undefined) return;
      event.preventDefault();
      const next = names[(to + names.length) % names.length];
      choose(next);
      document.getElementById(`tab-${next}`).focus();
    });
    return tab;
  }));
}

/** Sliders and fields in their groups; `change(name, value)` gets SI, NaN for what is no number. */
export function buildControls(system, change) {
  const place = document.getElementById("inputs");
  place.replaceChildren(...[...groupedInputs()].map(([title, columns]) => htmlNode(
    "fieldset", {}, htmlNode("legend", {}, title), ...columns.map((column) => control(column, system, change)),
  )));
}

function control(column, system, change) {
  const { name } = column;
  const { unit, factor } = unitOf(name, system);
  const title = titleOf(name);
  const range = rangeWords(column, system);
  const field = htmlNode("input", {
    type: "text", inputmode: "decimal", autocomplete: "off", id: `field-${name}`, "aria-describedby": `hint-${name}`,
  });
  const slider = htmlNode("input", { type: "range", min: 0, max: sliderSteps, step: 1, id: `slider-${name}`, "aria-label": `${title}, slider` });
  field.addEventListener("input", () => {
    const text = field.value.trim().replace(",", ".");
    const value = text === "" ? NaN : Number(text) / factor;
    change(name, Number.isFinite(value) && value >= 0 && !(column.log && value === 0) ? value : NaN, "field");
  });
  slider.addEventListener("input", () => change(name, fromSlider(column, Number(slider.value)), "slider"));
  return htmlNode(
    "div", { class: "control", id: `control-${name}` },
    htmlNode("label", { for: `field-${name}` }, title),
    htmlNode("span", { class: "entry" }, field, htmlNode("span", { class: "unit" }, unit)),
    slider,
    htmlNode("div", { class: "valid", id: `valid-${name}`, "aria-hidden": "true" }),
    htmlNode("p", { class: "hint", id: `hint-${name}` }, `Trained on ${range}`),
  );
}

/** Show a value in its slider and field; `typing` leaves the field to the one who types. */
export function showValue(name, value, system, typing) {
  const column = columnOf[name];
  const { unit, factor } = unitOf(name, system);
  const field = document.getElementById(`field-${name}`);
  const slider = document.getElementById(`slider-${name}`);
  const bad = !Number.isFinite(value);
  if (!typing && !bad) field.value = String(Number((value * factor).toPrecision(6)));
  if (!bad) slider.value = toSlider(column, value);
  slider.setAttribute("aria-valuetext", bad ? "no number" : withUnit(name, value, system));
  field.setAttribute("aria-invalid", bad);
  const outside = !bad && !(value >= column.lower && value <= column.upper);
  const box = document.getElementById(`control-${name}`);
  box.classList.toggle("bad", bad);
  box.classList.toggle("outside", outside);
  const range = rangeWords(column, system);
  const why = bad ? `Not a usable number. Give ${range}` : outside ? `Outside: trained on ${range}` : `Trained on ${range}`;
  document.getElementById(`hint-${name}`).textContent = why;
}

/** Shade the part of a slider where the design stays valid, and say its ends; null: nothing to say. */
export function showRange(name, range, system) {
  const colours = { inside: "var(--valid)", unusual: "var(--rare)", outside: "transparent", impossible: "transparent" };
  const strip = document.getElementById(`valid-${name}`);
  const domains = range?.domains ?? [];
  const share = (k) => `${((100 * Math.min(Math.max(k, 0), domains.length - 1)) / (domains.length - 1)).toFixed(2)}%`;
  const stops = domains.map((domain, k) => `${colours[domain]} ${share(k - 0.5)} ${share(k + 0.5)}`);
  strip.style.background = stops.length ? `linear-gradient(to right, ${stops.join(", ")})` : "none";
  const hint = document.getElementById(`hint-${name}`);
  const [trained] = hint.textContent.split("; valid");
  if (!domains.length || trained.startsWith("Not")) return;
  const here = range.lower === undefined ? "nowhere with these other inputs" : `here ${rangeWords({ name, ...range }, system)}`;
  hint.textContent = `${trained}; valid ${here}`;
}
