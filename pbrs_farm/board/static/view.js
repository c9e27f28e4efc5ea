// A view's page: two layers with a wipe between them, an overlay, boxes, zoom, and the probe.
import { Plane } from "./plane.js";
import { Probe } from "./probe.js";

const stage = document.getElementById("stage");
const DEFAULTS = { right: "", over: "", opacity: "55", wipe: 0.5, boxes: false };
let waiting = 0; // to write the address
const by = (id) => document.getElementById(id);

if (stage && stage.dataset.packed) start();
by("copy-camera")?.addEventListener("click", () => navigator.clipboard?.writeText(by("camera").textContent));

function start() {
  const { layers, instances } = JSON.parse(stage.dataset.packed);
  const known = new Map(layers.map((layer) => [layer.name, layer]));
  const url = (layer) =>
    `${stage.dataset.base}/shown/${layer}.png?v=${encodeURIComponent(stage.dataset.version)}`;

  // What the address says, within what there is.
  const state = stateFromAddress(known);
  const plane = new Plane(stage);
  const left = plane.add("img"), right = plane.add("img"), over = plane.add("img");
  const boxes = plane.addBoxes();
  const seam = document.createElement("div");
  seam.className = "seam";
  const captions = [document.createElement("span"), document.createElement("span")];
  captions[0].className = "caption";
  captions[1].className = "caption right";
  stage.append(seam, ...captions);
  const probe = new Probe(by("probe"), stage.dataset.base, stage.dataset.version, instances);

  left.addEventListener("load", () => {
    plane.setSize(left.naturalWidth, left.naturalHeight);
    probe.setPicture(left);
    drawBoxes(boxes, instances, left.naturalWidth, left.naturalHeight);
    show();
  });
  for (const image of [left, right, over]) {
    image.addEventListener("error", () => (image.hidden = true));
    image.addEventListener("load", () => (image.hidden = false));
    image.hidden = true;
    image.alt = "";
  }
  plane.onMove = (point) => {
    plane.setMark(null);
    probe.show(point);
  };
  addPixelKeys(plane, probe);
  plane.onChange = show;

  // Controls write the state; show() draws it and keeps it in the address.
  const controls = {
    left: by("left-layer"), right: by("right-layer"), over: by("over-layer"), opacity: by("opacity"),
  };
  for (const [name, control] of Object.entries(controls)) {
    control.value = state[name];
    control.addEventListener("input", () => {
      state[name] = control.value;
      load();
    });
  }
  by("boxes").checked = state.boxes;
  by("boxes").addEventListener("change", () => {
    state.boxes = by("boxes").checked;
    show();
  });
  by("larger").addEventListener("click", () => plane.zoomBy(1.6));
  by("smaller").addEventListener("click", () => plane.zoomBy(1 / 1.6));
  by("fit").addEventListener("click", () => plane.fit());
  seam.addEventListener("pointerdown", (event) => {
    seam.setPointerCapture(event.pointerId);
    event.stopPropagation();
  });
  seam.addEventListener("pointermove", (event) => {
    if (!seam.hasPointerCapture(event.pointerId)) return;
    const box = stage.getBoundingClientRect();
    state.wipe = Math.min(1, Math.max(0, (event.clientX - box.left) / box.width));
    show();
  });
  markRows(boxes);
  addKeys();
  load();

  function load() {
    set(left, state.left);
    set(right, state.right);
    set(over, state.over);
    left.classList.toggle("flat", Boolean(known.get(state.left)?.label));
    right.classList.toggle("flat", Boolean(known.get(state.right)?.label));
    over.className = state.over === "boundary" ? "boundary flat" : "flat";
    show();
  }

  function set(image, layer) {
    const wanted = layer ? url(layer) : "";
    if (!wanted) {
      image.removeAttribute("src");
      image.hidden = true;
    } else if (image.getAttribute("src") !== wanted) {
      image.hidden = true; // until it is there: else the browser draws a broken picture
      image.src = wanted;
    }
  }

  function show() {
    const isTwo = Boolean(state.right);
    // Convert the wipe's position on the stage to a share of the picture.
    const share = plane.shareAt(state.wipe);
    right.style.clipPath = `inset(0 0 0 ${(100 * share).toFixed(3)}%)`;
    seam.hidden = !isTwo;
    seam.style.left = `${100 * state.wipe}%`;
    over.style.opacity = state.opacity / 100;
    boxes.style.display = state.boxes ? "" : "none";
    captions[0].textContent = known.get(state.left)?.title ?? "";
    captions[1].textContent = known.get(state.right)?.title ?? "";
    captions[0].hidden = captions[1].hidden = !isTwo;
    keepInAddress(state);
  }
}


