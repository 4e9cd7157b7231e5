// Protocol buffers, the part that frames need. A message is described by a table
//   { fieldNumber: [name, kind] }   or   [name, kind, "repeated"];   kind = a scalar's name, or another table
// Decoding skips fields that are not in the table, so a newer server does not break an older page.

const VARINT = 0, FIXED64 = 1, BYTES = 2, FIXED32 = 5;

const WIRE_TYPES = {
  uint32: VARINT, uint64: VARINT, int32: VARINT, sint32: VARINT, bool: VARINT, enum: VARINT,
  double: FIXED64, fixed32: FIXED32, float: FIXED32, string: BYTES, bytes: BYTES,
};

const wireType = (kind) => (typeof kind === "string" ? WIRE_TYPES[kind] : BYTES);

class Reader {
  constructor(bytes) {
    this.bytes = bytes;
    this.view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    this.at = 0;
  }

  varint() {
    let value = 0, scale = 1;
    for (let i = 0; i < 10; i++) {
      if (this.at >= this.bytes.length) throw new Error("the message ends inside a number");
      const byte = this.bytes[this.at++];
      value += (byte & 0x7f) * scale;
      if (byte < 0x80) return value; // exact below 2^53
      scale *= 128;
    }
    throw new Error("a number is longer than ten bytes");
  }

  take(size) {
    if (this.at + size > this.bytes.length) throw new Error("the message ends inside a field");
    const start = this.at;
    this.at += size;
    return start;
  }

  scalar(kind) {
    switch (kind) {
      case "bool": return this.varint() !== 0;
      case "int32": return this.varint() | 0;
      case "sint32": { const n = this.varint(); return n % 2 ? -(n + 1) / 2 : n / 2; }
      case "double": return this.view.getFloat64(this.take(8), true);
      case "float": return this.view.getFloat32(this.take(4), true);
      case "fixed32": return this.view.getUint32(this.take(4), true);
      case "string": return new TextDecoder().decode(this.slice());
      case "bytes": return this.slice();
      default: return this.varint();
    }
  }

  slice() {
    const size = this.varint();
    const start = this.take(size);
    return this.bytes.subarray(start, start + size);
  }

  skip(type) {
    if (type === VARINT) this.varint();
    else if (type === FIXED64) this.take(8);
    else if (type === BYTES) this.slice();
    else if (type === FIXED32) this.take(4);
    else throw new Error(`wire type ${type} is not known`);
  }
}

/** Bytes -> plain object. Fields that were not sent are absent; repeated ones are [] then. */
export function decode(table, bytes) {
  const reader = new Reader(bytes);
  const message = {};
  for (const [name, , repeated] of Object.values(table)) if (repeated) message[name] = [];
  while (reader.at < bytes.length) {
    const key = reader.varint();
    const field = table[Math.floor(key / 8)], type = key % 8;
    if (!field) reader.skip(type);
    else readField(reader, message, field, type);
  }
  return message;
}

function readField(reader, message, [name, kind, repeated], type) {
  if (repeated && type === BYTES && wireType(kind) !== BYTES) {
    const packed = new Reader(reader.slice());
    while (packed.at < packed.bytes.length) message[name].push(packed.scalar(kind));
    return;
  }
  const value = typeof kind === "string" ? reader.scalar(kind) : decode(kind, reader.slice());
  if (repeated) message[name].push(value);
  else message[name] = value;
}

class Writer {
  constructor() { this.out = []; }

  varint(value) {
    while (value >= 128) {
      this.out.push((value % 128) | 0x80);
      value = Math.floor(value / 128);
    }
    this.out.push(value);
  }

  fixed(size, set) {
    const view = new DataView(new ArrayBuffer(size));
    set(view);
    for (let i = 0; i < size; i++) this.out.push(view.getUint8(i));
  }

  raw(bytes) {
    this.varint(bytes.length);
    for (const byte of bytes) this.out.push(byte);
  }

  scalar(kind, value) {
    switch (kind) {
      case "bool": this.varint(value ? 1 : 0); break;
      case "sint32": this.varint(value < 0 ? -2 * value - 1 : 2 * value); break;
      case "double": this.fixed(8, (view) => view.setFloat64(0, value, true)); break;
      case "float": this.fixed(4, (view) => view.setFloat32(0, value, true)); break;
      case "fixed32": this.fixed(4, (view) => view.setUint32(0, value, true)); break;
      case "string": this.raw(new TextEncoder().encode(value)); break;
      case "bytes": this.raw(value); break;
      default: this.varint(value);
    }
  }
}

/** Plain object -> bytes, in the order of field numbers; undefined and null fields are left out. */
export function encode(table, message) {
  const writer = new Writer();
  for (const [number, [name, kind, repeated]] of Object.entries(table)) {
    const value = message[name];
    if (value === undefined || value === null) continue;
    for (const item of repeated ? value : [value]) {
      writer.varint(Number(number) * 8 + wireType(kind));
      if (typeof kind === "string") writer.scalar(kind, item);
      else writer.raw(encode(kind, item));
    }
  }
  return new Uint8Array(writer.out);
}

/** Little-endian float32 bytes -> numbers; copied, because a slice of a message need not be aligned. */
export function floats(bytes) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  return Float32Array.from({ length: bytes.length / 4 }, (_, i) => view.getFloat32(4 * i, true));
}

/** Rotations packed as int16 scaled by 32767 -> numbers, as near to unit length as 16 bits allow. */
export function snorm16(bytes) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  return Float32Array.from({ length: bytes.length / 2 }, (_, i) => view.getInt16(2 * i, true) / 32767);
}

/** Numbers (nested lists are flattened) -> little-endian float32 bytes. */
export function packFloats(values) {
  const flat = Array.from(values).flat(Infinity);
  const view = new DataView(new ArrayBuffer(4 * flat.length));
  flat.forEach((value, i) => view.setFloat32(4 * i, value, true));
  return new Uint8Array(view.buffer);
}
