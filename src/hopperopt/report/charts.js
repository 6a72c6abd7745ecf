/* What all charts share. */
const data = JSON.parse(document.getElementById("data").textContent);
const { M, classes, batch, experiments } = data.curves;

/* A child element of SVG or HTML, as its parent is. */
function add(parent, tag, attributes = {}, text = "") {
  const child = document.createElementNS(parent.namespaceURI, tag);
  for (const [name, value] of Object.entries(attributes)) child.setAttribute(name, value);
  if (text !== "") child.textContent = text;
  return parent.appendChild(child);
}

/* A number in words with a true minus. */
const minus = text => text.replace("-", "−");
const decimals = value => minus(value.toFixed(4));

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
  for (const value of ticks(x, Math.max(2, Math.floor((end - left) / 55)))) {
    add(svg, "path", { class: "axis", d: `M${X(value)},${bottom}v5` });
    add(svg, "text", { x: X(value), y: bottom + 19, "text-anchor": "middle" }, minus(value));
  }
  for (const value of ticks(y, Math.max(2, Math.floor((bottom - top) / 40)))) {
    add(svg, "path", { class: "axis", d: `M${left},${Y(value)}h-5` });
    add(svg, "text", { x: left - 9, y: Y(value) + 4.5, "text-anchor": "end" }, minus(value));
  }
  add(svg, "text", { x: (left + end) / 2, y: height - 6, "text-anchor": "middle" }, xLabel);
  add(svg, "text", { x: 0, y: 14 }, yLabel);
  return { svg, X, Y, y, left, end, top, bottom };
}

const known = values => values.every(value => value !== null);
const line = (c, values) => "M" + values.map((value, n) => `${c.X(M[n]).toFixed(1)},${c.Y(value).toFixed(1)}`).join("L");

/* A band around a curve, as far as the chart reaches. */
function band(c, parent, mean, half, colour) {
  if (!known(half)) return;
  const inside = value => Math.min(c.y[1], Math.max(c.y[0], value));
  const upper = line(c, mean.map((value, n) => inside(value + half[n])));
  const lower = mean.map((value, n) => `L${c.X(M[n]).toFixed(1)},${c.Y(inside(value - half[n])).toFixed(1)}`).reverse();
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

/* A button for each name, the first one pressed. */
function radios(fieldset, names, choose) {
  names.forEach((name, k) => {
    const label = add(fieldset, "label");
    const button = add(label, "input", { type: "radio", name: fieldset.id, value: name });
    button.checked = k === 0;
    label.append(" " + name);
    button.addEventListener("change", () => choose(k));
  });
}

/* Marks in a box of which one is current: pointing or the arrow keys make it another, which is shown.
   Returns a function to which the marks are given whenever they have been drawn. */
function chooser(box, show, current = 0) {
  let marks = [];
  function choose(n) {
    current = n;
    marks.forEach((mark, k) => {
      mark.setAttribute("tabindex", k === n ? 0 : -1);
      mark.classList.toggle("current", k === n);
    });
    show(n);
  }
  box.addEventListener("keydown", event => {
    const step = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
    if (!step) return;
    event.preventDefault();
    marks[Math.min(Math.max(current + step, 0), marks.length - 1)].focus();
  });
  return drawn => {
    marks = drawn;
    marks.forEach((mark, n) => {
      for (const kind of ["pointerenter", "click", "focus"]) mark.addEventListener(kind, () => choose(n));
    });
    choose(current);
  };
}
