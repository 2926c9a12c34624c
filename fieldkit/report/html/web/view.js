// One 3D view: started when it comes near, drawn only when something changed.

import { Color, MOUSE, OrthographicCamera, PerspectiveCamera, Scene, TOUCH, Vector3 } from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { DepthShading, pointCloud, pointMaterial } from "./clouds.js";
import { newRenderer } from "./context.js";
import { ASIDE, above, frustumDepth, placeToSeeAll } from "./framing.js";
import { Labels } from "./labels.js";
import { frusta, grid, niceStep, polylines } from "./marks.js";
import { Names, pixelsPerMetre } from "./names.js";
import { ScaleBar, lengthWords } from "./scale_bar.js";
import { Triad } from "./triad.js";
import { paint, rgb, unpack } from "./unpack.js";

const MOST_PIXELS_PER_PIXEL = 2;
const SETTLED_MS = 180;
const SLOW_MS = 45, FAST_MS = 24, FEWEST = 30000; // points that no machine is spared
const TURN = Math.PI / 36, MOVE = 0.1; // radians, and shares of half the picture's height
const HIGH = 25; // radii, where the camera of the view from above stands: over everything

export class View {
  constructor(figure) {
    this.figure = figure;
    this.stage = figure.querySelector(".fk-view-stage");
    this.message = figure.querySelector(".fk-view-message");
    this.data = JSON.parse(figure.querySelector(".fk-view-data").textContent);
    this.renderer = null;
    this.content = null;
    this.frames = 0; // drawn since the start
    this.drawn = 0; // points in the last frame
    this.fraction = 1; // of the points, drawn while the view moves
    this.movedAt = -Infinity;
    this.lastMoving = 0;
    this.scheduled = false;
    this.animation = null;
    this.coloring = "values";
    this.labels = new Labels(this.stage);
  }

  say(state, text) {
    this.figure.dataset.state = state;
    this.message.textContent = text;
  }

  // Decode once, then make what draws; called again after `suspend`.
  async start() {
    if (this.renderer || this.starting) return;
    this.starting = true;
    try {
      const renderer = newRenderer();
      if (!this.content) {
        this.say("loading", "Loading the 3D view …");
        await new Promise((resolve) => setTimeout(resolve)); // lets the message be seen
        await this.build();
      }
      this.attach(renderer);
    } catch (error) {
      this.say("failed", error.fieldkit ?? `The 3D view could not be started: ${error.message}.`);
    } finally {
      this.starting = false;
    }
  }

  async build() {
    const { data } = this;
    const [low, high] = data.focus.outer;
    const [innerLow, innerHigh] = data.focus.inner;
    this.center = innerLow.map((value, axis) => 0.5 * (value + innerHigh[axis]));
    this.radius = Math.max(0.5 * Math.hypot(...low.map((value, axis) => high[axis] - value)), 1e-3);
    this.points = new Scene();
    this.marks = new Scene();
    this.material = pointMaterial();
    this.shading = new DepthShading();
    this.layers = { points: [], frusta: [], lines: [] };
    const blocks = this.figure.querySelectorAll(".fk-view-block");
    for (const [i, layer] of data.points.entries()) {
      const arrays = await unpack(blocks[i].textContent, layer);
      blocks[i].remove(); // the text is not needed any more
      const cloud = pointCloud(layer, arrays, this.tones(layer, arrays), this.material, this.center);
      cloud.userData = { layer, arrays };
      this.layers.points.push(cloud);
      this.points.add(cloud);
    }
    this.names = new Names(this.stage, data.places, this.center);
    const depth = frustumDepth(data.frusta, this.radius);
    for (const layer of data.frusta) this.layers.frusta.push(frusta(layer, depth, this.center));
    for (const layer of data.lines) this.layers.lines.push(polylines(layer, this.center));
    this.marks.add(...this.layers.frusta, ...this.layers.lines, this.ground());
    for (const mark of this.figure.querySelectorAll(".fk-view-mark")) {
      mark.style.setProperty("--fk-view-mark", mark.dataset.color); // a style attribute would need leave from the page's CSP
    }
    this.content = true;
    for (const input of this.figure.querySelectorAll(".fk-view-switch input")) this.switchLayer(input);
    this.resizePoints();
  }

