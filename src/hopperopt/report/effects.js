/* Main effects: a chart for each factor, each of its levels with what is known of it. */
const effectBox = document.getElementById("effect-charts"), effectTold = document.getElementById("effect");
const effectCharts = data.effects.map(() => add(effectBox, "div", { class: "chart" }));
const levelsOf = data.effects.flatMap(effect => effect.levels.map((_, n) => [effect, n]));
const objectives = Object.keys(data.effects[0].J), putEffects = chooser(effectBox, showEffect);
const NAMED = 30; // experiments of a level
let objective = objectives[0];

radios(document.getElementById("effect-sizes"), objectives, k => { objective = objectives[k]; drawEffects(); });

function drawEffects() {
  const y = range([0, ...data.effects.flatMap(({ J }) => J[objective].flat())]);
  putEffects(data.effects.flatMap((effect, k) => drawEffect(effectCharts[k], effect, y)));
}

/* Draws one factor's chart; returns the marks of its levels. */
function drawEffect(box, { name, unit, selected, levels, words, J }, y) {
  const c = chart(box, range([...levels, selected]), y, name + (unit && ` (${unit})`), `J of the ${objective} particles`, 12, 0.8);
  const at = levels.map(c.X), stroke = `stroke: ${colour(objective)}`;
  add(c.svg, "path", { class: "batch", d: `M${c.X(selected)},${c.top}V${c.bottom}` });
  add(c.svg, "path", { class: "curve", d: "M" + at.map((x, n) => `${x},${c.Y(J[objective][n][0])}`).join("L"), style: stroke });
  return levels.map((_, n) => {
    const [mean, low, high] = J[objective][n];
    const left = n ? (at[n - 1] + at[n]) / 2 : c.left, right = n < at.length - 1 ? (at[n] + at[n + 1]) / 2 : c.end;
    const mark = add(c.svg, "g", { class: "effect", role: "button", "aria-label": `${name} ${words[n]}` });
    add(mark, "rect", { x: left, y: c.top, width: right - left, height: c.bottom - c.top });
    if (low !== null) add(mark, "path", { d: `M${at[n]},${c.Y(low)}V${c.Y(high)}`, style: stroke });
    add(mark, "circle", { cx: at[n], cy: c.Y(mean), r: 4, fill: colour(objective) });
    return mark;
  });
}

function showEffect(place) {
  const [{ name, words, J, experiments }, n] = levelsOf[place], [mean, low, high] = J[objective][n], names = experiments[n];
  const interval = low === null ? "" : ` (${decimals(low)} to ${decimals(high)})`;
  const more = names.length > NAMED ? ` and ${names.length - NAMED} more` : "";
  const of = names.length > 1 ? `mean of ${names.length} experiments, ` : "";
  effectTold.textContent = `${name} ${words[n]}: J of the ${objective} particles ${decimals(mean)}${interval}; ${of}${names.slice(0, NAMED).join(", ")}${more}`;
}

keep(effectBox, drawEffects);