function stateFromAddress(known) {
  const said = new URLSearchParams(location.search);
  const one = (name) => (known.has(said.get(name)) ? said.get(name) : "");
  const wipe = Number(said.get("wipe"));
  const opacity = Number(said.get("opacity"));
  return {
    left: one("left") || by("left-layer").value,
    first: by("left-layer").value,
    right: one("right"),
    over: one("over"),
    opacity: said.has("opacity") && opacity >= 0 && opacity <= 100 ? String(opacity) : DEFAULTS.opacity,
    wipe: said.has("wipe") && wipe >= 0 && wipe <= 1 ? wipe : DEFAULTS.wipe,
    boxes: said.get("boxes") === "1",
  };
}

function keepInAddress(state) {
  // Browsers allow a few changes of the address a second.
  clearTimeout(waiting);
  waiting = setTimeout(() => {
    const said = new URLSearchParams();
    if (state.left !== state.first) said.set("left", state.left);
    for (const name of ["right", "over", "opacity"]) {
      if (state[name] !== DEFAULTS[name]) said.set(name, state[name]);
    }
    if (state.right && state.wipe !== DEFAULTS.wipe) said.set("wipe", state.wipe.toFixed(3));
    if (state.boxes) said.set("boxes", "1");
    const text = String(said);
    history.replaceState(null, "", text ? `?${text}` : location.pathname);
    for (const link of document.querySelectorAll("#before, #after")) link.search = text;
  }, 200);
}

function drawBoxes(svg, instances, width, height) {
  svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
  svg.replaceChildren(
    ...instances.map(([id, name, kind, [x0, y0, x1, y1], [r, g, b]]) => {
      const rect = document.createElementNS("http://www.w3.org/2000/svg", "rect");
      const at = { x: x0, y: y0, width: Math.max(0, x1 - x0), height: Math.max(0, y1 - y0) };
      for (const [key, value] of Object.entries(at)) rect.setAttribute(key, value);
      rect.setAttribute("stroke", `rgb(${r} ${g} ${b})`);
      rect.dataset.instance = id;
      return rect;
    }),
  );
}

function markRows(boxes) {
  // A row of the table shows its box while it is pointed at, or after a tap.
  const table = by("instances");
  if (!table) return;
  const mark = (row, isOn) => {
    const rect = boxes.querySelector(`rect[data-instance="${Number(row.dataset.instance)}"]`);
    if (!rect) return;
    rect.classList.toggle("on", isOn);
    boxes.classList.toggle("pointing", isOn);
    if (isOn) boxes.style.display = "";
    for (const other of boxes.children) other.style.display = isOn && other !== rect ? "none" : "";
    if (!isOn && !by("boxes").checked) boxes.style.display = "none";
  };
  for (const row of table.querySelectorAll("tr[data-instance]")) {
    row.addEventListener("pointerenter", () => mark(row, true));
    row.addEventListener("pointerleave", () => mark(row, false));
  }
}

// The keyboard's pointer: a mark on the picture, moved by the arrow keys while the picture has the focus.
function addPixelKeys(plane, probe) {
  const STEPS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
  const ZOOMS = { "+": 1.6, "=": 1.6, "-": 1 / 1.6 };
  const middle = () => ({ x: Math.floor(plane.width / 2), y: Math.floor(plane.height / 2) });
  const show = (point) => {
    plane.setMark(point);
    probe.show(point);
  };
  stage.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const at = plane.marked ?? probe.last ?? middle();
    const step = STEPS[event.key], far = event.shiftKey ? 10 : 1;
    if (step) {
      const within = (value, most) => Math.min(most - 1, Math.max(0, value));
      show({ x: within(at.x + far * step[0], plane.width), y: within(at.y + far * step[1], plane.height) });
    } else if (ZOOMS[event.key]) {
      plane.zoomBy(ZOOMS[event.key]);
      show(at);
    } else if (event.key === "0") {
      plane.fit();
    } else if (event.key === "Escape") {
      plane.setMark(null);
    } else return;
    event.preventDefault();
    event.stopPropagation();
  });
  stage.addEventListener("focus", () => {
    if (stage.matches(":focus-visible")) show(probe.last ?? middle());
  });
  stage.addEventListener("blur", () => plane.setMark(null));
}

function addKeys() {
  addEventListener("keydown", (event) => {
    if (event.target.closest("input, select, textarea") || event.ctrlKey || event.metaKey || event.altKey) return;
    const link = { ArrowLeft: by("before"), ArrowRight: by("after") }[event.key];
    if (link) link.click();
  });
}
