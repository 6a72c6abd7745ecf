"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const { M, classes, batch, experiments } = data.curves;

  /* A child element of SVG or HTML, as its parent is. */
  function add(parent, tag, attributes = {}, text = "") {
    const child = document.createElementNS(parent.namespaceURI, tag);
    for (const [name, value] of Object.entries(attributes)) child.setAttribute(name, value);
    if (text !== "") child.textContent = text;
    return parent.appendChild(child);
  }

  /* About so many round numbers from low to high. */
  function ticks([low, high], count) {
    const rough = (high - low) / count, power = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 5, 10].map(factor => factor * power).find(size => size >= rough * 0.999);
    const decimals = Math.max(0, -Math.floor(Math.log10(step) + 1e-9)), found = [];
    for (let n = Math.ceil(low / step - 1e-9); n * step <= high + 1e-9 * step; n++) found.push((n * step).toFixed(decimals));
    return found;
  }

  function range(values, share = 0.06) {
    const known = values.filter(value => value !== null);
    if (!known.length) return [0, 1];
    const low = Math.min(...known), high = Math.max(...known), room = share * (high - low) || 0.1 * Math.abs(high) || 1;
    return [low - room, high + room];
  }

  /* An empty chart in a container, drawn at the container's own width so that its words keep their size. */
  function chart(container, x, y, xLabel, yLabel, right, shape = 0.7) {
    container.replaceChildren();
    const width = Math.max(container.clientWidth, 200), height = Math.round(Math.min(shape * width, 420));
    const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
    container.append(svg);
    svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    const left = 58, top = 26, bottom = height - 44, end = width - right;
    const X = value => left + (value - x[0]) / (x[1] - x[0]) * (end - left);
    const Y = value => bottom - (value - y[0]) / (y[1] - y[0]) * (bottom - top);
    add(svg, "path", { class: "axis", d: `M${left},${top}V${bottom}H${end}` });
    for (const value of ticks(x, Math.max(2, Math.floor((end - left) / 70)))) {
      add(svg, "path", { class: "axis", d: `M${X(value)},${bottom}v5` });
      add(svg, "text", { x: X(value), y: bottom + 19, "text-anchor": "middle" }, value);
    }
    for (const value of ticks(y, Math.max(2, Math.floor((bottom - top) / 40)))) {
      add(svg, "path", { class: "axis", d: `M${left},${Y(value)}h-5` });
      add(svg, "text", { x: left - 9, y: Y(value) + 4.5, "text-anchor": "end" }, value);
    }
    add(svg, "text", { x: (left + end) / 2, y: height - 6, "text-anchor": "middle" }, xLabel);
    add(svg, "text", { x: 0, y: 14 }, yLabel);
    return { svg, X, Y, left, end, top, bottom };
  }

  const known = values => values.every(value => value !== null);
  const line = (c, values) => "M" + values.map((value, n) => `${c.X(M[n]).toFixed(1)},${c.Y(value).toFixed(1)}`).join("L");

  function band(c, parent, mean, half, colour) {
    if (!known(half)) return;
    const upper = line(c, mean.map((value, n) => value + half[n]));
    const lower = mean.map((value, n) => `L${c.X(M[n]).toFixed(1)},${c.Y(value - half[n]).toFixed(1)}`).reverse();
    add(parent, "path", { class: "band", d: upper + lower.join("") + "Z", fill: colour });
  }

  const colour = name => `var(--${name})`;

  /* Draws now, and again whenever the container has another width. */
  function keep(container, draw) {
    let width = 0;
    new ResizeObserver(() => {
      if (container.clientWidth !== width) { width = container.clientWidth; draw(); }
    }).observe(container);
    width = container.clientWidth;
    draw();
  }

  for (const container of document.querySelectorAll(".outflow")) {
    const { mean, half } = data.outflows[container.dataset.index];
    keep(container, () => {
      const high = Math.max(...mean.flat(), ...batch);
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
  const sizes = document.getElementById("sizes"), told = document.getElementById("curve-design");
  let size = 0, chosen = -1, curveChart, above;

  classes.forEach((name, k) => {
    const label = add(sizes, "label");
    const button = add(label, "input", { type: "radio", name: "size", value: name });
    button.checked = k === size;
    label.append(" " + name);
    button.addEventListener("change", () => { size = k; drawCurves(); });
  });
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

  /* The front: each point shows its design and the drawing of it. */
  const frontBox = document.getElementById("front-chart"), rows = document.querySelector("#front-design tbody");
  const { factors, points } = data.front;
  let current = Math.max(0, points.findIndex(p => p.selected)), circles = [];

  function drawFront() {
    const c = chart(frontBox, range(points.map(p => p.J[0])), range(points.map(p => p.J[1])),
      "predicted J of the fine particles", "predicted J of the intermediate particles", 20);
    circles = points.map((p, n) => {
      const circle = add(c.svg, "circle", {
        class: "point" + (p.selected ? " selected" : ""), cx: c.X(p.J[0]), cy: c.Y(p.J[1]), r: p.selected ? 8 : 5, role: "button",
        "aria-label": `design ${n + 1} of ${points.length}` + (p.selected ? ", selected" : ""),
      });
      for (const kind of ["pointerenter", "click", "focus"]) circle.addEventListener(kind, () => show(n));
      return circle;
    });
    show(current);
  }

  frontBox.addEventListener("keydown", event => {
    const step = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
    if (!step) return;
    event.preventDefault();
    circles[Math.min(Math.max(current + step, 0), points.length - 1)].focus();
  });

  function show(n) {
    current = n;
    const p = points[n];
    circles.forEach((circle, k) => {
      circle.setAttribute("tabindex", k === n ? 0 : -1);
      circle.classList.toggle("current", k === n);
    });
    document.getElementById("front-insert").setAttribute("d", p.insert);
    rows.replaceChildren();
    const known = [...factors.map((name, k) => [name, p.values[k]]), ["J of the fine particles", p.J[0].toFixed(4)], ["J of the intermediate particles", p.J[1].toFixed(4)]];
    for (const [name, value] of known) {
      const row = add(rows, "tr");
      add(row, "th", { scope: "row" }, name);
      add(row, "td", { class: "number" }, value);
    }
    const notes = [p.selected ? "The selected design." : "", p.feasible ? "" : "Its predicted mass fractions are impossible.", p.built ? "" : "It cannot be built as the configuration stands."];
    document.getElementById("front-note").textContent = notes.filter(Boolean).join(" ");
  }

  keep(frontBox, drawFront);
})();
