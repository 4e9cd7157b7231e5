// Rotations that are told as differences from the frames before (ROTATION_ENCODING_DELTA16, proto/README.md).

const WHOLE = 15; // a width that stands for 16 bits of the number itself

/** Reads the frames of one stream, every one of them, in order; a stream that is opened anew needs a new one. */
export class DeltaReader {
  constructor() { this.before = []; }

  /** The rotations of a frame, near to unit length, four numbers for every joint. */
  read(bytes) {
    const numbers = bytes[0] === 0 ? this.whole(bytes) : this.after(bytes);
    this.before = [numbers, ...this.before.slice(0, 1)];
    return Float32Array.from(numbers, (value) => value / 32767);
  }

  whole(bytes) {
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    return Int32Array.from({ length: (bytes.length - 1) / 2 }, (_, i) => view.getInt16(1 + 2 * i, true));
  }

  after(bytes) {
    if (!(bytes[0] <= this.before.length)) throw new Error("a frame tells of others that never came");
    const [latest, earlier] = this.before, joints = latest.length / 4;
    const out = new Int32Array(latest.length);
    let at = 8 * (1 + Math.ceil(joints / 2));
    for (let joint = 0; joint < joints; joint++) {
      const width = (bytes[1 + (joint >> 1)] >> (4 * (joint & 1))) & 15;
      for (let i = 4 * joint; i < 4 * joint + 4; i++) {
        let number = 0;
        for (let bit = 0; bit < (width === WHOLE ? 16 : width); bit++, at++) {
          number |= ((bytes[at >> 3] >> (at & 7)) & 1) << bit;
        }
        const expected = bytes[0] === 1 ? latest[i] : 2 * latest[i] - earlier[i];
        out[i] = width === WHOLE ? (number << 16) >> 16 : expected + ((number >> 1) ^ -(number & 1));
      }
    }
    if (8 * bytes.length < at) throw new Error("a frame ends inside its rotations");
    return out;
  }
}
