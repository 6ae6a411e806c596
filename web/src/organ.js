// The organ in 3-D, in place of its picture: one canvas for the whole page, in the figure that was asked for last.
import {
  AmbientLight, BufferAttribute, BufferGeometry, Color, DirectionalLight, DoubleSide, Group, LineBasicMaterial,
  LineSegments, Mesh, MeshLambertMaterial, OrthographicCamera, Scene, SRGBColorSpace, Vector3, WebGLRenderer,
} from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { readOrgan } from "./data.js";

const PLAIN = new Color(0xc4c8ce);
const SOLID = new Color(0x9a9186);
const MAGNIFICATIONS = [0, 1, 2, 5, 10, 20, 50, 100];

function element(name, properties = {}, ...children) {
  const made = Object.assign(document.createElement(name), properties);
  made.append(...children);
  return made;
}

function palette(stops) {
  const colours = stops.map(([r, g, b]) => new Color().setRGB(r / 255, g / 255, b / 255, SRGBColorSpace));
  return Array.from({ length: 256 }, (_, i) => {
    const place = (i / 255) * (colours.length - 1);
    const below = Math.min(Math.floor(place), colours.length - 2);
    return colours[below].clone().lerp(colours[below + 1], place - below);
  });
}

function number(value) {
  return value >= 1000 ? value.toFixed(0) : String(Number(value.toPrecision(3)));
}

function moving(mesh) {
  const geometry = new BufferGeometry();
  geometry.setIndex(new BufferAttribute(mesh.triangles, 1));
  geometry.setAttribute("position", new BufferAttribute(mesh.positions.slice(), 3));
  geometry.setAttribute("color", new BufferAttribute(new Float32Array(mesh.positions.length), 3));
  return geometry;
}

class Organ {
  constructor(figure, organ) {
    this.figure = figure;
    this.organ = organ;
    const { header } = organ;
    this.state = header.states.length - 1;
    this.magnification = header.magnification;
    this.colour = Object.keys(header.tops).find((key) => header.tops[key] !== null); // none of shells alone
    this.palette = palette(header.palette);
    this.#makeScene();
    this.#makeControls();
    this.update();
  }

