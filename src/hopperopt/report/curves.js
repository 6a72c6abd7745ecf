/* Outflow of the cases simulated anew. */
for (const container of document.querySelectorAll(".outflow")) {
  const { mean, half } = data.outflows[container.dataset.index];
  keep(container, () => {
    const high = Math.max(...mean.flatMap((m, k) => m.map((value, n) => value + half[k][n])), ...batch);
    const c = chart(container, [0, 1], [0, Math.min(1, 1.08 * high)], "M", "mass fraction in the outflow", 12, 0.9);
    if (!known(mean.flat())) { add(c.svg, "text", { x: c.left + 12, y: c.top + 20 }, "no complete run"); return; }
    classes.forEach((name, k) => {
      add(c.svg, "path", { class: "curve", d: `M${c.left},${c.Y(batch[k])}H${c.end}`, stroke: colour(name), style: `stroke: ${colour(name)}` });
      band(c, c.svg, mean[k], half[k], colour(name));
      add(c.svg, "path", { class: "curve chosen", d: line(c, mean[k]), style: `stroke: ${colour(name)}` });
    });
  });
}

/* All experiments: one size at a time, one experiment highlighted. */
const curveBox = document.getElementById("curve-chart"), choice = document.getElementById("experiment");
const told = document.getElementById("curve-design");
let size = 0, chosen = -1, curveChart, above;

radios(document.getElementById("sizes"), classes, k => { size = k; drawCurves(); });
experiments.forEach((experiment, n) => add(choice, "option", { value: n }, experiment.name));
choice.addEventListener("change", () => highlight(choice.value === "" ? -1 : Number(choice.value)));

function drawCurves() {
  const complete = experiments.map(e => e.mean[size]).filter(known);
  const c = curveChart = chart(curveBox, [0, 1], range([...complete.flat(), batch[size]]),
    "discharged mass fraction M", `mass fraction of the ${classes[size]} particles in the outflow`, 50);
  experiments.forEach((experiment, n) => {
    if (known(experiment.mean[size])) add(c.svg, "path", { class: "curve", "data-experiment": n, d: line(c, experiment.mean[size]) });
  });
  add(c.svg, "path", { class: "batch", d: `M${c.left},${c.Y(batch[size])}H${c.end}` });
  add(c.svg, "text", { x: c.end + 5, y: c.Y(batch[size]) + 4.5 }, "batch");
  above = add(c.svg, "g");
  c.svg.addEventListener("pointermove", point);
  c.svg.addEventListener("pointerdown", point);
  highlight(chosen);
}

/* Highlights the curve nearest to the pointer. */
function point(event) {
  const c = curveChart, frame = c.svg.getBoundingClientRect();
  const at = (event.clientX - frame.left - c.left) / (c.end - c.left) * (M.length - 1), y = event.clientY - frame.top;
  if (at < 0 || at > M.length - 1) return;
  const n = Math.min(Math.floor(at), M.length - 2), distance = experiments.map(({ mean }) => {
    const m = mean[size];
    return known(m) ? Math.abs(c.Y(m[n] + (at - n) * (m[n + 1] - m[n])) - y) : Infinity;
  });
  const nearest = Math.min(...distance);
  if (nearest < 30) highlight(distance.indexOf(nearest));
}

function highlight(n) {
  chosen = n;
  choice.value = n < 0 ? "" : n;
  above.replaceChildren();
  if (n < 0) { told.textContent = "No experiment is chosen."; return; }
  const { name, design, runs, mean, half } = experiments[n];
  const words = runs === 0 ? "no complete run" : `mean of ${runs} run${runs > 1 ? "s" : ""}`;
  told.textContent = `${name}: ${design}; ${words}`;
  if (!known(mean[size])) return;
  band(curveChart, above, mean[size], half[size], colour(classes[size]));
  add(above, "path", { class: "curve chosen", "data-experiment": n, d: line(curveChart, mean[size]), style: `stroke: ${colour(classes[size])}` });
}

keep(curveBox, drawCurves);
