// A home in 3D: its items, the cameras to click, rooms to hide, refused viewpoints by their reason.
import * as THREE from "./three.module.min.js";
import { houseOf } from "./glb.js";
import { Orbit } from "./orbit.js";

const by = (id) => document.getElementById(id);
const box = by("scene");
// As the map of `pbrs-farm cameras` has them.
const REASONS = {
  outside_room: "#9a9a9a", near_obstacle: "#e6701d", not_above_floor: "#7b3ff2", enclosed: "#4a4a4a", filled_by_one: "#c2a500",
  few_objects: "#d7263d", below_min_score: "#e8a0bf", near_duplicate: "#8fd3fe", lower_score: "#5aa469", winner: "#0b5fff",
};
if (box) start().catch((error) => (by("scene-status").textContent = `The home cannot be shown in 3D: ${error.message}`));

async function start() {
  const [facts, data] = await Promise.all([got("scene.json").then((a) => a.json()), got(`house.glb?v=${encodeURIComponent(box.dataset.version)}`).then((a) => a.arrayBuffer())]);
  const page = new HousePage(facts, houseOf(data));
  by("scene-status").textContent = "";
  box.dataset.ready = "yes";
  page.draw();
}

async function got(name) {
  const answer = await fetch(`${box.dataset.base}/${name}`);
  if (answer.ok) return answer;
  const page = new DOMParser().parseFromString(await answer.text(), "text/html");
  throw new Error(page.querySelector(".nothing > p")?.textContent || `answer ${answer.status}`);
}

