// The page that relights a view: sliders and colours of daylight and lamps, the picture, the command.
import { LightGl } from "./light_gl.js";
import { numbers, packetOf } from "./light_packet.js";
import { Plane } from "./plane.js";
import { toneOf } from "./tone.js";

const SAMPLE = 6000; // pixels that tell the exposure while a slider moves
const SETTLE_MS = 120; // then all of them do
const TELL_MS = 200; // between two commands shown: new text costs a frame as much as the picture
const SLOW_MS = 30; // between two pictures: a machine that takes longer draws fewer pixels
const MOST_STEP = 3; // every so many-th pixel, while a slider moves
const by = (id) => document.getElementById(id);
const stage = by("stage");
if (stage) start();

async function start() {
  const plane = new Plane(stage);
  const canvas = plane.add("canvas");
  canvas.id = "picture";
  by("denoise").addEventListener("change", () => {
    keepInAddress(lastState, by("denoise").checked);
    setTimeout(() => location.reload(), 250);
  });
  const said = new URLSearchParams(location.search);
  if (said.has("denoise")) by("denoise").checked = said.get("denoise") !== "0";
  let light;
  try {
    light = await load(by("denoise").checked, (text) => (by("status").textContent = text));
    plane.setSize(light.width, light.height);
    new Relight(canvas, light, said);
  } catch (error) {
    by("status").textContent = `This view cannot be relit here: ${error.message}`;
  }
}

// tell: called with the progress, once a second and after each piece.
async function load(denoise, tell) {
  const { base, version } = stage.dataset;
  const began = Date.now();
  const made = denoise ? "Denoising the layers of light, once" : "Preparing the layers of light";
  tell(`${made}…`);
  const telling = setInterval(() => tell(`${made}: ${Math.round((Date.now() - began) / 1000)} s…`), 1000);
  let answer;
  try {
    answer = await fetch(`${base}/light?denoise=${denoise ? 1 : 0}&v=${encodeURIComponent(version)}`);
  } finally {
    clearInterval(telling);
  }
  if (!answer.ok) {
    const page = new DOMParser().parseFromString(await answer.text(), "text/html");
    throw new Error(page.querySelector(".nothing > p")?.textContent || `answer ${answer.status}`);
  }
  return packetOf(await bytesOf(answer, tell));
}

async function bytesOf(answer, tell) {
  const size = Number(answer.headers.get("content-length")), reader = answer.body.getReader();
  const chunks = [];
  let n = 0;
  for (let part = await reader.read(); !part.done; part = await reader.read()) {
    chunks.push(part.value);
    n += part.value.length;
    tell(`Loading the light: ${(n / 1e6).toFixed(1)} of ${(size / 1e6).toFixed(1)} MB…`);
  }
  return new Blob(chunks).arrayBuffer();
}

let lastState = [];

class Relight {
  constructor(canvas, light, said) {
    this.light = light;
    this.names = [...light.planes.keys()].filter((name) => name !== "albedo");
    this.gl = new LightGl(canvas, light.width, light.height, this.names.map((name) => light.planes.get(name)));
    // Layers as numbers: a sample for every frame, all pixels for the last one.
    const step = Math.max(1, Math.floor((light.width * light.height) / SAMPLE));
    this.sample = this.#numbers(step);
    this.all = null;
    this.step = 1;
    this.controls = controlsOf(light, said, (control) => this.change(control));
    by("controls").replaceChildren(...this.controls.map((c) => c.element));
    for (const button of document.querySelectorAll("[data-preset]")) button.addEventListener("click", () => this.preset(button.dataset.preset));
    by("copy").addEventListener("click", () => navigator.clipboard?.writeText(commandOf(this.controls)));
    by("save").addEventListener("click", () => this.save(canvas));
    by("status").textContent = "";
    this.change();
  }

