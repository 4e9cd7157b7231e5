// Walking by hand: keys relative to the view, or towards a place on the floor.

const WALKING_SPEED = 1.2; // [m/s]
const ARRIVED = 0.15; // [m]
const SLOWING = 0.6; // [m] from the place, where walking slows down

const KEYS = {
  KeyW: [0, 1], ArrowUp: [0, 1], KeyS: [0, -1], ArrowDown: [0, -1],
  KeyA: [1, 0], ArrowLeft: [1, 0], KeyD: [-1, 0], ArrowRight: [-1, 0],
};

export class Steering {
  constructor() {
    this.held = new Set();
    this.place = null;
  }

  /** True when the key steers. */
  press(code) {
    if (!(code in KEYS)) return false;
    this.held.add(code);
    this.place = null;
    return true;
  }

  release(code) {
    return this.held.delete(code);
  }

  walkTo(place) {
    this.place = place;
  }

  stop() {
    this.held.clear();
    this.place = null;
  }

  get active() {
    return this.held.size > 0 || this.place !== null;
  }

  /** The velocity to ask for [m/s], or null when a walk to a place has just ended. */
  velocity(hips, viewYaw) {
    if (this.held.size > 0) {
      let left = 0, ahead = 0;
      for (const code of this.held) {
        left += KEYS[code][0];
        ahead += KEYS[code][1];
      }
      const length = Math.hypot(left, ahead) || 1;
      const yaw = viewYaw + Math.atan2(left, ahead);
      const speed = left || ahead ? WALKING_SPEED : 0;
      return { x: (speed * Math.sin(yaw) * Math.min(1, length)), z: speed * Math.cos(yaw) * Math.min(1, length) };
    }
    if (!this.place) return null;
    const dx = this.place.x - hips.x, dz = this.place.z - hips.z;
    const distance = Math.hypot(dx, dz);
    if (distance < ARRIVED) {
      this.place = null;
      return null;
    }
    const speed = WALKING_SPEED * Math.min(1, Math.max(0.4, distance / SLOWING));
    return { x: (dx / distance) * speed, z: (dz / distance) * speed };
  }
}