  #makeScene() {
    const { header, shell, edges, surface, solids } = this.organ;
    this.geometry = moving(shell);
    const material = new MeshLambertMaterial({
      vertexColors: true, side: DoubleSide, polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1,
    });
    this.layers = { shells: new Mesh(this.geometry, material) };
    if (edges.length > 0) {
      const lines = new BufferGeometry();
      lines.setAttribute("position", this.geometry.getAttribute("position"));
      lines.setIndex(new BufferAttribute(edges, 1));
      this.layers.edges = new LineSegments(lines, new LineBasicMaterial({ color: 0x10151c, transparent: true, opacity: 0.45 }));
    }
    if (surface) {
      const voxels = new BufferGeometry();
      voxels.setIndex(new BufferAttribute(surface.triangles, 1));
      voxels.setAttribute("position", new BufferAttribute(surface.positions, 3));
      voxels.computeVertexNormals();
      this.layers.surface = new Mesh(voxels, new MeshLambertMaterial({
        color: 0x8fa3b8, transparent: true, opacity: 0.35, depthWrite: false, side: DoubleSide,
      }));
      this.layers.surface.visible = false;
    }
    if (solids) {
      this.solids = moving(solids);
      this.layers.solids = new Mesh(this.solids, new MeshLambertMaterial({
        vertexColors: true, side: DoubleSide, polygonOffset: true, polygonOffsetFactor: 2, polygonOffsetUnits: 2,
      }));
    }
    this.scene = new Scene();
    this.scene.add(new Group().add(...Object.values(this.layers)));
    this.scene.add(new AmbientLight(0xffffff, 1.5));
    this.camera = new OrthographicCamera();
    const light = new DirectionalLight(0xffffff, 1.9);
    light.position.set(-0.3, 0.4, 0.87);
    this.camera.add(light);
    this.scene.add(this.camera);
    this.centre = new Vector3().fromArray(header.centre);
    this.resetView();
  }

  resetView() {
    const { header } = this.organ;
    this.camera.up.fromArray(header.up);
    this.camera.position.fromArray(header.towards).multiplyScalar(2 * header.size).add(this.centre);
    this.camera.near = 0;
    this.camera.far = 4 * header.size;
    this.camera.zoom = 1;
    this.camera.lookAt(this.centre);
  }

  #checkbox(text, layer) {
    if (!this.layers[layer]) {
      return [];
    }
    const box = element("input", { type: "checkbox", checked: this.layers[layer].visible });
    box.addEventListener("change", () => {
      this.layers[layer].visible = box.checked;
      this.changed();
    });
    return [element("label", { className: "check" }, box, ` ${text}`)];
  }

  #slider(text, most, value, shown, onInput) {
    const field = element("input", { type: "range", min: 0, max: most, step: 1, value });
    const output = element("output", {}, shown(value));
    field.setAttribute("aria-valuetext", shown(value));
    field.addEventListener("input", () => {
      output.textContent = shown(field.valueAsNumber);
      field.setAttribute("aria-valuetext", shown(field.valueAsNumber));
      onInput(field.valueAsNumber);
      this.update();
    });
    return element("label", { className: "slide" }, element("span", {}, text), field, output);
  }

  #makeControls() {
    const { header } = this.organ;
    const choice = element("select", {}, ...Object.entries(header.tops).filter(([, top]) => top !== null)
      .map(([key]) => element("option", { value: key }, header.names[key])));
    choice.addEventListener("change", () => {
      this.colour = choice.value;
      this.update();
    });
    const reset = element("button", { type: "button" }, "Reset view");
    reset.addEventListener("click", () => {
      this.resetView();
      this.changed();
    });
    const at = MAGNIFICATIONS.indexOf(header.magnification);
    this.controls = element("div", { className: "controls" },
      element("label", { className: "choice" }, element("span", {}, "Colour"), choice),
      this.#slider("State", header.states.length - 1, this.state, (i) => header.states[i], (i) => (this.state = i)),
      this.#slider("Displacement drawn", MAGNIFICATIONS.length - 1, at, (i) => `× ${MAGNIFICATIONS[i]}`,
        (i) => (this.magnification = MAGNIFICATIONS[i])),
      ...this.#checkbox("curved shells", "shells"), ...this.#checkbox("edges of the shells", "edges"),
      ...this.#checkbox("solids", "solids"), ...this.#checkbox("segmented surface", "surface"), reset);
  }

  #displacementAt(i, displacement) {
    const [x, y, z] = displacement.subarray(3 * i, 3 * i + 3);
    return (255 * Math.hypot(x, y, z)) / this.organ.header.tops.displacement;
  }

  #valueAt(i, state) {
    if (this.colour === "membrane" || this.colour === "stress") {
      return state[this.colour][i];
    }
    return this.colour === "distance" ? this.organ.distance[i] : this.#displacementAt(i, state.displacement);
  }

  // Vertices to where the displacement leads them; colours by levels from 0 to 255, or the plain one.
  #move(geometry, mesh, displacement, plain, levelAt) {
    const positions = geometry.getAttribute("position");
    const colours = geometry.getAttribute("color");
    for (let i = 0; i < mesh.positions.length; ++i) {
      positions.array[i] = mesh.positions[i] + this.magnification * displacement[i];
    }
    for (let i = 0; i < positions.count; ++i) {
      const level = levelAt && Math.round(levelAt(i));
      (levelAt ? this.palette[Math.max(0, Math.min(255, level || 0))] : plain).toArray(colours.array, 3 * i);
    }
    positions.needsUpdate = colours.needsUpdate = true;
    geometry.computeVertexNormals();
  }

  update() {
    const { header, shell, states, solids } = this.organ;
    const state = states[this.state];
    this.#move(this.geometry, shell, state.displacement, PLAIN, this.colour && ((i) => this.#valueAt(i, state)));
    if (solids) {
      const displacement = solids.displacements[this.state];
      this.#move(this.solids, solids, displacement, SOLID,
        this.colour === "displacement" && ((i) => this.#displacementAt(i, displacement)));
    }
    const legend = this.figure.querySelector(".legend");
    legend.querySelector(".scale").hidden = !this.colour;
    if (this.colour) {
      legend.querySelector(".quantity").textContent = header.names[this.colour];
      legend.querySelector(".top").textContent = `${number(header.tops[this.colour])} ${header.units[this.colour]}`;
    }
    legend.querySelector(".drawn").textContent = this.magnification === 0
      ? `Drawn ${header.rest}.` : `${header.states[this.state]}; displacement drawn × ${this.magnification}.`;
    this.changed();
  }

  changed() {
    this.onChange?.();
  }
}

