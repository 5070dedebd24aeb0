/* Where the model may be used: a verdict and the reasons in words. */
import { network } from "../model.js";

const verdicts = {
  inside: ["Inside the training domain", "The surrogate repeats its simulator here."],
  unusual: ["Unusual combination", "Every value is in range, but together they are rare in the training designs. The bands may be too narrow."],
  outside: ["Outside the training domain", "The numbers are extrapolations; the bands do not hold."],
};

/** Verdict, explanation and reasons of an answer. */
export function domainWords(design, result, system) {
  const [title, text] = verdicts[result.domain];
  const reasons = [];
  const row = design.values;
  network.inputs.forEach(({ name, lower, upper }) => {
    if (!(row[name] >= lower && row[name] <= upper)) {
      reasons.push(`${titleOf(name)} is ${withUnit(name, row[name], system)}; trained on ${withUnit(name, lower, system)} to ${withUnit(name, upper, system)}`);
    }
  });
  for (const { label, terms, lower } of network.rules) {
    const sum = terms.reduce((total, [i, c]) => total + c * row[network.inputs[i].name], 0);
    if (!(sum - lower >= 0)) reasons.push(`Trained on: ${label}`);
  }
  if (result.domain === "unusual") reasons.push(`Unusual together: ${result.offending.map(titleOf).join(", ").toLowerCase()} (score ${digits(result.score, 3)}, at most 1 inside)`);
  return { title, text, reasons };
}