  #numbers(step) {
    const { planes, scale } = this.light;
    return { albedo: numbers(planes.get("albedo"), step, 1), layers: this.names.map((name) => numbers(planes.get(name), step, 1 / scale)) };
  }

  // control: the only one that moved, or none for several.
  change(control) {
    stage.dataset.settled = "";
    lastState = this.controls;
    if (control) this.telling ||= setTimeout(() => this.#tell(), TELL_MS);
    else this.#tell();
    if (control !== this.moved) this.held = null;
    this.moved = control;
    clearTimeout(this.settling);
    this.waiting ||= requestAnimationFrame((now) => this.#frame(now));
  }

  // The command that makes this picture, and the address that shows it again.
  #tell() {
    clearTimeout(this.telling);
    this.telling = 0;
    by("command").textContent = commandOf(this.controls);
    keepInAddress(this.controls, by("denoise").checked);
  }

  settle() {
    clearTimeout(this.settling);
    this.#tell();
    this.all ??= this.#numbers(1);
    const { albedo, layers } = this.all;
    const factors = factorsOf(this.controls, this.names);
    const tone = toneOf(sumOf(layers, factors), albedo, this.light.tone);
    this.#drawAll(factors, tone, 1);
    this.held = null;
    stage.dataset.settled = "yes";
  }

  // While a slider moves: fewer pixels tell the exposure, and what does not move is summed once.
  #frame(now) {
    this.waiting = 0;
    this.#chooseStep(now);
    const { albedo, layers } = this.sample, { tone: fields, scale } = this.light;
    if (this.moved) this.held ??= this.#hold(this.moved);
    if (this.held) {
      const factor = this.moved.factor(), { still, moving } = this.held;
      const sum = still.map((v, i) => v + moving[i] * factor[i % 3]);
      this.gl.drawHeld(factor, 1 / scale, toneOf(sum, albedo, fields), fields.preset === "released", this.step);
    } else {
      const factors = factorsOf(this.controls, this.names);
      this.#drawAll(factors, toneOf(sumOf(layers, factors), albedo, fields), this.step);
    }
    // A slow machine must not take the time between two pictures for the end of a drag.
    this.settling = setTimeout(() => this.settle(), Math.max(SETTLE_MS, 3 * (this.average ?? 0)));
  }

  #hold(control) {
    const without = factorsOf(this.controls, this.names, new Map([[control.name, [0, 0, 0]]]));
    const whole = factorsOf(this.controls, this.names, new Map([[control.name, [1, 1, 1]]]));
    const moving = whole.map((f, k) => f - without[k]);
    if (!this.gl.hold(Float32Array.from(without), Float32Array.from(moving), this.step)) return null;
    const { layers } = this.sample;
    return { still: sumOf(layers, without), moving: sumOf(layers, moving) };
  }

  // Pictures that come too slowly get fewer pixels; the last one always has all.
  #chooseStep(now) {
    const took = now - (this.before ?? -Infinity);
    this.before = now;
    if (took > 4 * SETTLE_MS) return; // a new drag
    this.average = this.average === undefined ? took : 0.7 * this.average + 0.3 * took;
    if (this.average > SLOW_MS && this.step < MOST_STEP) {
      this.step++;
      this.average = undefined;
      this.held = null;
    }
  }

  #drawAll(factors, tone, step) {
    const scaled = Float32Array.from(factors, (f) => f / this.light.scale);
    this.gl.draw(scaled, tone, this.light.tone.preset === "released", step);
  }

  preset(name) {
    const values = { rendered: [1, 1], daylight: [1, 0], lamps: [0, 1], evening: [0.02, 1] }[name];
    for (const control of this.controls) {
      const isOutdoor = control.name === "outdoor";
      control.set(isOutdoor ? values[0] : control.name === "indoor" ? values[1] : 1, "#ffffff");
    }
    this.change();
  }

  save(canvas) {
    this.settle();
    canvas.toBlob((blob) => {
      const link = document.createElement("a");
      link.href = URL.createObjectURL(blob);
      link.download = stage.dataset.saveas;
      link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), 10000);
    }, "image/png");
  }
}

// The sum of layers as numbers, three factors of each.
function sumOf(layers, factors) {
  const sum = new Float32Array(layers[0].length);
  layers.forEach((layer, k) => {
    const [r, g, b] = factors.slice(3 * k, 3 * k + 3);
    if (r === 0 && g === 0 && b === 0) return;
    for (let i = 0; i < sum.length; i += 3) {
      sum[i] += layer[i] * r;
      sum[i + 1] += layer[i + 1] * g;
      sum[i + 2] += layer[i + 2] * b;
    }
  });
  return sum;
}

