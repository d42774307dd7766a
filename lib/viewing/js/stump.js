// The three layers of a CSG-Stump with a switch for every cell of its matrices (lib/viewing/stump_widget.py). Python
// sends the pictures of the primitives and all cells as "0" and "1"; the layers are computed here, so that a click
// waits for nobody. A picture has a bit for each pixel: bit k of byte b is the pixel 8 b + k, row by row from above.
// No build step: what stands here is what the browser runs.
const [INK, PALE] = ["#24344d", "#b8c0cc"];
const ARROWS = { ArrowLeft: [0, -1], ArrowRight: [0, 1], ArrowUp: [-1, 0], ArrowDown: [1, 0] };

function make(tag, properties = {}, ...children) {
  const { style, ...rest } = properties;
  const element = Object.assign(document.createElement(tag), rest);
  element.style.cssText = style ?? "";
  element.append(...children);
  return element;
}

const bytesOf = (view) => new Uint8Array(view.buffer ?? view, view.byteOffset ?? 0, view.byteLength);

// The paper's three equations on bits: a primitive or what is outside of it; what is in all; what is in any.
function layersOf(primitives, columns, cells) {
  const [rows, size] = [primitives.length, primitives[0].length];
  const complements = primitives.map((bits, k) => (cells[k] === "1" ? bits.map((byte) => ~byte) : bits));
  const nodes = Array.from({ length: columns }, (_, c) => {
    const bits = new Uint8Array(size).fill(255); // an intersection of nothing is everything
    const joined = complements.filter((_, k) => cells[rows + k * columns + c] === "1");
    joined.forEach((row) => row.forEach((byte, i) => (bits[i] &= byte)));
    return bits;
  });
  const shape = new Uint8Array(size); // a union of nothing is nothing
  const united = nodes.filter((_, c) => cells[rows + rows * columns + c] === "1");
  united.forEach((node) => node.forEach((byte, i) => (shape[i] |= byte)));
  return { complements, nodes, shape };
}

// A picture in one colour; where it is not, the paper below it is seen.
function print(canvas, bits, color) {
  const pen = canvas.getContext("2d");
  const image = pen.createImageData(canvas.width, canvas.height);
  const dots = new Uint32Array(image.data.buffer); // a pixel's red, green, blue and opacity are the bytes of a number
  const rgb = [1, 3, 5].map((k) => parseInt(color.slice(k, k + 2), 16));
  const [dot] = new Uint32Array(Uint8Array.of(...rgb, 255).buffer);
  for (let pixel = 0; pixel < dots.length; pixel++) if ((bits[pixel >> 3] >> (pixel & 7)) & 1) dots[pixel] = dot;
  pen.putImageData(image, 0, 0);
}

async function copy(field, button) {
  const byHand = () => (field.select(), document.execCommand("copy")); // no permission, or a page not served safely
  await (navigator.clipboard?.writeText(field.value) ?? Promise.reject()).catch(byHand);
  button.textContent = "Copied";
  setTimeout(() => (button.textContent = "Copy as text"), 1500);
}

// What a switch says now, and what surprises many: an empty row of dots is no empty picture.
function report(name, one, cells, rows, columns) {
  const united = (c) => cells[rows + rows * columns + c] === "1";
  const dotless = (c) => [...Array(rows).keys()].every((k) => cells[rows + k * columns + c] === "0");
  const nodes = [...Array(columns).keys()];
  const notes = nodes.filter((c) => united(c) && dotless(c)).map((c) => `S${c + 1} has no dots: it is everything.`);
  if (!nodes.some(united)) notes.push("No S is united: T is nothing.");
  return [name && `${name}: ${one ? "yes" : "no"}.`, ...notes].join(" ");
}

// Where a switch stands in the table of switches: W_C is its column 0, W_U its last row.
function spot(place, rows, columns) {
  const cross = place - rows;
  return cross < 0 ? [place, 0] : [Math.floor(cross / columns), 1 + (cross % columns)];
}

