// Turns, moves and zooms a camera about a point: one pointer turns, two or the right button move.

export class Orbit {
  constructor(camera, canvas, onChange) {
    Object.assign(this, { camera, canvas, onChange, pointers: new Map() });
    this.target = camera.position.clone();
    this.distance = 10;
    this.azimuth = 0.7;
    this.height = 0.95; // radians above the horizon
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      this.pointers.set(event.pointerId, [event.clientX, event.clientY]);
    });
    for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, (event) => this.pointers.delete(event.pointerId));
    canvas.addEventListener("pointermove", (event) => this.#move(event));
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.#zoom(Math.exp(event.deltaY * (event.deltaMode ? 0.05 : 0.0012)));
    }, { passive: false });
  }

  look(target, distance) {
    this.target.copy(target);
    this.distance = distance;
    this.update();
  }

  update() {
    const flat = Math.cos(this.height) * this.distance;
    const { x, y, z } = this.target;
    this.camera.up.set(0, 1, 0);
    this.camera.position.set(x + flat * Math.sin(this.azimuth), y + this.distance * Math.sin(this.height), z + flat * Math.cos(this.azimuth));
    this.camera.lookAt(x, y, z);
    this.onChange();
  }

  #move(event) {
    const before = this.pointers.get(event.pointerId);
    if (!before) return;
    const dx = event.clientX - before[0], dy = event.clientY - before[1];
    this.pointers.set(event.pointerId, [event.clientX, event.clientY]);
    const others = [...this.pointers].filter(([id]) => id !== event.pointerId);
    if (others.length === 1) {
      const far = ([x, y]) => Math.hypot(x - others[0][1][0], y - others[0][1][1]) || 1;
      this.#zoom(far(before) / far([event.clientX, event.clientY]));
      this.#pan(dx / 2, dy / 2);
    } else if (event.buttons & 2 || event.shiftKey) {
      this.#pan(dx, dy);
    } else {
      this.azimuth -= dx * 0.006;
      this.height = Math.min(1.55, Math.max(-0.3, this.height + dy * 0.006));
      this.update();
    }
  }

  #pan(dx, dy) {
    const perPixel = (this.distance * 1.1) / this.canvas.clientHeight;
    const [right, ahead] = [Math.cos(this.azimuth), Math.sin(this.azimuth)];
    this.target.x -= perPixel * (dx * right + dy * ahead);
    this.target.z += perPixel * (dx * ahead - dy * right);
    this.update();
  }

  #zoom(factor) {
    this.distance = Math.min(200, Math.max(0.5, this.distance * factor));
    this.update();
  }
}
