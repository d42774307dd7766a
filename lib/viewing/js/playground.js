// A CSG program put together with the mouse (lib/viewing/playground.py, where programs are run and checked). This file
// draws the bits that Python sends, and tells Python what was clicked. A picture is 512 bytes, 8 a row: bit k of byte b
// is the pixel x = 8 b + k, y grows down. No build step: what stands here is what the browser runs.
const KINDS = { c: "● circle", s: "■ square", t: "▲ triangle" };
const SIZES = [8, 12, 16, 20, 24, 28, 32];
const [SIDE, BYTES, ZOOM, STEP, POINTS] = [64, 512, 6, 8, 7];
const [INK, A, B, PREVIEW, REFUSED, DOT] = ["#24344d", "#0072b2", "#e08700", "#009e73", "#b42318", "#8a94a3"];

function make(tag, properties = {}, ...children) {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(...children);
  return element;
}

const bytesOf = (view) => new Uint8Array(view.buffer ?? view, view.byteOffset ?? 0, view.byteLength);

// One picture as a canvas of 64 x 64 in one colour, without a background.
function print(bytes, place, color) {
  const canvas = make("canvas", { width: SIDE, height: SIDE });
  const pen = canvas.getContext("2d");
  const image = pen.createImageData(SIDE, SIDE);
  const rgb = [1, 3, 5].map((k) => parseInt(color.slice(k, k + 2), 16));
  for (let pixel = 0; pixel < SIDE * SIDE; pixel++)
    if ((bytes[place * BYTES + (pixel >> 3)] >> (pixel & 7)) & 1) image.data.set([...rgb, 255], 4 * pixel);
  pen.putImageData(image, 0, 0);
  return canvas;
}

// Under the mouse: the number of the nearest of the 7 x 7 centers.
function pointAt(event) {
  const area = event.currentTarget.getBoundingClientRect();
  const nearest = (share) => Math.min(POINTS, Math.max(1, Math.round((share * SIDE - 0.5) / STEP))) - 1;
  const column = nearest((event.clientX - area.left) / area.width);
  return nearest((event.clientY - area.top) / area.height) * POINTS + column;
}

const center = (point) => [(point % POINTS) + 1, Math.floor(point / POINTS) + 1].map((k) => k * STEP);

async function copy(field, button) {
  const byHand = () => (field.select(), document.execCommand("copy")); // no permission, or a page not served safely
  await (navigator.clipboard?.writeText(field.value) ?? Promise.reject()).catch(byHand);
  button.textContent = "Copied";
  setTimeout(() => (button.textContent = "Copy"), 1500);
}

// A row of buttons of which one is pressed: the value of a trait.
function chooser(model, trait, values) {
  const choose = (value) => () => (model.set(trait, value), model.save_changes());
  const text = (value) => KINDS[value] ?? String(value);
  const buttons = values.map((value) => make("button", { textContent: text(value), onclick: choose(value) }));
  const update = () => buttons.forEach((b, i) => (b.ariaPressed = String(values[i] === model.get(trait))));
  update();
  return [make("div", { className: "csg-choice", role: "group", ariaLabel: trait }, ...buttons), update];
}

// The big canvas: the top of the stack, pale below it what an operation would take with it, the points, the preview.
function paint(paper, model, under) {
  const [pen, refused, many] = [paper.getContext("2d"), model.get("refused"), model.get("view").entries.length];
  const lay = (trait, place, color, opacity) => {
    pen.globalAlpha = opacity;
    pen.drawImage(print(bytesOf(model.get(trait)), place, color), 0, 0, SIDE * ZOOM, SIDE * ZOOM);
  };
  Object.assign(pen, { imageSmoothingEnabled: false, fillStyle: DOT, strokeStyle: "#fff" });
  pen.clearRect(0, 0, SIDE * ZOOM, SIDE * ZOOM);
  if (many > 1) lay("pictures", 1, A, 0.4);
  if (many) lay("pictures", 0, many > 1 ? B : INK, many > 1 ? 0.8 : 1);
  if (under >= 0) lay("stencils", under, refused[under] ? REFUSED : PREVIEW, refused[under] ? 0.25 : 0.6);
  pen.globalAlpha = 1;
  refused.forEach((reason, point) => {
    pen.beginPath();
    pen.arc(...center(point).map((k) => (k + 0.5) * ZOOM), reason ? 1.3 : 3, 0, 2 * Math.PI);
    pen.fill();
    if (!reason) pen.stroke();
  });
}

// The stack as small pictures, its top first; what an operation takes is marked A and B.
function stackItems(entries, pictures) {
  return entries.map((textContent, place) => {
    const [name, color] = (entries.length > 1 && [["B", B], ["A", A]][place]) || ["", INK];
    const letter = make("b", { textContent: name, style: `background:${color}` });
    return make("li", {}, print(pictures, place, color), make("span", {}, letter, make("code", { textContent })));
  });
}