  ground() {
    const { inner, outer } = this.data.focus;
    const step = niceStep(Math.max(outer[1][0] - outer[0][0], outer[1][1] - outer[0][1], 1e-3));
    // The ground is z = 0 in most frames; a cloud in another one stands on its own lowest points.
    const tall = inner[1][2] - inner[0][2];
    const height = inner[0][2] - 0.5 * tall <= 0 && inner[1][2] >= 0 ? Math.min(0, inner[0][2]) : inner[0][2];
    this.step = step;
    this.grid = grid(outer, height, step, this.center);
    return this.grid;
  }

  attach(renderer) {
    const canvas = renderer.domElement;
    this.renderer = renderer;
    this.stage.prepend(canvas);
    this.camera ??= this.firstCamera();
    this.flat ??= new OrthographicCamera();
    this.flat.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    Object.assign(this.controls, {
      enableDamping: false, zoomToCursor: true, minDistance: 0.01 * this.radius, maxDistance: 30 * this.radius, minZoom: 0.1, maxZoom: 100,
    });
    this.controls.target.copy(this.target ?? new Vector3());
    this.target = this.controls.target;
    this.use(this.camera);
    this.controls.update();
    const words = (length) => lengthWords(length, this.data.metric);
    this.triad ??= new Triad(this.stage, `Grid ${words(this.step)}`, this.data.north);
    this.scaleBar ??= new ScaleBar(this.stage, words);
    this.off = new AbortController();
    const { signal } = this.off;
    const on = (target, name, act) => target.addEventListener(name, act, { signal });
    this.controls.addEventListener("change", () => this.moved());
    this.controls.addEventListener("start", () => this.stopAnimation());
    this.hold(false);
    on(canvas, "pointerdown", () => this.hold(true));
    on(document, "pointerdown", (event) => { if (!this.figure.contains(event.target)) this.hold(false); });
    on(canvas, "pointermove", (event) => { if (!event.buttons) this.point(event); });
    on(canvas, "pointerleave", (event) => { if (event.pointerType === "mouse") this.point(null); });
    on(canvas, "click", (event) => this.point(event));
    on(this.stage, "focus", () => this.hold(true));
    on(this.stage, "blur", () => this.hold(false));
    on(this.stage, "keydown", (event) => this.key(event));
    on(canvas, "webglcontextlost", (event) => {
      event.preventDefault();
      this.say("lost", "The graphics driver has stopped this 3D view. It comes back when the driver does, or on "
        + "reloading the page.");
    });
    on(canvas, "webglcontextrestored", () => { this.suspend(); this.start(); });
    for (const input of this.figure.querySelectorAll(".fk-view-switch input")) {
      on(input, "change", () => { this.switchLayer(input); this.invalidate(); });
    }
    const tool = (selector, name, act) => {
      const found = this.figure.querySelector(selector);
      if (found) on(found, name, act);
    };
    tool(".fk-view-size input", "input", () => { this.resizePoints(); this.invalidate(); });
    tool(".fk-view-coloring select", "change", (event) => this.recolor(event.target.value));
    tool(".fk-view-reset", "click", () => this.goAside());
    tool(".fk-view-above", "click", () => this.goAbove());
    const full = this.figure.querySelector(".fk-view-full");
    full.hidden = !document.fullscreenEnabled;
    const refused = () => { full.hidden = true; };
    on(full, "click", () => this.stage.requestFullscreen().then(() => this.stage.focus(), refused));
    on(matchMedia("(prefers-color-scheme: dark)"), "change", () => this.dress());
    on(window, "beforeprint", () => this.draw());
    this.sizes = new ResizeObserver(() => this.resize());
    this.sizes.observe(this.stage);
    this.themes = new MutationObserver(() => this.dress());
    this.themes.observe(document.documentElement, { attributes: true });
    this.dress();
    this.resize();
    this.draw();
    this.say("ready", "");
    performance.mark(`fk-view-first-frame:${this.figure.id}`);
    this.figure.dispatchEvent(new CustomEvent("fk-view-ready", { bubbles: true }));
  }

