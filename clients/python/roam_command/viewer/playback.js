// From frames at 30 Hz that arrive a little unevenly to a body that moves evenly at the screen's rate.

const BEHIND = 0.06; // [s] how far the picture runs behind the newest frame: about two frames
const KEPT = 9000; // five minutes that can be looked at again and saved

export class Playback {
  constructor() {
    this.clear();
  }

  clear() {
    this.frames = [];
    this.time = null;
    this.arrivals = [];
    this.held = null; // [s] the time looked at, null: live
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
    if (this.held !== null) return this.pose(character, this.held);
    const wanted = this.newest.time - BEHIND;
    this.time = this.time === null ? wanted : this.time + seconds;
    // Drift is pulled in gently; a long gap (a hidden tab, a break) is jumped over.
    const drift = wanted - this.time;
    this.time += Math.abs(drift) > 0.5 ? drift : drift * Math.min(1, 3 * seconds);
    return this.pose(character, this.time);
  }

  pose(character, time) {
    let low = 0, next = this.frames.length; // the first frame at or after `time`
    while (low < next) {
      const middle = (low + next) >> 1;
      if (this.frames[middle].time >= time) next = middle;
      else low = middle + 1;
    }
    if (next === 0 || next === this.frames.length) {
      const only = next === 0 ? this.frames[0] : this.newest;
      character.setPose(only.root, only.rotations);
      return true;
    }
    const a = this.frames[next - 1], b = this.frames[next];
    character.setBetween(a, b, (time - a.time) / (b.time - a.time));
    return true;
  }
}