function render({ model, el }) {
  const tell = (what, ...values) => model.send({ do: what, with: values });
  const ask = (what, ...values) => (tell(what, ...values), root.focus({ preventScroll: true })); // keys work on
  const button = (text, title, onclick) => make("button", { textContent: text, title, onclick });
  const paper = make("canvas", { width: SIDE * ZOOM, height: SIDE * ZOOM, className: "csg-paper", role: "img" });
  paper.ariaLabel = "canvas: click a point to push a primitive";
  const [note, status, target] = ["note", "status", "target"].map((name) => make("div", { className: `csg-${name}` }));
  Object.assign(status, { role: "status", ariaLive: "polite" });
  const [stack, chips] = ["stack", "chips"].map((name) => make("ol", { className: `csg-${name}` }));
  const error = make("pre", { className: "csg-error", role: "alert" });
  const field = make("input", { className: "csg-text", spellcheck: false, ariaLabel: "the program's text" });
  const copier = button("Copy", "copy the program's text", () => copy(field, copier));
  const operations = ["+", "*", "-"].map((value) => Object.assign(button("", "", () => ask("push", value)), { value }));
  const [undo, redo, clear] = ["undo", "redo", "clear"].map((what) => button(what, "", () => ask(what)));
  const [[kinds, updateKind], [sizes, updateSize]] = [
    chooser(model, "kind", Object.keys(KINDS)), chooser(model, "size", SIZES),
  ];
  const row = (...children) => make("div", { className: "csg-row" }, ...children);
  const desk = make("div", { className: "csg-desk" }, paper, stack, target);
  const controls = [row(...operations, make("i"), undo, redo, clear), chips, row(field, copier), status, error];
  const root = make("div", { className: "csg-playground", tabIndex: 0 });
  root.append(row(kinds, "size", sizes), desk, note, ...controls);
  el.append(root);

  let [under, pushed] = [-1, -1]; // the point under the mouse; the one just clicked, where no preview hides the result
  const word = (point) => `${model.get("kind")}(${center(point)},${model.get("size")})`;
  const draw = () => {
    const { tokens, shown } = model.get("view");
    const seen = shown < tokens.length - 1 ? `the stack after token ${shown + 1} of ${tokens.length}` : "";
    note.textContent = under < 0 ? seen : model.get("refused")[under] || `click to push ${word(under)}`;
    paint(paper, model, under === pushed ? -1 : under);
    root.dataset.draws = Number(root.dataset.draws ?? 0) + 1; // lets a test wait for a picture, not for a time
  };
  const update = () => {
    const view = model.get("view");
    stack.replaceChildren(...stackItems(view.entries, bytesOf(model.get("pictures"))));
    chips.replaceChildren(...view.tokens.map((token, place) => {
      const chip = button(token, `the stack after token ${place + 1}`, () => ask("look", place));
      return make("li", {}, Object.assign(chip, { ariaCurrent: String(place === view.shown) }));
    }));
    for (const one of operations) {
      const [reason, textContent] = [view.operations[one.value], `${one.value} ${view.meaning[one.value]}`];
      Object.assign(one, { textContent, disabled: !!reason, title: reason || `key ${one.value}` });
    }
    [undo.disabled, redo.disabled, clear.disabled] = [!view.undo, !view.redo, !view.tokens.length];
    status.textContent = view.status;
    root.classList.toggle("csg-valid", view.valid);
    error.textContent = view.error ? `${view.error.message}\n\n${view.error.excerpt}`.trimEnd() : "";
    if (!view.error) field.value = view.tokens.join("");
    else if (view.error.end) field.focus(), field.setSelectionRange(view.error.start, view.error.end);
    if (model.get("goal").byteLength) {
      const score = `IoU of the top: ${view.iou === null ? "–" : view.iou.toFixed(3)}`;
      target.replaceChildren("match this picture", print(bytesOf(model.get("goal")), 0, INK), score);
    }
    draw();
  };
  const press = (event) => {
    if (event.target === field) return event.key === "Enter" && tell("load", field.value);
    const action = { Backspace: ["undo"], "+": ["push", "+"], "*": ["push", "*"], "-": ["push", "-"] }[event.key];
    if (action) event.preventDefault(), event.stopPropagation(), ask(...action);
  };
  const point = (where) => ((pushed = where === pushed ? pushed : -1), where !== under && ((under = where), draw()));
  paper.addEventListener("pointermove", (event) => point(pointAt(event)));
  paper.addEventListener("pointerleave", () => point(-1));
  paper.addEventListener("click", (event) => ask("push", word((under = pushed = pointAt(event)))));
  root.addEventListener("keydown", press);
  const listeners = Object.entries({ view: update, refused: draw, kind: updateKind, size: updateSize });
  listeners.forEach(([trait, listener]) => model.on(`change:${trait}`, listener));
  update();
  return () => listeners.forEach(([trait, listener]) => model.off(`change:${trait}`, listener));
}

export default { render };