  // Gives the context back: browsers keep about sixteen in a page. The decoded points stay.
  suspend() {
    if (!this.renderer) return;
    const { renderer } = this;
    this.renderer = null;
    this.off.abort();
    this.sizes.disconnect();
    this.themes.disconnect();
    this.controls.dispose();
    clearTimeout(this.settling);
    renderer.dispose();
    renderer.forceContextLoss();
    renderer.domElement.remove();
    this.say("waiting", "");
  }

  // The wheel and vertical strokes belong to the page until the view is clicked or has the focus.
  hold(held) {
    this.controls.enableZoom = held;
    this.renderer.domElement.style.touchAction = held ? "none" : "pan-y";
    this.figure.classList.toggle("fk-view-held", held);
  }

  firstCamera() {
    const camera = new PerspectiveCamera(32, 1, 0.01 * this.radius, 100 * this.radius);
    camera.up.set(0, 0, 1);
    this.fresh = true;
    this.aside = camera;
    return camera;
  }

  // From above the view is a map: orthographic, north up where that is known, and a drag moves it instead of turning it.
  use(camera) {
    const flat = camera === this.flat;
    this.camera = camera;
    this.controls.object = camera;
    this.controls.enableRotate = !flat;
    this.controls.mouseButtons.LEFT = flat ? MOUSE.PAN : MOUSE.ROTATE;
    this.controls.touches.ONE = flat ? TOUCH.PAN : TOUCH.ROTATE;
    this.figure.dataset.projection = flat ? "orthographic" : "perspective";
  }

  goAside() {
    if (this.camera === this.flat) {
      const back = this.flat.position.clone().sub(this.controls.target).normalize();
      const distance = this.half / this.flat.zoom / Math.tan((this.aside.fov * Math.PI) / 360);
      this.aside.position.copy(this.controls.target).addScaledVector(back, distance);
      this.use(this.aside);
    }
    this.goTo(this.home(ASIDE));
  }

  goAbove() {
    const home = this.home(above(this.data.north), this.data.places.map(({ at }) => at));
    const flatten = () => {
      this.half = home.half;
      this.flat.zoom = 1;
      this.controls.target.copy(home.middle);
      const back = home.position.clone().sub(home.target).normalize();
      this.flat.position.copy(home.middle).addScaledVector(back, HIGH * this.radius);
      this.use(this.flat);
      this.shape();
      this.controls.update();
      this.moved();
    };
    if (this.camera === this.flat) flatten();
    else this.goTo(home, flatten);
  }

  home(direction, places = []) {
    const cameras = this.data.frusta.flatMap((layer) => layer.centers);
    return placeToSeeAll(direction, this.data.focus, [...cameras, ...places], this.center, this.aside);
  }

  goTo({ target, position }, then = () => {}) {
    this.stopAnimation();
    const put = (t) => {
      this.controls.target.lerpVectors(from.target, target, t);
      const length = from.arm.length() ** (1 - t) * arms.length() ** t;
      const arm = from.arm.clone().lerp(arms, t).normalize().multiplyScalar(length);
      this.camera.position.addVectors(this.controls.target, arm);
      this.controls.update();
      this.moved();
      if (t === 1) then();
    };
    const from = { target: this.controls.target.clone(), arm: this.camera.position.clone().sub(this.controls.target) };
    const arms = position.clone().sub(target);
    if (matchMedia("(prefers-reduced-motion: reduce)").matches) return put(1);
    const begun = performance.now();
    const step = (now) => {
      const t = Math.min(1, Math.max(0, (now - begun) / 400));
      this.animation = t < 1 ? requestAnimationFrame(step) : null;
      if (this.renderer) put(t * t * (3 - 2 * t));
    };
    this.animation = requestAnimationFrame(step);
  }

  stopAnimation() {
    if (this.animation) cancelAnimationFrame(this.animation);
    this.animation = null;
  }

