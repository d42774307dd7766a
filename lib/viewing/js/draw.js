// A canvas to draw on, and what a network reads in the drawing (lib/viewing/draw_widget.py, which reads and refines).
// A drawing is 512 bytes, 8 a row: bit k of byte b is the pixel x = 8 b + k, y grows down. Drawings are numbered; what
// comes back for an earlier one is not shown, and its refinement is not asked for. No build step: what stands here is
// what the browser runs.
const [SIDE, BYTES, ZOOM] = [64, 512, 10];
const [INK, PALE, CURSOR] = ["#24344d", "#c3cbd8", "#d62839"];
const COLORS = { c: "#d55e00", s: "#0072b2", t: "#009e73" };
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
const PAUSE = 120; // milliseconds without a stroke before the drawing is read
const LIMIT = 950; // milliseconds from the end of a stroke: no sweep begins that may end later
const PATIENCE = 5000; // milliseconds before the page says that Python does not answer
const SILENCE = "Python does not answer. Is a cell still running, or was the kernel stopped?";
const MOST = 100; // drawings that can be brought back

function make(tag, properties = {}, ...children) {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(...children);
  return element;
}

const bytesOf = (view) => new Uint8Array(view.buffer ?? view, view.byteOffset ?? 0, view.byteLength);

const unpacked = (bytes, place = 0) =>
  Uint8Array.from({ length: SIDE * SIDE }, (_, k) => (bytes[place * BYTES + (k >> 3)] >> (k & 7)) & 1);

function packed(ink) {
  const bytes = new Uint8Array(BYTES);
  ink.forEach((on, k) => (bytes[k >> 3] |= on << (k & 7)));
  return bytes;
}

// Ink or paper on all pixels whose centers are nearer than half the width to (x, y); on the nearest one in any case.
function dab(ink, [x, y], width, on) {
  const reach = Math.max(0.75, width / 2);
  for (let row = Math.max(0, Math.floor(y - reach)); row < Math.min(SIDE, y + reach); row++)
    for (let column = Math.max(0, Math.floor(x - reach)); column < Math.min(SIDE, x + reach); column++)
      if (Math.hypot(column + 0.5 - x, row + 0.5 - y) < reach) ink[row * SIDE + column] = on;
}

function line(ink, from, to, width, on) {
  const steps = Math.max(1, Math.ceil(2 * Math.hypot(to[0] - from[0], to[1] - from[1])));
  for (let k = 0; k <= steps; k++) dab(ink, [0, 1].map((i) => from[i] + ((to[i] - from[i]) * k) / steps), width, on);
}

// The drawing with ink on all paper that cannot be reached from the rim, going up, down, left and right.
function filled(ink) {
  const outside = new Uint8Array(SIDE * SIDE);
  const rim = [...Array(SIDE).keys()].flatMap((k) => [k, (SIDE - 1) * SIDE + k, k * SIDE, k * SIDE + SIDE - 1]);
  const waiting = rim.filter((pixel) => !ink[pixel]);
  while (waiting.length) {
    const pixel = waiting.pop();
    if (outside[pixel]) continue;
    outside[pixel] = 1;
    const [x, near] = [pixel % SIDE, [pixel - SIDE, pixel + SIDE]];
    if (x > 0) near.push(pixel - 1);
    if (x < SIDE - 1) near.push(pixel + 1);
    waiting.push(...near.filter((other) => ink[other] === 0 && !outside[other]));
  }
  return outside.map((out) => 1 - out);
}

// A drawing as a canvas of 64 x 64 in one colour, without a background.
function print(ink, color, canvas = make("canvas", { width: SIDE, height: SIDE })) {
  const pen = canvas.getContext("2d");
  const image = pen.createImageData(SIDE, SIDE);
  const rgb = [1, 3, 5].map((k) => parseInt(color.slice(k, k + 2), 16));
  ink.forEach((on, k) => on && image.data.set([...rgb, 255], 4 * k));
  pen.putImageData(image, 0, 0);
  return canvas;
}

