// One session's frames over WebSocket: the protobuf bytes of Animate, resumed by itself when the connection breaks.

import { DeltaReader } from "./deltas.js";
import { AnimateRequest, AnimateResponse, Encoding, EventType, Pacing } from "./messages.js";
import { decode, encode, floats, snorm16 } from "./protobuf.js";

const RESUME_FOR = 10_000; // [ms] of silence after which a broken stream is given up

export class FrameStream {
  /** `on` has frame(frame), event(event), state(text) and failed(message). */
  constructor(session, on) {
    this.session = session;
    this.on = on;
    this.header = null;
    this.lastSequence = 0;
    this.lastControl = 0;
    this.unconfirmed = new Map();
    this.closed = false;
    this.brokenSince = 0;
    this.connect();
  }

  connect() {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    this.socket = new WebSocket(`${scheme}://${location.host}/v1/${this.session}/stream`);
    this.socket.binaryType = "arraybuffer";
    this.socket.onopen = () => this.open();
    this.socket.onmessage = (message) => this.receive(new Uint8Array(message.data));
    this.socket.onclose = (event) => this.lost(event);
  }

  open() {
    this.write({
      open: {
        session: this.session,
        after_sequence: this.lastSequence,
        resume_token: this.header?.resume_token,
        rotation_encodings: [Encoding.DELTA16, Encoding.SNORM16],
        pacing: Pacing.REALTIME,
      },
    });
  }

  receive(bytes) {
    this.brokenSince = 0;
    let message;
    try {
      message = decode(AnimateResponse, bytes);
    } catch (error) {
      this.close();
      this.on.failed(`The stream cannot be read: ${error.message}.`);
      return;
    }
    const { header, frame, event } = message;
    if (header) this.receiveHeader(header);
    else if (frame) this.receiveFrame(frame);
    else if (event) this.receiveEvent(event);
  }

  receiveHeader(header) {
    this.header = header;
    this.deltas = new DeltaReader();
    const confirmed = header.last_control_id ?? 0;
    this.lastControl = Math.max(this.lastControl, confirmed);
    for (const id of [...this.unconfirmed.keys()]) if (id <= confirmed) this.unconfirmed.delete(id);
    for (const control of this.unconfirmed.values()) this.write({ control });
    this.on.state("live");
  }

  receiveFrame(frame) {
    const rotations = this.rotations(frame.rotations); // of every frame: the next may be told as a difference from it
    if (frame.sequence <= this.lastSequence) return;
    this.lastSequence = frame.sequence;
    const time = frame.sequence / this.header.frame_rate;
    this.on.frame({ ...frame, time, root: floats(frame.root).subarray(0, 3), rotations });
    this.write({ ack: { sequence: frame.sequence } });
  }

  rotations(packed) {
    if (this.header.rotation_encoding === Encoding.DELTA16) return this.deltas.read(packed);
    return this.header.rotation_encoding === Encoding.SNORM16 ? snorm16(packed) : floats(packed);
  }

  receiveEvent(event) {
    if (event.type === EventType.CONTROL_APPLIED) this.unconfirmed.delete(event.control_id);
    if (event.type === EventType.SESSION_ENDED) this.closed = true;
    this.on.event(event);
  }

  /** Sends a control ({ steer }, { goal } or { playback }); after a break it is sent again. */
  control(control) {
    this.lastControl += 1;
    const numbered = { ...control, control_id: this.lastControl };
    this.unconfirmed.set(this.lastControl, numbered);
    if (this.header) this.write({ control: numbered });
  }

  write(message) {
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(encode(AnimateRequest, message));
  }

  lost(event) {
    if (this.closed) return;
    // 4000 + HTTP status: the server said no, and asking again would not help.
    if (event.code >= 4400 && event.code < 4500) {
      this.closed = true;
      this.on.failed(`The stream was refused: ${event.reason || event.code}.`);
      return;
    }
    this.brokenSince ||= performance.now();
    if (performance.now() - this.brokenSince > RESUME_FOR) {
      this.closed = true;
      this.on.failed("The connection to the motion service broke and could not be resumed. Is it still running?");
      return;
    }
    this.on.state("reconnecting");
    setTimeout(() => !this.closed && this.connect(), 300);
  }

  close() {
    this.closed = true;
    this.socket.close();
  }
}