// The board: a row a primitive, a column a node, switches where they cross, the shape at the end.
function build({ rows, columns, names, side }, primitives, flip) {
  const count = rows.length;
  const at = (row, column, className, ...children) =>
    make("div", { className, style: `grid-area: ${row} / ${column}` }, ...children);
  const paper = (ariaLabel) => make("canvas", { width: side, height: side, role: "img", ariaLabel });
  const node = (row, column, textContent, canvas, title = "") =>
    Object.assign(at(row, column, "stump-node", canvas, make("small", { textContent })), { title });
  const papers = (letter, many) => Array.from({ length: many }, (_, k) => paper(`${letter}${k + 1}`));
  const [inputs, complements, nodes] = [papers("O", count), papers("F", count), papers("S", columns)];
  const shape = paper("T, the shape");
  inputs.forEach((canvas, k) => print(canvas, primitives[k], rows[k].color));
  const switches = names.map((name, place) => {
    const className = place < count ? "stump-not" : "stump-dot";
    const textContent = place < count ? "not" : "";
    return make("button", { className, textContent, ariaLabel: name, title: name, onclick: () => flip(place) });
  });
  const crossings = switches.map((button, place) => {
    const [row, column] = spot(place, count, columns);
    const marks = {
      "stump-crossing": true, "stump-wires": column, first: !row, left: column === 1, right: column === columns,
      union: row === count,
    };
    const className = Object.keys(marks).filter((mark) => marks[mark]).join(" ");
    return at(row === count ? count + 3 : row + 2, column ? column + 3 : 2, className, button);
  });
  const size = columns > 8 ? 46 : columns > 5 ? 60 : 76;
  const wordy = size === 76; // else there is room for names only
  const words = wordy ? ["primitives", "W_C", "complement"] : ["O", "W_C", "F"];
  const heads = words.map((text, k) => at(1, k + 1, "stump-head", text));
  if (columns) heads.push(at(1, `4 / auto / span ${columns}`, "stump-head", "W_I"));
  const says = [["S, intersections: where all F with a dark dot are", 2], ["W_U, which S are united", 3]].map(
    ([text, row]) => at(count + row, "1 / span 1 / span 3", "stump-says", text),
  );
  const parts = [
    ...heads, ...says, ...crossings,
    ...inputs.map((canvas, k) => node(k + 2, 1, `O${k + 1}${wordy ? " " + rows[k].name : ""}`, canvas, rows[k].title)),
    ...complements.map((canvas, k) => node(k + 2, 3, `F${k + 1}`, canvas)),
    ...nodes.map((canvas, c) => node(count + 2, c + 4, `S${c + 1}`, canvas)),
    at(2, `${columns + 4} / span ${count + 2}`, "stump-shape", make("small", { textContent: "T, the shape" }), shape),
  ];
  const style = `--side: ${size}px; --nodes: ${Math.max(1, columns)}`;
  return { desk: make("div", { className: "stump-desk", style }, ...parts), switches, complements, nodes, shape };
}

function render({ model, el }) {
  const button = (text, title, onclick) => make("button", { textContent: text, title, onclick });
  const field = make("textarea", { className: "stump-text", readOnly: true, ariaLabel: "the stump as text" });
  const status = make("div", { className: "stump-status", role: "status", ariaLive: "polite" });
  const become = (past, cells) => (model.set({ past, cells }), model.save_changes());
  const change = (cells) => cells !== model.get("cells") && become([...model.get("past"), model.get("cells")], cells);
  const flip = (place) => {
    const cells = model.get("cells");
    flipped = place;
    change(cells.slice(0, place) + (cells[place] === "1" ? "0" : "1") + cells.slice(place + 1));
  };
  const back = () => {
    const past = model.get("past");
    if (past.length) (flipped = -1), become(past.slice(0, -1), past.at(-1));
  };
  const undo = button("Undo", "key Backspace", back);
  const begin = () => ((flipped = -1), change(model.get("board").start));
  const reset = button("Reset", "the matrices of the beginning", begin);
  const copier = button("Copy as text", "copy the stump's text", () => copy(field, copier));
  const root = make("div", { className: "stump-widget" });
  root.dataset.lmSuppressShortcuts = "true"; // JupyterLab's own keys, such as arrows, stay out
  el.append(root);

  let [primitives, board, flipped] = [[], {}, -1]; // flipped: the switch that was clicked last
  const update = () => {
    const [cells, { rows, columns, names }] = [model.get("cells"), model.get("board")];
    if (cells.length !== board.switches?.length) return; // another stump is on its way
    const layers = layersOf(primitives, columns, cells);
    rows.forEach((row, k) => print(board.complements[k], layers.complements[k], row.color));
    layers.nodes.forEach((bits, c) => print(board.nodes[c], bits, cells.at(c - columns) === "1" ? INK : PALE));
    print(board.shape, layers.shape, INK);
    board.switches.forEach((each, place) => (each.ariaPressed = String(cells[place] === "1")));
    undo.disabled = !model.get("past").length;
    reset.disabled = cells === model.get("board").start;
    status.textContent = report(names[flipped], cells[flipped] === "1", cells, rows.length, columns);
    root.dataset.draws = Number(root.dataset.draws ?? 0) + 1; // lets a test wait for a picture, not for a time
  };
  const rebuild = () => {
    const [bits, { rows }] = [bytesOf(model.get("inside")), model.get("board")];
    const size = bits.length / rows.length;
    primitives = rows.map((_, k) => bits.subarray(k * size, (k + 1) * size));
    board = build(model.get("board"), primitives, flip);
    flipped = -1;
    root.replaceChildren(board.desk, make("div", { className: "stump-bar" }, undo, reset, copier, status), field);
    update();
  };
  const write = () => {
    field.value = model.get("text");
    field.rows = field.value.trimEnd().split("\n").length;
  };
  const press = (event) => {
    const place = board.switches.indexOf(event.target);
    if (event.key === "Backspace") back();
    else if (place < 0 || !ARROWS[event.key]) return;
    else {
      const { rows, columns } = model.get("board");
      const goal = spot(place, rows.length, columns).map((k, axis) => k + ARROWS[event.key][axis]);
      board.switches.find((_, k) => String(spot(k, rows.length, columns)) === String(goal))?.focus();
    }
    event.preventDefault();
    event.stopPropagation();
  };
  root.addEventListener("keydown", press);
  const listeners = Object.entries({ cells: update, past: update, board: rebuild, text: write });
  listeners.forEach(([trait, listener]) => model.on(`change:${trait}`, listener));
  rebuild();
  write();
  return () => listeners.forEach(([trait, listener]) => model.off(`change:${trait}`, listener));
}

export default { render };