// The rim of a primitive: x, y and radius of a circle, or corners. What is cut away is dashed.
function trace(pen, { kind, rim, cut }, wide) {
  pen.beginPath();
  if (kind === "c") pen.arc(rim[0] * ZOOM, rim[1] * ZOOM, rim[2] * ZOOM, 0, 2 * Math.PI);
  else rim.forEach(([x, y], k) => pen[k ? "lineTo" : "moveTo"](x * ZOOM, y * ZOOM));
  pen.closePath();
  pen.setLineDash(cut ? [14, 9] : []);
  for (const [strokeStyle, lineWidth] of [["#ffffff", wide + 3], [COLORS[kind], wide]]) // a light seam, on dark ink
    Object.assign(pen, { strokeStyle, lineWidth, lineJoin: "round" }), pen.stroke();
}

const meaning = { "+": "union", "*": "intersection", "-": "subtraction: the second is cut out of the first" };

function chip(token, point) {
  const className = `draw-token${token.kind ? ` draw-${token.kind}` : ""}${token.cut ? " draw-cut" : ""}`;
  const title = token.kind ? `${token.name}: x, y, size${token.cut ? "; cut away" : ""}` : meaning[token.text];
  const [onpointerenter, onpointerleave] = [() => point(token), () => point(null)];
  return make("code", { className, title, textContent: token.text, onpointerenter, onpointerleave });
}

const px = (distance) => `${distance.toFixed(2)} px`;

// In one sentence, how the reading of a drawing went.
function report({ distances, done }, stopped, milliseconds, since) {
  const [first, last, sweeps] = [distances[0], distances.at(-1), distances.length - 1];
  if (!done && !stopped) return sweeps ? "" : "The network has answered; refinement goes on.";
  const time = `${(milliseconds / 1000).toFixed(1)} s ${since}`;
  const end = done ? "" : " It may get better still: press Refine on.";
  if (!last) return `${time}: the program has the outline of your drawing, to the pixel.`;
  if (!sweeps) return `${time}: ${px(first)} from the drawing${done ? ", and no number nearby is better" : ""}.${end}`;
  const many = `${sweeps} sweep${sweeps > 1 ? "s" : ""} of refinement`;
  return `${time}: ${many} brought the program from ${px(first)} to ${px(last)}.${end}`;
}