// A control of each light group and lamp: {name, flag, element, factor(), set(), isOne()}.
function controlsOf(light, said, onChange) {
  const rows = [{ name: "outdoor", flag: "--outdoor ", title: "Daylight", note: "sky and sun" }];
  rows.push({ name: "indoor", flag: "--indoor ", title: "All lamps", note: "" });
  for (const lamp of light.lamps) {
    const note = lamp.layer ? `${(100 * lamp.share).toFixed(0)} % of lamp light` : "no light here";
    rows.push({ name: `lamp${lamp.number}`, flag: `--lamp ${lamp.number}=`, title: `${lamp.number} ${lamp.name}`, note, isDark: !lamp.layer });
  }
  return rows.map((row) => controlOf(row, said.get(row.name), onChange));
}

function controlOf(row, text, onChange) {
  const element = document.createElement("div");
  element.className = "lamp";
  const name = document.createElement("span"), note = document.createElement("small");
  name.className = "name";
  name.append(row.title, note);
  note.textContent = row.note;
  const slider = inputOf("range", `${row.title}: strength`), colour = inputOf("color", `${row.title}: colour`);
  const output = document.createElement("output");
  Object.assign(slider, { min: 0, max: 200, step: 1 });
  slider.disabled = colour.disabled = Boolean(row.isDark);
  slider.dataset.light = colour.dataset.light = row.name;
  element.append(name, slider, output, colour);
  const control = {
    name: row.name, flag: row.flag, element,
    // A slider's middle is 1, its end 4; a colour is a filter before the light.
    factor: () => linearOf(colour.value).map((c) => rounded(strengthOf(slider.value) * c)),
    set(strength, hex) {
      slider.value = Math.round(100 * Math.sqrt(strength));
      colour.value = hex;
      show();
    },
    text: () => `${slider.value},${colour.value.slice(1)}`,
    isOne: () => slider.value === "100" && colour.value === "#ffffff",
  };
  const show = () => (output.textContent = `${rounded(strengthOf(slider.value)).toFixed(2)} x`);
  const [value, hex] = (text ?? "").split(",");
  control.set(1, /^[0-9a-f]{6}$/.test(hex ?? "") ? `#${hex}` : "#ffffff");
  if (/^\d{1,3}$/.test(value) && Number(value) <= 200) slider.value = value;
  show();
  for (const input of [slider, colour]) {
    input.addEventListener("input", () => {
      show();
      onChange(control);
    });
  }
  return control;
}

function inputOf(type, label) {
  const input = document.createElement("input");
  input.type = type;
  input.setAttribute("aria-label", label);
  return input;
}

const strengthOf = (value) => (value / 100) ** 2;
const rounded = (value) => Math.round(value * 1e4) / 1e4;
const linearOf = (hex) =>
  [1, 3, 5].map((k) => parseInt(hex.slice(k, k + 2), 16) / 255).map((v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4));

// Three factors of each layer, in the layers' order: a lamp's own times that of all lamps.
// others: name of a control -> factors that replace its own.
function factorsOf(controls, names, others = new Map()) {
  const found = new Map(controls.map((c) => [c.name, others.get(c.name) ?? c.factor()]));
  return names.flatMap((name) => {
    if (name === "outdoor" || name === "indoor") return found.get(name);
    const own = found.get(name) ?? [1, 1, 1];
    return own.map((f, c) => f * found.get("indoor")[c]);
  });
}

function commandOf(controls) {
  const words = [stage.dataset.command];
  for (const control of controls) {
    if (control.isOne()) continue;
    const [r, g, b] = control.factor();
    words.push(control.flag + (r === g && g === b ? r : `${r},${g},${b}`));
  }
  if (!by("denoise").checked) words.push("--no-denoise");
  return words.join(" ");
}

let addressing = 0;
function keepInAddress(controls, isDenoised) {
  clearTimeout(addressing);
  addressing = setTimeout(() => {
    const said = new URLSearchParams();
    for (const control of controls) if (!control.isOne()) said.set(control.name, control.text());
    if (isDenoised !== (stage.dataset.denoised === "yes")) said.set("denoise", isDenoised ? 1 : 0);
    const text = String(said);
    history.replaceState(null, "", text ? `?${text}` : location.pathname);
  }, 200);
}
