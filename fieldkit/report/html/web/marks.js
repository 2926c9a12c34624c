// Cameras, lines and the ground's grid.

import {
  BufferAttribute, BufferGeometry, Color, DoubleSide, Group, LineBasicMaterial, LineSegments, Matrix4, Mesh,
  MeshBasicMaterial, Vector3,
} from "three";
import { LineMaterial } from "three/addons/lines/LineMaterial.js";
import { LineSegments2 } from "three/addons/lines/LineSegments2.js";
import { LineSegmentsGeometry } from "three/addons/lines/LineSegmentsGeometry.js";

export function segments(positions, color, width) {
  const geometry = new LineSegmentsGeometry();
  geometry.setPositions(positions);
  const lines = new LineSegments2(geometry, new LineMaterial({ color: new Color(color), linewidth: width }));
  lines.frustumCulled = false;
  return lines;
}

// All cameras of a layer: outlines, and their pictures' planes as a faint fill. userData.cameras has what the pointer needs.
export function frusta(layer, depth, center) {
  const group = new Group();
  const w = depth * layer.width, h = depth * layer.height;
  const corners = [[-w, -h], [w, -h], [w, h], [-w, h]].map(([x, y]) => new Vector3(x, y, depth));
  const above = -1.1 * h; // a triangle at the picture's upper edge
  const roof = [[-0.45 * w, above], [0, above - 0.5 * w], [0.45 * w, above]].map(([x, y]) => new Vector3(x, y, depth));
  const eye = new Vector3();
  const edges = [];
  for (let i = 0; i < 4; i++) edges.push(eye, corners[i], corners[i], corners[(i + 1) % 4]);
  for (let i = 0; i < 3; i++) edges.push(roof[i], roof[(i + 1) % 3]);
  const faces = [corners[0], corners[1], corners[2], corners[0], corners[2], corners[3], ...roof];
  const outline = [], fill = [];
  const cameras = layer.centers.map((at, i) => {
    const r = layer.rotations[i]; // rows: the camera's right, down and forward in the world
    const [x, y, z] = at.map((value, axis) => value - center[axis]);
    const matrix = new Matrix4().set(
      r[0][0], r[1][0], r[2][0], x, r[0][1], r[1][1], r[2][1], y, r[0][2], r[1][2], r[2][2], z, 0, 0, 0, 1);
    for (const p of edges) outline.push(...p.clone().applyMatrix4(matrix));
    for (const p of faces) fill.push(...p.clone().applyMatrix4(matrix));
    const middle = new Vector3(0, 0, 0.5 * depth).applyMatrix4(matrix);
    return { label: layer.labels[i], number: layer.numbers[i], matrix, middle, at: new Vector3(x, y, z) };
  });
  if (cameras.length) {
    const surface = new BufferGeometry();
    surface.setAttribute("position", new BufferAttribute(new Float32Array(fill), 3));
    const material = new MeshBasicMaterial({
      color: new Color(layer.color), transparent: true, opacity: 0.14, side: DoubleSide, depthWrite: false,
    });
    const planes = new Mesh(surface, material);
    planes.frustumCulled = false;
    group.add(segments(outline, layer.color, 1.5), planes);
  }
  const one = segments(edges.flatMap((p) => [...p]), layer.color, 2.75);
  one.matrixAutoUpdate = false;
  one.visible = false;
  group.add(one);
  group.userData = { cameras, one, depth, color: layer.color };
  return group;
}

export function polylines(layer, center) {
  const positions = [];
  for (const line of layer.lines) {
    for (let i = 1; i < line.length; i++) {
      for (const p of [line[i - 1], line[i]]) positions.push(...p.map((value, axis) => value - center[axis]));
    }
  }
  return positions.length ? segments(positions, layer.color, 2) : new Group();
}

// A step of 1, 2 or 5 × 10^k metres that cuts a length into at most `parts`, and about as many.
export function niceStep(length, parts = 10.5) {
  const power = 10 ** Math.floor(Math.log10(length / parts));
  return [1, 2, 5, 10].map((m) => m * power).find((step) => length / step <= parts);
}

export function grid(box, height, step, center) {
  const [x0, y0] = [0, 1].map((axis) => Math.floor(box[0][axis] / step - 1e-6));
  const [x1, y1] = [0, 1].map((axis) => Math.ceil(box[1][axis] / step + 1e-6));
  const positions = [];
  const point = (i, j) => positions.push(i * step - center[0], j * step - center[1], height - center[2]);
  for (let i = x0; i <= x1; i++) point(i, y0), point(i, y1);
  for (let j = y0; j <= y1; j++) point(x0, j), point(x1, j);
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(new Float32Array(positions), 3));
  const lines = new LineSegments(geometry, new LineBasicMaterial({ transparent: true }));
  lines.frustumCulled = false;
  return lines;
}
