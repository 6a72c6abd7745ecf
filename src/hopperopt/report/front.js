/* The front: each point shows its design and the drawing of it. */
const frontBox = document.getElementById("front-chart"), rows = document.querySelector("#front-design tbody");
const { factors, points } = data.front;
const putFront = chooser(frontBox, show, Math.max(0, points.findIndex(p => p.selected)));

function drawFront() {
  const c = chart(frontBox, range(points.map(p => p.J[0])), range(points.map(p => p.J[1])),
    "predicted J of the fine particles", "predicted J of the intermediate particles", 20);
  putFront(points.map((p, n) => add(c.svg, "circle", {
    class: "point" + (p.selected ? " selected" : ""), cx: c.X(p.J[0]), cy: c.Y(p.J[1]), r: p.selected ? 8 : 5, role: "button",
    "aria-label": `design ${n + 1} of ${points.length}` + (p.selected ? ", selected" : ""),
  })));
}

function show(n) {
  const p = points[n];
  document.getElementById("front-insert").setAttribute("d", p.insert);
  rows.replaceChildren();
  const known = [...factors.map((name, k) => [name, p.values[k]]), ["J of the fine particles", decimals(p.J[0])], ["J of the intermediate particles", decimals(p.J[1])]];
  for (const [name, value] of known) {
    const row = add(rows, "tr");
    add(row, "th", { scope: "row" }, name);
    add(row, "td", { class: "number" }, value);
  }
  const notes = [p.selected ? "The selected design." : "", p.feasible ? "" : "Its predicted mass fractions are impossible.", p.built ? "" : "It cannot be built as the configuration stands."];
  document.getElementById("front-note").textContent = notes.filter(Boolean).join(" ");
}

keep(frontBox, drawFront);
