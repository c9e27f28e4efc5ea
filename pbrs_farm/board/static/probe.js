// The pixel under the pointer: class, instance, depth, normal and colour.

const BITS = { instance: 1, depth: 2, normal: 4, semantic: 8 };

export class Probe {
  constructor(list, base, version, instances) {
    this.list = list;
    this.instances = new Map(instances.map(([id, name, kind, box, rgb]) => [id, { name, kind, rgb }]));
    this.planes = null;
    this.picture = null;
    this.last = null;
    fetch(`${base}/pixels?v=${encodeURIComponent(version)}`)
      .then((answer) => (answer.ok ? answer.arrayBuffer() : Promise.reject(answer.status)))
      .then((data) => {
        this.planes = planesOf(data);
        this.show(this.last);
      })
      .catch(() => {});
  }

  setPicture(image) {
    // Read colours from a copy in memory.
    const canvas = document.createElement("canvas");
    canvas.width = image.naturalWidth;
    canvas.height = image.naturalHeight;
    const context = canvas.getContext("2d", { willReadFrequently: true });
    context.drawImage(image, 0, 0);
    this.picture = context;
  }

  show(point) {
    if (!point) return;
    this.last = point;
    const rows = [["pixel", `${point.x}, ${point.y}`]];
    const planes = this.planes;
    if (planes && point.x < planes.width && point.y < planes.height) {
      const k = point.y * planes.width + point.x;
      const id = planes.instance ? planes.instance[k] : 0;
      const thing = this.instances.get(id);
      const kind = thing ? thing.kind : planes.semantic ? `class ${planes.semantic[k]}` : "";
      if (id) rows.push(["class", kind || "-"], ["instance", `${thing?.name || "?"}, ${id}`, thing?.rgb]);
      else rows.push(["class", "nothing"]);
      if (planes.depth) rows.push(["depth", planes.depth[k] ? `${(planes.depth[k] / 1000).toFixed(3)} m` : "-"]);
      if (planes.normal) rows.push(["normal", normalText(planes.normal, 3 * k)]);
    }
    const rgb = this.#colourAt(point);
    if (rgb) rows.push(["colour", `${rgb.join(", ")}`, rgb]);
    this.list.replaceChildren(...rows.flatMap(([name, text, colour]) => entry(name, text, colour)));
  }

  #colourAt({ x, y }) {
    if (!this.picture || x >= this.picture.canvas.width || y >= this.picture.canvas.height) return null;
    return [...this.picture.getImageData(x, y, 1, 1).data.slice(0, 3)];
  }
}

function entry(name, text, colour) {
  const title = document.createElement("dt"), value = document.createElement("dd");
  title.textContent = name;
  if (colour) {
    const swatch = document.createElement("i");
    swatch.className = "swatch";
    swatch.style.background = `rgb(${colour.join(" ")})`;
    value.append(swatch);
  }
  value.append(text);
  return [title, value];
}

function normalText(normals, at) {
  const n = [0, 1, 2].map((c) => (normals[at + c] / 65535) * 2 - 1);
  if (Math.hypot(...n) < 0.5) return "-";
  const said = n.map((v) => v.toFixed(2).replace("-0.00", "0.00"));
  return `${said[0]} right, ${said[1]} forward, ${said[2]} up`;
}

// The packet of board/pictures.py as typed arrays.
function planesOf(data) {
  const view = new DataView(data);
  const magic = String.fromCharCode(...new Uint8Array(data, 0, 4));
  if (magic !== "PBPX") throw new Error("not the pixels of a view");
  const planes = { width: view.getUint32(4, true), height: view.getUint32(8, true) };
  const flags = view.getUint32(12, true), n = planes.width * planes.height;
  let at = 16;
  const take = (name, Type, count) => {
    if (!(flags & BITS[name])) return;
    const size = count * Type.BYTES_PER_ELEMENT;
    planes[name] = new Type(data.slice(at, at + size));
    at += size;
  };
  take("instance", Uint16Array, n);
  take("depth", Uint16Array, n);
  take("normal", Uint16Array, 3 * n);
  take("semantic", Uint8Array, n);
  return planes;
}