class HousePage {
  constructor(facts, house) {
    this.facts = facts;
    const canvas = document.createElement("canvas");
    box.prepend(canvas);
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true });
    this.renderer.setPixelRatio(Math.min(2, devicePixelRatio));
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(45, 1, 0.05, 500);
    this.scene.add(new THREE.HemisphereLight(0xffffff, 0x8a8378, 2.2));
    const sun = new THREE.DirectionalLight(0xffffff, 1.4);
    sun.position.set(3, 8, 5);
    this.scene.add(sun);
    // A group per room, so that one switch hides all of it; null: walls and what belongs to none.
    this.rooms = new Map();
    this.ceilings = [];
    this.#addItems(house);
    this.frusta = facts.cameras.map((camera) => this.#addFrustum(camera));
    this.orbit = new Orbit(this.camera, canvas, () => this.draw());
    this.#home();
    new ResizeObserver(() => this.#resize()).observe(box);
    this.#addSwitches();
    this.#addPicking(canvas);
    this.#resize();
  }

  group(room) {
    if (!this.rooms.has(room)) {
      const group = new THREE.Group();
      this.rooms.set(room, group);
      this.scene.add(group);
    }
    return this.rooms.get(room);
  }

  draw() {
    this.waiting ||= requestAnimationFrame(() => {
      this.waiting = 0;
      this.renderer.render(this.scene, this.camera);
    });
  }

  #addItems(house) {
    const textures = house.pictures.map(() => null);
    const materials = house.materials.map((m) => {
      const made = new THREE.MeshLambertMaterial({
        color: new THREE.Color(...m.colour), side: THREE.DoubleSide, transparent: m.alpha < 1, opacity: m.alpha,
        alphaTest: m.cutout ? 0.5 : 0, depthWrite: m.alpha === 1,
      });
      if (m.texture >= 0) made.map = textures[m.texture] ??= this.#texture(house.pictures[m.texture]);
      return made;
    });
    for (const item of house.items) {
      if (item.kind === "ground" && item.item?.startsWith("outside_")) continue; // outdoors
      const group = this.group(item.room ?? null);
      for (const surface of item.surfaces) {
        const geometry = new THREE.BufferGeometry();
        geometry.setAttribute("position", new THREE.BufferAttribute(surface.positions, 3));
        if (surface.uvs) geometry.setAttribute("uv", new THREE.BufferAttribute(surface.uvs, 2));
        geometry.setIndex(new THREE.BufferAttribute(surface.indices, 1));
        if (surface.normals) geometry.setAttribute("normal", new THREE.BufferAttribute(surface.normals, 3));
        const mesh = new THREE.Mesh(surface.normals ? geometry : flat(geometry), materials[surface.material]);
        mesh.userData = { name: item.name, kind: item.class };
        if (item.kind === "ceiling") this.ceilings.push(mesh);
        group.add(mesh);
      }
    }
    for (const mesh of this.ceilings) mesh.visible = false;
  }

  #texture(load) {
    const texture = new THREE.Texture();
    texture.flipY = false;
    texture.colorSpace = THREE.SRGBColorSpace;
    texture.wrapS = texture.wrapT = THREE.RepeatWrapping;
    load().then((image) => {
      texture.image = image;
      texture.needsUpdate = true;
      this.draw();
    }).catch(() => {}); // a picture that browsers do not know: the colour alone is shown
    return texture;
  }

  #addFrustum(camera) {
    const [width, height, fx, fy] = camera.size;
    const depth = 0.45, x = (depth * width) / fx / 2, y = (depth * height) / fy / 2;
    const corners = [[-x, -y], [x, -y], [x, y], [-x, y]].map(([a, b]) => [a, b, -depth]);
    const triangles = [0, 1, 2, 3].flatMap((k) => [[0, 0, 0], corners[k], corners[(k + 1) % 4]]);
    triangles.push(corners[0], corners[1], corners[2], corners[0], corners[2], corners[3]);
    const geometry = new THREE.BufferGeometry().setAttribute("position", new THREE.Float32BufferAttribute(triangles.flat(), 3));
    const colour = camera.url ? 0x0f8a8a : 0x9098a0;
    const body = new THREE.Mesh(geometry, new THREE.MeshBasicMaterial({ color: colour, transparent: true, opacity: 0.45, side: THREE.DoubleSide, depthWrite: false }));
    body.add(new THREE.LineSegments(new THREE.EdgesGeometry(geometry), new THREE.LineBasicMaterial({ color: colour })));
    body.matrixAutoUpdate = false;
    body.matrix.set(...camera.pose);
    body.matrixWorldNeedsUpdate = true;
    body.userData = camera;
    this.group(camera.room).add(body);
    return body;
  }

  #home() {
    const bounds = new THREE.Box3();
    for (const [room, group] of this.rooms) if (room !== null || this.rooms.size === 1) bounds.expandByObject(group);
    const size = bounds.getSize(new THREE.Vector3());
    this.orbit.look(bounds.getCenter(new THREE.Vector3()), Math.max(4, 1.25 * Math.hypot(size.x, size.z)));
  }

  #resize() {
    const { clientWidth: width, clientHeight: height } = box;
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / Math.max(1, height);
    this.camera.updateProjectionMatrix();
    this.draw();
  }

  #addSwitches() {
    const names = new Map(this.facts.rooms.map((room) => [room.id, room.name]));
    const ids = [...this.rooms.keys()].filter((id) => id !== null && names.has(id));
    by("rooms").replaceChildren(
      ...ids.map((id) => switchOf(names.get(id), true, "", (isOn) => {
        this.rooms.get(id).visible = isOn;
        this.draw();
      })),
      switchOf("Walls and other objects", true, "", (isOn) => {
        const group = this.rooms.get(null);
        if (group) group.visible = isOn;
        this.draw();
      }),
      switchOf("Ceilings", false, "", (isOn) => {
        for (const mesh of this.ceilings) mesh.visible = isOn;
        this.draw();
      }),
      switchOf("Cameras", true, "", (isOn) => {
        for (const body of this.frusta) body.visible = isOn;
        this.draw();
      }),
    );
    by("above").addEventListener("click", () => {
      this.camera.fov = 45;
      this.#home();
      this.#resize();
    });
    by("refused").replaceChildren(...Object.entries(this.facts.refused).map(([reason, n]) => reasonRow(reason, n)));
    by("candidates").addEventListener("click", () => this.#showCandidates());
    by("candidates").hidden = Object.keys(this.facts.refused).length === 0;
  }

  async #showCandidates() {
    by("candidates").disabled = true;
    by("candidates-status").textContent = "Sampling all viewpoints again…";
    try {
      const found = await got("candidates.json").then((answer) => answer.json());
      this.#drawCandidates(found);
      by("candidates-status").textContent = `${found.n.toLocaleString()} viewpoints tried.`;
      by("candidates").hidden = true;
    } catch (error) {
      by("candidates-status").textContent = error.message;
      by("candidates").disabled = false;
    }
  }

  #drawCandidates({ verdicts, rooms, rows }) {
    const parts = new Map();
    for (const [x, y, z, verdict, room] of rows) {
      const key = `${verdict} ${room}`;
      if (!parts.has(key)) parts.set(key, { verdict: verdicts[verdict], room: rooms[room], points: [] });
      parts.get(key).points.push(x, y, z);
    }
    const byReason = new Map();
    for (const { verdict, room, points } of parts.values()) {
      const geometry = new THREE.BufferGeometry().setAttribute("position", new THREE.Float32BufferAttribute(points, 3));
      const material = new THREE.PointsMaterial({ color: REASONS[verdict] ?? "#888", size: 5, sizeAttenuation: false });
      const cloud = new THREE.Points(geometry, material);
      this.group(room).add(cloud);
      if (!byReason.has(verdict)) byReason.set(verdict, []);
      byReason.get(verdict).push(cloud);
    }
    by("refused").replaceChildren(
      ...[...byReason].map(([verdict, clouds]) => {
        const n = clouds.reduce((sum, cloud) => sum + cloud.geometry.attributes.position.count, 0);
        return switchOf(words(verdict), true, n, (isOn) => {
          for (const cloud of clouds) cloud.visible = isOn;
          this.draw();
        }, REASONS[verdict]);
      }),
    );
    this.draw();
  }

  #addPicking(canvas) {
    const ray = new THREE.Raycaster();
    let pressed = null;
    canvas.addEventListener("pointerdown", (event) => (pressed = [event.clientX, event.clientY]));
    canvas.addEventListener("pointerup", (event) => {
      if (!pressed || Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) > 5) return;
      const place = canvas.getBoundingClientRect();
      const at = new THREE.Vector2(((event.clientX - place.left) / place.width) * 2 - 1, 1 - ((event.clientY - place.top) / place.height) * 2);
      ray.setFromCamera(at, this.camera);
      const shown = this.frusta.filter((body) => body.visible && body.parent.visible);
      const [hit] = ray.intersectObjects(shown, false);
      if (hit) this.choose(hit.object);
    });
    for (const button of document.querySelectorAll("[data-camera]")) {
      button.addEventListener("click", (event) => {
        const body = this.frusta.find((b) => b.userData.id === button.dataset.camera);
        if (!body || event.ctrlKey || event.metaKey) return;
        event.preventDefault();
        this.choose(body);
      });
    }
  }

  choose(body) {
    const camera = body.userData;
    for (const other of this.frusta) other.material.opacity = other === body ? 0.9 : 0.45;
    by("chosen").hidden = false;
    by("chosen-name").textContent = `View ${camera.id}`;
    by("chosen-link").href = camera.url;
    by("chosen-link").hidden = !camera.url;
    by("chosen-picture").hidden = !camera.thumb;
    if (camera.thumb) by("chosen-picture").src = camera.thumb;
    by("through").onclick = () => this.#lookThrough(body);
    this.draw();
  }

  #lookThrough(body) {
    const [width, height, , fy] = body.userData.size;
    this.camera.fov = (2 * Math.atan(height / 2 / fy) * 180) / Math.PI;
    this.camera.aspect = width / height;
    body.updateWorldMatrix(true, false);
    body.matrixWorld.decompose(this.camera.position, this.camera.quaternion, new THREE.Vector3());
    this.camera.aspect = box.clientWidth / box.clientHeight;
    this.camera.updateProjectionMatrix();
    // Turn on from there: the point two metres ahead is what the orbit goes about.
    const ahead = new THREE.Vector3(0, 0, -2).applyQuaternion(this.camera.quaternion);
    this.orbit.target.copy(this.camera.position).add(ahead);
    this.orbit.distance = 2;
    this.orbit.azimuth = Math.atan2(-ahead.x, -ahead.z);
    this.orbit.height = Math.asin(-ahead.y / 2);
    this.draw();
  }
}

function flat(geometry) {
  // Without stored normals every face is flat, as labels and light take it.
  const plain = geometry.toNonIndexed();
  plain.computeVertexNormals();
  return plain;
}

const words = (reason) => reason.replaceAll("_", " ");

function reasonRow(reason, n) {
  const row = document.createElement("div"), swatch = document.createElement("i"), count = document.createElement("span");
  swatch.className = "swatch";
  swatch.style.background = REASONS[reason] ?? "#888";
  count.className = "n";
  count.textContent = n.toLocaleString();
  const label = document.createElement("label");
  label.append(swatch, words(reason), count);
  row.append(label);
  return row;
}

function switchOf(text, isOn, n, onChange, colour) {
  const label = document.createElement("label"), input = document.createElement("input"), count = document.createElement("span");
  input.type = "checkbox";
  input.checked = isOn;
  input.addEventListener("change", () => onChange(input.checked));
  label.append(input);
  if (colour) {
    const swatch = document.createElement("i");
    swatch.className = "swatch";
    swatch.style.background = colour;
    label.append(swatch);
  }
  count.className = "n";
  count.textContent = n === "" ? "" : n.toLocaleString();
  label.append(text, count);
  return label;
}