  key(event) {
    if (event.target !== this.stage || event.ctrlKey || event.altKey || event.metaKey) return;
    const acts = {
      ArrowLeft: () => this.turn(-TURN, 0), ArrowRight: () => this.turn(TURN, 0),
      ArrowUp: () => this.turn(0, -TURN), ArrowDown: () => this.turn(0, TURN),
      "+": () => this.zoom(0.85), "=": () => this.zoom(0.85),
      "-": () => this.zoom(1 / 0.85), "−": () => this.zoom(1 / 0.85),
      0: () => this.goAside(), Home: () => this.goAside(),
    };
    const act = acts[event.key];
    if (!act) return;
    event.preventDefault();
    if (!["0", "Home"].includes(event.key)) this.stopAnimation();
    act();
  }

  turn(around, over) {
    if (this.camera === this.flat) return this.move(Math.sign(around), Math.sign(-over));
    const arm = this.camera.position.clone().sub(this.controls.target);
    const length = arm.length();
    const azimuth = Math.atan2(arm.y, arm.x) + around;
    const polar = Math.min(Math.PI - 1e-3, Math.max(1e-3, Math.acos(arm.z / length) + over));
    arm.set(Math.sin(polar) * Math.cos(azimuth), Math.sin(polar) * Math.sin(azimuth), Math.cos(polar));
    this.camera.position.copy(this.controls.target).addScaledVector(arm, length);
    this.controls.update();
  }

  // The view from above by steps to the picture's right and up.
  move(right, up) {
    const step = (MOVE * this.half) / this.flat.zoom;
    for (const [axis, by] of [[0, right], [1, up]]) {
      const way = new Vector3().setFromMatrixColumn(this.flat.matrix, axis).multiplyScalar(step * by);
      for (const moved of [this.flat.position, this.controls.target]) moved.add(way);
    }
    this.controls.update();
  }

  zoom(factor) {
    if (this.camera === this.flat) {
      this.flat.zoom = Math.min(this.controls.maxZoom, Math.max(this.controls.minZoom, this.flat.zoom / factor));
      return this.moved();
    }
    const arm = this.camera.position.clone().sub(this.controls.target).multiplyScalar(factor);
    this.camera.position.copy(this.controls.target).add(arm);
    this.controls.update();
  }

  switchLayer(input) {
    const { group, number } = input.dataset;
    (group === "names" ? this.names : this.layers[group][Number(number)]).visible = input.checked;
    this.point(null);
  }

  resizePoints() {
    const input = this.figure.querySelector(".fk-view-size input");
    this.pointSize = input ? Number(input.value) : 2;
  }

  tones(layer, arrays) {
    if (arrays.values && (this.coloring === "values" || !arrays.colors)) {
      return paint(arrays.values, this.data.palette.map(rgb), [150, 150, 150]);
    }
    if (arrays.colors) return arrays.colors;
    const one = rgb(layer.color), all = new Uint8Array(4 * layer.count);
    for (let i = 0; i < all.length; i += 4) all.set(one, i);
    return all;
  }

  recolor(by) {
    this.coloring = by;
    this.figure.dataset.coloring = by;
    for (const cloud of this.layers.points) {
      const { layer, arrays } = cloud.userData;
      if (!arrays.values || !arrays.colors) continue;
      const tone = cloud.geometry.getAttribute("tone");
      tone.array = this.tones(layer, arrays);
      tone.needsUpdate = true;
    }
    this.invalidate();
  }

  // Colours that the page's style gives.
  dress() {
    const style = getComputedStyle(this.figure);
    this.grid.material.color = new Color(style.getPropertyValue("--fk-view-grid").trim() || "#888888");
    this.grid.material.opacity = Number(style.getPropertyValue("--fk-view-grid-opacity")) || 0.5;
    this.invalidate();
  }

  resize() {
    if (!this.renderer) return;
    const width = this.stage.clientWidth, height = this.stage.clientHeight;
    if (!width || !height) return;
    this.ratio = Math.min(devicePixelRatio || 1, MOST_PIXELS_PER_PIXEL);
    this.renderer.setPixelRatio(this.ratio);
    this.renderer.setSize(width, height, false);
    const pixels = (length) => Math.max(1, Math.floor(length * this.ratio));
    this.shading.resize(pixels(width), pixels(height), this.ratio);
    this.shape();
    if (this.fresh) {
      this.fresh = false;
      const { target, position } = this.home(ASIDE);
      this.homeDistance = position.distanceTo(target);
      this.controls.target.copy(target);
      this.camera.position.copy(position);
      this.controls.update();
    }
    this.draw(); // at once: a resized canvas is empty
  }

