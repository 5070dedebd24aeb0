/* Every number of the page with its prediction band. */
import { network, predictRow } from "../model.js";
import { completed, inputNames } from "./design.js";
import { refusals, valuesAtBurden } from "./rule.js";

const gravity = 9.81;
const outputTitles = {
  burden_velocity: "Burden velocity", equilibrium_pressure: "Equilibrium pressure",
  expanded_hole_radius: "Expanded hole radius", crushed_zone_radius: "Crushed zone radius",
};

/** Mean way of a bench thrown level: 2/3 of the reach of its crest (castblast.muckpile.results.ballistic). */
export function flightDistance(speed, height) {
  return (2 / 3) * speed * Math.sqrt((2 * height) / gravity);
}

/** Throw of the centre of mass and its prediction band (castblast.bands): rock slides on after landing. */
export function throwOf(speed, height) {
  const flight = flightDistance(speed, height);
  const { factor, less, more } = facts.throw;
  return { flight, value: flight * factor, lower: flight * factor * less, upper: flight * factor * more };
}

/** Predict by names; raw answer of the model with names. */
export function predicted(design) {
  const position = network.explosives.indexOf(design.explosive);
  return predictRow(position, inputNames.map((name) => design.values[name]));
}

/**
 * Results of a design: key, variable (for the unit), title, value, lower, upper, note;
 * `exact` marks what is input or arithmetic; `flight` is the throw without sliding.
 */
export function resultsOf(design) {
  const answer = predicted(design);
  const full = completed(design);
  const explosive = facts.explosives[design.explosive];
  const rows = network.outputs.map(({ name, title }, j) => ({
    key: name, variable: name, title: outputTitles[name] ?? sentence(title), exact: false,
    value: answer.values[j], lower: answer.predictionLower[j], upper: answer.predictionUpper[j], note: "",
  }));
  const speed = rows.find(({ key }) => key === "burden_velocity");
  if (speed) {
    rows.push({
      key: "throw_distance", variable: "burden", title: "Mean throw", exact: false,
      ...throwOf(speed.value, full.bench_height), note: "free flight",
    });
  }
  const exact = (key, variable, title, value, note) => {
    if (Number.isFinite(value)) rows.push({ key, variable, title, value, lower: value, upper: value, note, exact: true });
  };
  if (explosive) {
    const charge = explosive.density * (Math.PI / 4) * full.charge_diameter ** 2 * full.charge_length;
    const rock = full.spacing * full.mean_burden * full.bench_height;
    exact("powder_factor", "powder_factor", "Powder factor", charge / rock, "Geometry, exact");
    exact("cj_pressure", "explosion_pressure", "CJ pressure", explosive.cjPressure, "Explosive data, exact");
    if (full.charge_diameter === full.hole_diameter) {
      const [value, factor] = [explosive.explosionPressure, facts.explosionPressureFactor];
      rows.push({
        key: "explosion_pressure", variable: "explosion_pressure", title: "Explosion pressure", exact: false,
        value, lower: value / factor, upper: value * factor, note: "",
      });
    }
  }
  return { rows, full, domain: answer.domain, offending: inputNames.filter((_, i) => answer.offending[i]), score: answer.score };
}

/* Values of a column from its lower to its upper end, evenly as its slider moves. */
function rangeSteps({ lower, upper, log }, steps) {
  return Array.from({ length: steps + 1 }, (_, k) => {
    const share = k / steps;
    return k === 0 ? lower : k === steps ? upper : log ? lower * (upper / lower) ** share : lower + share * (upper - lower);
  });
}

/**
 * Where one input may go on its slider, the others as they are, spacing and stemming with the burden:
 * the verdict at every step (also "impossible"), and the ends of what is not outside. The value of
 * the design itself counts: the last step may lie a rounding beyond what is possible (90 degrees).
 */
export function validRange(design, column, ratios, steps = 40) {
  const { name } = column;
  const verdict = (x) => {
    const values = name === "burden" ? valuesAtBurden(design, x, ratios) : { ...design.values, [name]: x };
    const moved = { explosive: design.explosive, values };
    return { x, domain: refusals(moved, "si").length ? "impossible" : predicted(moved).domain };
  };
  const points = rangeSteps(column, steps).map(verdict);
  const valid = [...points, verdict(design.values[name])]
    .filter(({ domain }) => domain === "inside" || domain === "unusual")
    .map(({ x }) => x);
  const ends = valid.length ? { lower: Math.min(...valid), upper: Math.max(...valid) } : {};
  return { domains: points.map(({ domain }) => domain), ...ends };
}

/** Least and greatest velocity while one input goes over its trained range; the others stay. */
export function sensitivityOf(design, output = "burden_velocity", steps = 40) {
  const j = network.outputs.findIndex(({ name }) => name === output);
  if (j < 0) return [];
  return network.inputs.map((column) => {
    const { name } = column;
    const points = [];
    for (const x of rangeSteps(column, steps)) {
      const answer = predicted({ explosive: design.explosive, values: { ...design.values, [name]: x } });
      points.push({ x, value: answer.values[j], domain: answer.domain });
    }
    const trusted = points.filter(({ domain }) => domain === "inside");
    if (!trusted.length) return { name, low: null, high: null, size: 0 };
    const low = trusted.reduce((a, b) => (b.value < a.value ? b : a));
    const high = trusted.reduce((a, b) => (b.value > a.value ? b : a));
    return { name, low, high, size: high.value - low.value };
  }).sort((a, b) => b.size - a.size);
}
