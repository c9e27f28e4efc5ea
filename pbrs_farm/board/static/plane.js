// A picture with zoom and drag: its layers share one plane inside a stage.

const MOST = 64; // CSS pixels per pixel of the picture

export class Plane {
  constructor(stage) {
    this.stage = stage;
    this.width = 4;
    this.height = 3;
    this.scale = 1; // of the plane over its size when it fits
    this.x = 0;
    this.y = 0;
    this.onMove = () => {};
    this.onChange = () => {};
    this.element = document.createElement("div");
    this.element.className = "plane";
    // A mark at a pixel, as large whatever the zoom.
    this.mark = document.createElement("div");
    this.mark.className = "pixel-mark";
    this.mark.hidden = true;
    this.marked = null;
    stage.append(this.element, this.mark);
    this.pointers = new Map();
    stage.addEventListener("wheel", (event) => this.#wheel(event), { passive: false });
    stage.addEventListener("pointerdown", (event) => this.#down(event));
    stage.addEventListener("pointermove", (event) => this.#move(event));
    for (const name of ["pointerup", "pointercancel"]) {
      stage.addEventListener(name, (event) => this.pointers.delete(event.pointerId));
    }
    new ResizeObserver(() => this.#draw()).observe(stage);
  }

  add(tag) {
    const element = document.createElement(tag);
    this.element.append(element);
    return element;
  }

  addBoxes() {
    const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
    svg.setAttribute("preserveAspectRatio", "none");
    this.element.append(svg);
    return svg;
  }

  setSize(width, height) {
    if (width === this.width && height === this.height) return;
    this.width = width;
    this.height = height;
    this.stage.style.aspectRatio = `${width} / ${height}`;
    this.fit();
  }

  fit() {
    this.scale = 1;
    this.x = this.y = 0;
    this.#draw();
  }

  zoomBy(factor, at = { x: this.stage.clientWidth / 2, y: this.stage.clientHeight / 2 }) {
    // Keep the point under the pointer in place.
    const most = (MOST * this.width) / Math.max(1, this.stage.clientWidth);
    const scale = Math.min(Math.max(1, most), Math.max(1, this.scale * factor));
    const ratio = scale / this.scale;
    this.x = at.x - (at.x - this.x) * ratio;
    this.y = at.y - (at.y - this.y) * ratio;
    this.scale = scale;
    this.#draw();
  }

  // Converts a share of the stage's width to a share of the picture's width.
  shareAt(share) {
    const width = this.stage.clientWidth || 1;
    return Math.min(1, Math.max(0, (share * width - this.x) / (width * this.scale)));
  }

  // The pixel under a place on the stage, null beside the picture.
  pixelAt(x, y) {
    const width = this.stage.clientWidth * this.scale, height = this.stage.clientHeight * this.scale;
    const column = Math.floor(((x - this.x) / width) * this.width);
    const row = Math.floor(((y - this.y) / height) * this.height);
    const isIn = column >= 0 && row >= 0 && column < this.width && row < this.height;
    return isIn ? { x: column, y: row } : null;
  }

  // Marks a pixel (null: no pixel), and scrolls it into the stage.
  setMark(point) {
    this.marked = point;
    if (point) {
      const { clientWidth, clientHeight } = this.stage;
      const x = ((point.x + 0.5) / this.width) * clientWidth * this.scale, y = ((point.y + 0.5) / this.height) * clientHeight * this.scale;
      this.x = Math.min(-x + 0.95 * clientWidth, Math.max(-x + 0.05 * clientWidth, this.x));
      this.y = Math.min(-y + 0.95 * clientHeight, Math.max(-y + 0.05 * clientHeight, this.y));
    }
    this.#draw();
  }

  #draw() {
    // The plane never leaves the stage's edges.
    const { clientWidth: width, clientHeight: height } = this.stage;
    this.x = Math.min(0, Math.max(width * (1 - this.scale), this.x));
    this.y = Math.min(0, Math.max(height * (1 - this.scale), this.y));
    this.element.style.transform = `translate(${this.x}px, ${this.y}px) scale(${this.scale})`;
    const perPixel = (width * this.scale) / this.width;
    this.element.classList.toggle("sharp", perPixel > 2);
    this.mark.hidden = !this.marked;
    if (this.marked) {
      this.mark.style.left = `${this.x + (this.marked.x + 0.5) * perPixel}px`;
      this.mark.style.top = `${this.y + (this.marked.y + 0.5) * perPixel}px`;
    }
    this.onChange();
  }

  #at(event) {
    const box = this.stage.getBoundingClientRect();
    return { x: event.clientX - box.left - this.stage.clientLeft, y: event.clientY - box.top - this.stage.clientTop };
  }

  #wheel(event) {
    event.preventDefault();
    this.zoomBy(Math.exp(-event.deltaY * (event.deltaMode ? 0.05 : 0.0016)), this.#at(event));
  }

  #down(event) {
    this.pointers.set(event.pointerId, this.#at(event));
    const at = this.#at(event);
    this.onMove(this.pixelAt(at.x, at.y));
  }

  #move(event) {
    const at = this.#at(event);
    const before = this.pointers.get(event.pointerId);
    if (before) {
      // Two fingers pinch, one drags.
      const others = [...this.pointers].filter(([id]) => id !== event.pointerId);
      if (others.length === 1) {
        const other = others[0][1];
        const far = (p) => Math.hypot(p.x - other.x, p.y - other.y) || 1;
        this.zoomBy(far(at) / far(before), other);
      } else {
        this.x += at.x - before.x;
        this.y += at.y - before.y;
        this.#draw();
      }
      this.pointers.set(event.pointerId, at);
    }
    this.onMove(this.pixelAt(at.x, at.y));
  }
}
