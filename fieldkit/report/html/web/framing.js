// Where the eye stands at first, and how large things are drawn there.

import { Vector3 } from "three";

export const ASIDE = [-0.5, -0.78, 0.42]; // from the target to the eye
const UPRIGHT = 1e-5; // what leans so little is seen from straight above, and still has an upper edge

// From straight above, with `north`, or y where it is not known, at the picture's upper edge.
export function above(north) {
  const [x, y] = north ?? [0, 1];
  return [-UPRIGHT * x, -UPRIGHT * y, 1];
}

function range(values) {
  const low = Math.min(...values), high = Math.max(...values);
  return { middle: 0.5 * (low + high), half: 0.5 * (high - low) };
}

// The eye's place and its target, from which the points' box and the cameras, or all, are just seen; and the middle and
// half the height that an orthographic picture has for it. All are relative to `center`; the eye looks along −direction.
export function placeToSeeAll(direction, { inner, outer }, cameras, center, camera) {
  const back = new Vector3(...direction).normalize();
  const right = new Vector3(0, 0, 1).cross(back).normalize();
  const up = back.clone().cross(right);
  const high = 0.9 * Math.tan((camera.fov * Math.PI) / 360), wide = high * camera.aspect;
  const box = cameras.length ? inner : outer;
  const corners = [0, 1, 2, 3, 4, 5, 6, 7].map((i) => [box[i & 1][0], box[(i >> 1) & 1][1], box[(i >> 2) & 1][2]]);
  const seen = [...cameras, ...corners].map((at) => new Vector3(...at.map((value, axis) => value - center[axis])));
  const target = new Vector3();
  let distance = 0.5 * Math.hypot(...outer[0].map((value, axis) => outer[1][axis] - value));
  // In rounds: the middle of what is seen moves up and down with the distance.
  for (let round = 0; round < 4; round++) {
    if (direction[2] < 0.99) {
      const heights = seen.map((at) => {
        const p = at.clone().sub(target);
        return p.dot(up) / Math.max(1e-6, distance - p.dot(back));
      });
      target.z += (0.4 * (Math.min(...heights) + Math.max(...heights)) * distance) / up.z;
    }
    distance = 1e-3;
    for (const at of seen) {
      const p = at.clone().sub(target), toward = p.dot(back);
      distance = Math.max(distance, toward + Math.abs(p.dot(right)) / wide, toward + Math.abs(p.dot(up)) / high);
    }
  }
  const [x, y] = [right, up].map((axis) => range(seen.map((at) => at.dot(axis))));
  const half = Math.max(1e-3, x.half / (0.9 * camera.aspect), y.half / 0.9);
  const middle = right.clone().multiplyScalar(x.middle).addScaledVector(up, y.middle);
  return { target, position: back.clone().multiplyScalar(distance).add(target), middle, half };
}

// How deep the cameras' pyramids are: so that those of neighbours rarely overlap.
export function frustumDepth(layers, radius) {
  let depth = 0.065 * radius;
  for (const { centers } of layers) {
    if (centers.length < 2) continue;
    const away = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
    const nearest = centers.map((a, i) => {
      return centers.reduce((best, b, j) => (i === j ? best : Math.min(best, away(a, b))), Infinity);
    });
    nearest.sort((a, b) => a - b);
    depth = Math.min(depth, Math.max(0.45 * nearest[nearest.length >> 1], 0.02 * radius));
  }
  return depth;
}