function render({ model, el }) {
  const button = (text, title, onclick) => make("button", { textContent: text, title, onclick });
  const paper = make("canvas", { width: SIDE * ZOOM, height: SIDE * ZOOM, className: "draw-paper", tabIndex: 0 });
  Object.assign(paper, { role: "application", ariaLabel: "canvas to draw on: arrow keys move, space draws" });
  const small = () => make("canvas", { width: SIDE, height: SIDE, role: "img" });
  const [first, best, says] = [small(), small(), make("figcaption")];
  const captions = [make("figcaption"), says];
  const text = make("div", { className: "draw-text", role: "group", ariaLabel: "the program" });
  const path = make("div", { className: "draw-path" });
  const status = make("div", { className: "draw-status", role: "status", ariaLive: "polite" });
  const pen = button("Pen", "key P", () => choose(1));
  const eraser = button("Eraser", "key E", () => choose(0));
  const width = make("input", { type: "range", min: 1, max: 16, value: 5, ariaLabel: "width of the pen, pixels" });
  const fill = button("Fill closed strokes", "key F: ink what strokes close in", () => change(filled));
  const undo = button("Undo", "key Backspace", () => back());
  const clear = button("Clear", "an empty canvas", () => change(() => new Uint8Array(SIDE * SIDE)));
  const more = button("Refine on", "look for better numbers until there are none", () => goOn());
  const outlines = make("input", { type: "checkbox", checked: true, onchange: () => paint() });
  const begin = (k) => () => change(() => unpacked(bytesOf(model.get("examples")), k));
  const examples = model.get("names").map((name, k) => button(name, `draw a ${name}`, begin(k)));
  const row = (...children) => make("div", { className: "draw-row" }, ...children);
  const answers = row(...[first, best].map((canvas, k) => make("figure", {}, canvas, captions[k])));
  const side = make("div", { className: "draw-side" }, answers, path, text, more);
  const switcher = make("label", {}, outlines, " outlines of the primitives");
  const root = make("div", { className: "draw-widget" },
    row(pen, eraser, make("label", {}, "width ", width), fill, undo, clear),
    row("examples", ...examples),
    make("div", { className: "draw-desk" }, make("div", {}, paper, switcher), side),
    status,
  );
  root.dataset.lmSuppressShortcuts = "true"; // JupyterLab's own keys, such as arrows, stay out
  el.append(root);

  let [ink, past, number] = [new Uint8Array(SIDE * SIDE), [], -1];
  let [on, last, cursor, finger] = [1, null, null, 0]; // pen or eraser; the stroke's last point; the keys' place
  let [ended, asked, slowest, endless] = [0, 0, 0, false]; // when the stroke ended, when Python was asked last
  let [timer, alarm, pointed] = [0, 0, null];

  // Is what Python has sent about what is drawn now?
  const present = () => model.get("view").number === number;

  function paint() {
    const pen = paper.getContext("2d");
    const view = present() ? model.get("view") : {};
    const shown = outlines.checked && view.tokens ? view.tokens.filter((token) => token.kind) : [];
    pen.clearRect(0, 0, paper.width, paper.height);
    pen.imageSmoothingEnabled = false;
    pen.drawImage(print(ink, shown.length ? PALE : INK), 0, 0, paper.width, paper.height);
    shown.forEach((token) => trace(pen, token, token === pointed ? 9 : 4));
    if (cursor && document.activeElement === paper) {
      pen.setLineDash([]);
      Object.assign(pen, { strokeStyle: CURSOR, lineWidth: last ? 5 : 3 });
      pen.beginPath();
      pen.arc(...cursor.map((k) => k * ZOOM), Math.max(8, (width.value / 2) * ZOOM), 0, 2 * Math.PI);
      pen.stroke();
    }
    [undo.disabled, clear.disabled, fill.disabled] = [!past.length, !ink.includes(1), !ink.includes(1)];
    root.dataset.draws = Number(root.dataset.draws ?? 0) + 1; // lets a test wait for a picture, not for a time
  }

  function choose(value) {
    on = value;
    [pen.ariaPressed, eraser.ariaPressed] = [String(on === 1), String(on === 0)];
  }

  // A drawing begins to change: whatever is still found for the old one is too late.
  function start() {
    past = [...past.slice(-MOST), ink];
    [ink, number, endless, slowest] = [ink.slice(), number + 1, false, 0];
    clearTimeout(timer);
    clearTimeout(alarm);
    hide();
  }

  function end() {
    ended = performance.now();
    delete root.dataset.seconds;
    clearTimeout(timer);
    timer = setTimeout(() => tell({ do: "read", number }, [packed(ink).buffer]), PAUSE);
    paint();
  }

  const change = (by) => (start(), (ink = by(ink)), end());
  const back = () => past.length && (start(), (ink = past.at(-2)), (past = past.slice(0, -2)), end());
  const goOn = () => ((endless = true), (ended = performance.now()), update());

  function tell(message, buffers) {
    asked = performance.now();
    clearTimeout(alarm);
    alarm = setTimeout(() => say(SILENCE), PATIENCE);
    model.send(message, undefined, buffers);
  }

  function say(sentence, trouble = true) {
    if (status.textContent !== sentence) status.textContent = sentence;
    status.classList.toggle("draw-trouble", trouble);
  }

  function hide() {
    side.classList.add("draw-old");
    more.hidden = true;
    say("", false);
  }

  // Python has read a drawing, or refined its program once.
  function update() {
    const view = model.get("view");
    if (view.number < number) return;
    if (view.number > number) adopt(view);
    clearTimeout(alarm);
    const pictures = bytesOf(model.get("pictures"));
    const found = view.distances !== undefined;
    side.hidden = !found && view.hint; // an empty desk at first
    side.classList.toggle("draw-old", !found);
    if (!found) say(view.message, !view.hint);
    else show(view, pictures);
    paint();
  }

  // Somebody else drew: Python, or another view of the same widget.
  function adopt(view) {
    if (number >= 0) past = [...past.slice(-MOST), ink];
    [ink, number, last] = [unpacked(bytesOf(model.get("pictures"))), view.number, null];
    [ended, asked, slowest, endless] = [performance.now(), performance.now(), 0, false];
    clearTimeout(timer);
    delete root.dataset.seconds;
  }

  function show(view, pictures) {
    const { distances, done, tokens } = view;
    const now = performance.now();
    slowest = Math.max(slowest, now - asked);
    const stopped = !done && !endless && now - ended + 1.2 * slowest > LIMIT;
    print(unpacked(pictures, 1), INK, first);
    print(unpacked(pictures, 2), INK, best);
    captions[0].textContent = `the network's answer: ${px(distances[0])}`;
    says.textContent = `refined: ${px(distances.at(-1))}`;
    [first.ariaLabel, best.ariaLabel] = ["what the network's program draws", "what the refined program draws"];
    const way = distances.map((each) => each.toFixed(2)).join(" → ");
    path.textContent = distances.length > 1 ? `sweep by sweep: ${way} px` : "";
    text.replaceChildren(...tokens.map((token) => chip(token, (one) => ((pointed = one), paint()))));
    more.hidden = !stopped;
    if (done || stopped) root.dataset.seconds = (now - ended) / 1000;
    else tell({ do: "improve", number, sweeps: distances.length - 1 });
    const sentence = report(view, stopped, now - ended, endless ? "later" : "after the stroke");
    if (sentence) say(sentence, false);
  }

  const place = (event) => {
    const area = paper.getBoundingClientRect();
    return [(event.clientX - area.left) / area.width, (event.clientY - area.top) / area.height].map((k) => k * SIDE);
  };
  const go = (to) => (line(ink, last, to, Number(width.value), on), (last = to), paint());
  paper.addEventListener("pointerdown", (event) => {
    if (event.button || last) return;
    paper.setPointerCapture(event.pointerId);
    start();
    [last, cursor, finger] = [place(event), null, event.pointerId];
    go(last);
  });
  paper.addEventListener("pointermove", (event) => {
    if (!last || cursor || event.pointerId !== finger) return;
    const events = event.getCoalescedEvents?.() ?? [];
    (events.length ? events : [event]).forEach((each) => go(place(each)));
  });
  const lift = () => last && ((last = null), end());
  const leave = (event) => {
    if (!last || cursor || event.pointerId !== finger) return;
    if (event.type === "pointerup") go(place(event)); // a browser need not tell of the last bit of the way before
    lift();
  };
  ["pointerup", "pointercancel"].forEach((name) => paper.addEventListener(name, leave));
  paper.addEventListener("blur", () => (cursor && lift(), (cursor = null), paint()));

  // The keys: arrows move, space puts the pen down and lifts it.
  function press(event) {
    const step = ARROWS[event.key];
    const actions = { p: () => choose(1), e: () => choose(0), f: () => fill.click(), Backspace: () => last || back() };
    if (event.target === paper && (step || event.key === " ")) {
      cursor ??= [SIDE / 2, SIDE / 2];
      const far = event.shiftKey ? 8 : 1; // pixels
      if (step) cursor = cursor.map((k, axis) => Math.min(SIDE, Math.max(0, k + far * step[axis])));
      else if (last) lift();
      else start(), (last = cursor);
      last ? go(cursor) : paint();
    } else if (actions[event.key] && !event.ctrlKey && !event.metaKey) actions[event.key]();
    else return;
    event.preventDefault();
    event.stopPropagation();
  }
  root.addEventListener("keydown", press);
  choose(1);
  model.on("change:view", update);
  update();
  return () => (model.off("change:view", update), clearTimeout(timer), clearTimeout(alarm));
}

export default { render };
