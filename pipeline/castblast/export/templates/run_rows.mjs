// Answers rows from standard input with the module given; run by `castblast export --verify`.
import { readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const [path, count] = process.argv.slice(2);
const { network, predictRow } = await import(pathToFileURL(path));
if (count !== undefined) {
  const { explosives, inputs } = network.golden;
  let sum = 0;
  const start = process.cpuUsage().user;
  for (let i = 0; i < Number(count); i += 1) {
    const k = i % inputs.length;
    sum += predictRow(explosives[k], inputs[k]).values[0];
  }
  console.log((process.cpuUsage().user - start) / 1e6 + 0 * sum);
} else {
  const domains = ["inside", "unusual", "outside"];
  const lines = readFileSync(0, "utf8").trim().split("\n").map((line) => {
    const [explosive, ...row] = line.split(" ").map(Number);
    const { values, predictionLower, predictionUpper, networkLower, networkUpper, score, domain, offending } = predictRow(explosive, row);
    const ends = [predictionLower, predictionUpper, networkLower, networkUpper].flat();
    const flags = offending.map((flag) => (flag ? 1 : 0));
    return [...values, ...ends, score, domains.indexOf(domain), ...flags].join(" ");
  });
  console.log(lines.join("\n"));
}
