// From frames at 30 Hz that arrive a little unevenly to a body that moves evenly at the screen's rate.

const BEHIND = 0.06; // [s] how far the picture runs behind the newest frame: about two frames
const KEPT = 60;

export class Playback {
  constructor() {
    this.clear();
  }

  clear() {
    this.frames = [];
    this.time = null;
    this.arrivals = [];
  }

  push(frame) {
    this.frames.push(frame);
    if (this.frames.length > KEPT) this.frames.shift();
    const now = performance.now();
    this.arrivals.push(now);
    while (this.arrivals.length && now - this.arrivals[0] > 2000) this.arrivals.shift();
  }

  get newest() {
    return this.frames.at(-1) ?? null;
  }

  /** Frames that arrived per second over the last two seconds. */
  get rate() {
    const now = performance.now();
    const recent = this.arrivals.filter((at) => now - at < 2000);
    return recent.length < 2 ? 0 : ((recent.length - 1) * 1000) / (recent.at(-1) - recent[0]);
  }

  /** Advances by `seconds` and poses the character; false while there is nothing to show. */
  show(character, seconds) {
    if (!this.newest) return false;
    const wanted = this.newest.time - BEHIND;
    this.time = this.time === null ? wanted : this.time + seconds;
    // Drift is pulled in gently; a long gap (a hidden tab, a break) is jumped over.
    const drift = wanted - this.time;
    this.time += Math.abs(drift) > 0.5 ? drift : drift * Math.min(1, 3 * seconds);
    const next = this.frames.findIndex((frame) => frame.time >= this.time);
    if (next <= 0) {
      const only = next === 0 ? this.frames[0] : this.newest;
      character.setPose(only.root, only.rotations);
      return true;
    }
    const a = this.frames[next - 1], b = this.frames[next];
    character.setBetween(a, b, (this.time - a.time) / (b.time - a.time));
    return true;
  }
}