class Stage {
  constructor() {
    this.renderer = new WebGLRenderer({ antialias: true, alpha: true, preserveDrawingBuffer: true });
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.canvas = this.renderer.domElement;
    this.canvas.tabIndex = 0;
    this.canvas.setAttribute("role", "application");
    this.canvas.setAttribute("aria-label", "The organ in 3-D. Arrow keys turn it, plus and minus zoom, 0 resets the view.");
    this.canvas.addEventListener("keydown", (event) => this.#onKey(event));
    new ResizeObserver(() => this.#resize()).observe(this.canvas);
  }

  show(organ) {
    this.hide();
    this.organ = organ;
    const box = organ.figure.querySelector(".stage");
    box.replaceChildren(this.canvas);
    organ.figure.querySelector(".legend").after(organ.controls);
    organ.onChange = () => this.#draw();
    this.orbit = new OrbitControls(organ.camera, this.canvas);
    this.orbit.target.copy(organ.centre);
    this.orbit.update(); // made, it looked at the origin
    this.orbit.enableDamping = false;
    this.orbit.addEventListener("change", () => this.#draw());
    this.#resize();
  }

  hide() {
    if (!this.organ) {
      return;
    }
    const picture = new Image();
    picture.src = this.canvas.toDataURL();
    picture.alt = "The organ as it was last turned";
    this.organ.figure.querySelector(".stage").replaceChildren(picture);
    this.organ.figure.querySelector(".turn")?.removeAttribute("hidden");
    this.organ.controls.remove();
    this.orbit.dispose();
    this.organ = null;
  }

  #onKey(event) {
    const { camera, centre } = this.organ;
    const turn = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    const zoom = { "+": 1.15, "=": 1.15, "-": 1 / 1.15 }[event.key];
    if (turn) {
      const arm = camera.position.clone().sub(centre);
      const side = new Vector3().crossVectors(camera.up, arm).normalize();
      arm.applyAxisAngle(camera.up, turn[0] * 0.12);
      const tilted = arm.clone().applyAxisAngle(side, turn[1] * 0.12);
      const upright = Math.abs(tilted.clone().normalize().dot(camera.up)) < 0.99;
      camera.position.copy(centre).add(upright ? tilted : arm);
    } else if (zoom) {
      camera.zoom *= zoom;
    } else if (event.key === "0") {
      this.organ.resetView();
    } else {
      return;
    }
    event.preventDefault();
    this.orbit.update();
    this.#draw();
  }

  #resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement ?? {};
    if (!width || !height || !this.organ) {
      return;
    }
    this.renderer.setSize(width, height, false);
    const { camera, organ } = { camera: this.organ.camera, organ: this.organ.organ };
    const [across, high] = organ.header.extent;
    const scale = 0.55 * Math.max(across / width, high / height);
    Object.assign(camera, { left: -scale * width, right: scale * width, top: scale * height, bottom: -scale * height });
    this.#draw();
  }

  #draw() {
    this.organ.camera.updateProjectionMatrix();
    this.renderer.render(this.organ.scene, this.organ.camera);
  }
}

let stage = null;

async function activate(figure) {
  const note = figure.querySelector(".note");
  try {
    figure.made ??= new Organ(figure, await readOrgan(document.getElementById(figure.dataset.organ).textContent));
    stage ??= new Stage();
    stage.show(figure.made);
    figure.querySelector(".turn")?.setAttribute("hidden", "");
  } catch (error) {
    note.textContent = `The picture stands still: ${error.message}`;
  }
}

export function activateOrgans(page) {
  const figures = [...page.querySelectorAll("figure[data-organ]")];
  for (const figure of figures) {
    const button = element("button", { type: "button", className: "turn" }, "Turn it in 3-D");
    button.addEventListener("click", () => activate(figure));
    figure.querySelector(".legend").before(button);
  }
  if (figures.length === 1) {
    activate(figures[0]);
  }
}
