// The axes' directions in a corner, with north where it is known, and the grid's step.

import { Vector3 } from "three";

const SVG = "http://www.w3.org/2000/svg";
const AXES = [["x", [1, 0, 0]], ["y", [0, 1, 0]], ["z", [0, 0, 1]]];
const ALIKE = 0.999; // cosine of axes that are one

export class Triad {
  // `north`: (x, y) of true north in the frame, or null.
  constructor(stage, words, north) {
    const box = document.createElement("div");
    box.className = "fk-view-axes";
    const picture = document.createElementNS(SVG, "svg");
    picture.setAttribute("viewBox", "-32 -32 64 64");
    picture.setAttribute("aria-hidden", "true");
    const axes = north && north[1] > ALIKE ? [["E", AXES[0][1]], ["N", AXES[1][1]], AXES[2]]
      : north ? [...AXES, ["N", [...north, 0]]] : AXES;
    this.parts = axes.map(([name, direction], i) => {
      const line = picture.appendChild(document.createElementNS(SVG, "line"));
      const text = picture.appendChild(document.createElementNS(SVG, "text"));
      line.setAttribute("class", `fk-view-axis-${AXES[i]?.[0] ?? "north"}`);
      text.textContent = name;
      return { line, text, direction: new Vector3(...direction) };
    });
    const note = document.createElement("span");
    note.textContent = words;
    box.append(picture, note);
    stage.append(box);
  }

  turn(camera) {
    const rotation = camera.quaternion.clone().invert();
    for (const { line, text, direction } of this.parts) {
      const { x, y } = direction.clone().applyQuaternion(rotation);
      line.setAttribute("x2", (20 * x).toFixed(1));
      line.setAttribute("y2", (-20 * y).toFixed(1));
      text.setAttribute("x", (27 * x).toFixed(1));
      text.setAttribute("y", (-27 * y).toFixed(1));
    }
  }
}
