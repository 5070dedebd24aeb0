/* Pressure over time and energy shares, from the simulated histories of the dataset. */

/** Velocity of detonation in the hole, as castblast.explosive.isentrope. */
function inHoleVelocity(explosive, diameter) {
  const deficit = explosive.diameterCoefficient * (0.1 / diameter) ** explosive.diameterExponent;
  return explosive.detonationVelocity * (1 - Math.min(deficit, 0.6));
}

function polynomialTerms(record, full) {
  const z = record.inputs.map((c) => ((c.log ? Math.log(full[c.name]) : full[c.name]) - c.mean) / c.scale);
  return record.powers.map((powers) => powers.reduce((product, power, i) => (power ? product * z[i] ** power : product), 1));
}

/**
 * Curve and shares of a completed design; null where nothing is known.
 * time [s] from 0; pressure, lower, upper [Pa]; shares with value, lower and upper.
 */
export function historyOf(kind, full) {
  const record = facts.histories;
  const explosive = facts.explosives[kind];
  if (!record || !explosive || !(kind in record.coefficients)) return null;
  const terms = polynomialTerms(record, full);
  const matrix = record.coefficients[kind];
  const found = new Array(matrix[0].length).fill(0);
  terms.forEach((term, k) => matrix[k].forEach((c, j) => { found[j] += term * c; }));
  const rise = full.hole_diameter / inHoleVelocity(explosive, full.hole_diameter);
  const logs = record.times.map((_, i) => record.mean[i] + record.modes.reduce((sum, mode, m) => sum + found[m] * mode[i], 0));
  const at = (sign) => [0, ...logs.map((y, i) => Math.exp(y + sign * record.band[i]))];
  const shares = record.energy.map(({ name, title, band }, j) => {
    const value = found[record.modes.length + j];
    return { name, title, value, band, lower: Math.max(0, value - band), upper: Math.max(0, value + band) };
  });
  const inside = record.inputs.every(({ name, lower, upper }) => full[name] >= lower && full[name] <= upper);
  return { time: [0, ...record.times.map((t) => t * rise)], pressure: at(0), lower: at(-1), upper: at(1), shares, inside };
}
