// Names of places and numbers of cameras beside what they name. What would cover another name is left out.

import { Vector3 } from "three";

const SMALLEST_PX = 5; // of a camera that bears its number
const GAP_PX = 2;

export class Names {
  constructor(stage, places, center) {
    this.box = document.createElement("div");
    this.box.className = "fk-view-names";
    this.box.setAttribute("aria-hidden", "true"); // tables on the page say the same
    stage.append(this.box);
    this.places = places.map(({ text, at }) => {
      return { text, at: new Vector3(...at.map((value, axis) => value - center[axis])), style: "fk-view-place" };
    });
    this.numbers = new Map();
    this.visible = true;
    this.shown = []; // elements in the last frame
  }

  // Puts every name at its place as `eye` sees it in a picture of width × height CSS pixels.
  draw(groups, eye, width, height) {
    for (const element of this.shown) element.hidden = true;
    this.shown = [];
    if (!this.visible) return;
    const taken = [];
    for (const item of this.places) this.put(item, eye, width, height, taken);
    for (const group of groups) {
      if (!group.visible) continue;
      for (const item of this.numbersOf(group)) {
        if (group.userData.depth * pixelsPerMetre(eye, item.at, height) >= SMALLEST_PX) {
          this.put(item, eye, width, height, taken);
        }
      }
    }
  }

  numbersOf(group) {
    if (!this.numbers.has(group)) {
      this.numbers.set(group, group.userData.cameras.filter((camera) => camera.number).map((camera) => {
        return { text: camera.number, at: camera.at, style: "fk-view-number" };
      }));
    }
    return this.numbers.get(group);
  }

  put(item, eye, width, height, taken) {
    const p = item.at.clone().project(eye);
    if (p.z > 1 || Math.abs(p.x) > 1 || Math.abs(p.y) > 1) return; // behind the eye, or beside the picture
    let x = 0.5 * (p.x + 1) * width;
    const y = 0.5 * (1 - p.y) * height;
    item.element ??= this.make(item);
    const { element } = item;
    element.hidden = false;
    item.size ??= [element.offsetWidth, element.offsetHeight];
    const [w, h] = item.size.map((size) => 0.5 * size + GAP_PX);
    if (item.style === "fk-view-place") x = Math.max(w, Math.min(width - w, x)); // whole at the picture's edge
    const middle = item.style === "fk-view-number" ? y - h - 3 : y; // a number stands above its camera
    if (taken.some((other) => Math.abs(other.x - x) < other.w + w && Math.abs(other.y - middle) < other.h + h)) {
      element.hidden = true;
      return;
    }
    taken.push({ x, y: middle, w, h });
    element.style.left = `${x}px`;
    element.style.top = `${middle}px`;
    this.shown.push(element);
  }

  make({ text, style }) {
    const element = document.createElement("span");
    element.className = style;
    element.textContent = text;
    this.box.append(element);
    return element;
  }
}

// How large a metre is at a place, in pixels of a picture of that height.
export function pixelsPerMetre(eye, at, height) {
  if (eye.isOrthographicCamera) return (height * eye.zoom) / (eye.top - eye.bottom);
  const ahead = -at.clone().applyMatrix4(eye.matrixWorldInverse).z;
  return height / (2 * Math.tan((eye.fov * Math.PI) / 360) * Math.max(ahead, 1e-6));
}