  // The pictures' shape is the stage's.
  shape() {
    const aspect = this.stage.clientWidth / this.stage.clientHeight;
    this.aside.aspect = aspect;
    this.aside.updateProjectionMatrix();
    const half = this.half ?? 1;
    Object.assign(this.flat, { left: -half * aspect, right: half * aspect, top: half, bottom: -half });
    this.flat.updateProjectionMatrix();
  }

  moved() {
    this.movedAt = performance.now();
    this.invalidate();
  }

  invalidate() {
    if (this.scheduled || !this.renderer) return;
    this.scheduled = true;
    requestAnimationFrame((now) => {
      this.scheduled = false;
      this.draw(now);
    });
  }

  draw(now = performance.now()) {
    const { renderer, camera } = this;
    if (!renderer || !this.ratio) return;
    const moving = performance.now() - this.movedAt < this.settled();
    if (moving) this.adapt(now);
    else this.lastMoving = 0;
    const fraction = moving ? this.fraction : 1;
    this.drawn = 0;
    for (const cloud of this.layers.points) {
      const count = Math.ceil(fraction * cloud.userData.layer.count);
      cloud.geometry.setDrawRange(0, count);
      if (cloud.visible) this.drawn += count;
    }
    const flat = camera === this.flat;
    const away = camera.position.distanceTo(this.controls.target);
    camera.near = flat ? 0 : Math.max(0.02 * away, 0.002 * this.radius);
    camera.far = away + 40 * this.radius;
    camera.updateProjectionMatrix();
    camera.updateMatrixWorld();
    const { clientWidth: width, clientHeight: height } = this.stage;
    const perMetre = flat ? pixelsPerMetre(camera, null, height) : 0;
    const whole = (2 * Math.tan((this.aside.fov * Math.PI) / 360)) / height; // metres of a pixel at a distance of one
    this.material.uniforms.size.value = this.pointSize * this.ratio * Math.min(2, Math.sqrt(1 / fraction));
    this.material.uniforms.distance.value = this.homeDistance * (flat ? perMetre * whole : 1);
    renderer.autoClear = false;
    renderer.clear();
    if (this.drawn) this.shading.render(renderer, this.points, camera, Math.max(0, away - this.homeDistance));
    renderer.render(this.marks, camera);
    this.triad.turn(camera);
    this.names.draw(this.layers.frusta, camera, width, height);
    this.scaleBar.show(perMetre, width);
    this.frames++;
    clearTimeout(this.settling);
    if (fraction < 1) this.settling = setTimeout(() => this.invalidate(), this.settled() + 20);
  }

  // Where a frame takes long, the next one may come late and still belong to the same movement.
  settled() {
    return Math.max(SETTLED_MS, 2.5 * (this.took ?? 0));
  }

  // Fewer points while moving, if frames take long; more again if they do not.
  adapt(now) {
    const took = this.lastMoving ? now - this.lastMoving : 0;
    this.lastMoving = now;
    if (!took || took > 3000) return;
    this.took = Math.min(took, 600);
    const total = this.data.points.reduce((sum, layer) => sum + layer.count, 0);
    const least = Math.min(1, FEWEST / Math.max(1, total));
    if (took > SLOW_MS) this.fraction = Math.max(least, this.fraction * Math.max(0.4, SLOW_MS / took));
    else if (took < FAST_MS) this.fraction = Math.min(1, this.fraction * 1.1);
  }

  // Shows the label of the camera under the pointer.
  point(event) {
    if (!this.labels.point(event, this.layers.frusta, this.camera)) return;
    if (this.renderer) this.renderer.domElement.style.cursor = this.labels.pointed ? "pointer" : "";
    this.invalidate();
  }
}
