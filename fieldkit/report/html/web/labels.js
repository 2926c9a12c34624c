// Names of cameras, shown at the one under the pointer.

const MOUSE_PX = 16, FINGER_PX = 26;

export class Labels {
  constructor(stage) {
    this.stage = stage;
    this.pointed = null;
    this.tip = document.createElement("div");
    this.tip.className = "fk-view-tip";
    this.tip.hidden = true;
    stage.append(this.tip);
  }

  // Takes a pointer's event, or null for none over the view; says whether another camera is pointed at now.
  point(event, groups, eye) {
    const found = event ? this.nearest(event, groups, eye) : null;
    if (found?.camera === this.pointed?.camera) return false;
    if (this.pointed) this.pointed.group.userData.one.visible = false;
    this.pointed = found;
    this.tip.hidden = !found;
    if (found) {
      const { one, color } = found.group.userData;
      one.matrix.copy(found.camera.matrix);
      one.visible = true;
      this.tip.textContent = found.camera.label;
      this.tip.style.setProperty("--fk-view-mark", color);
      this.tip.style.left = `${Math.min(Math.max(found.x, 70), found.width - 70)}px`;
      this.tip.style.top = `${found.y}px`;
      this.tip.classList.toggle("fk-view-tip-below", found.y < 60);
    }
    return true;
  }

  nearest(event, groups, eye) {
    const box = this.stage.getBoundingClientRect();
    const { clientWidth: width, clientHeight: height, clientLeft: edge } = this.stage;
    const at = { x: event.clientX - box.left - edge, y: event.clientY - box.top - edge };
    let least = event.pointerType === "touch" ? FINGER_PX : MOUSE_PX, found = null;
    for (const group of groups) {
      if (!group.visible) continue;
      for (const camera of group.userData.cameras) {
        for (const place of [camera.middle, camera.at]) {
          const p = place.clone().project(eye);
          if (p.z > 1) continue; // behind the eye
          const x = 0.5 * (p.x + 1) * width, y = 0.5 * (1 - p.y) * height;
          const away = Math.hypot(x - at.x, y - at.y);
          if (away < least) [least, found] = [away, { group, camera, x, y, width }];
        }
      }
    }
    return found;
  }
}
