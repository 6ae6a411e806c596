// What lib/report/organ.cpp packs: deflate in base64; a header's length (uint32) and the header, JSON; then arrays. Numbers of
// more than a byte are differences to the one before, all low bytes first.

async function inflated(base64) {
  const packed = Uint8Array.from(atob(base64), (sign) => sign.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

class Reader {
  constructor(bytes, at) {
    this.bytes = bytes;
    this.at = at;
  }

  small(count) {
    this.at += count;
    return this.bytes.subarray(this.at - count, this.at);
  }

  numbers(count, width) {
    const values = width === 2 ? new Uint16Array(count) : new Uint32Array(count);
    for (let plane = 0; plane < width; ++plane) {
      const bytes = this.small(count);
      for (let i = 0; i < count; ++i) {
        values[i] |= bytes[i] << (8 * plane);
      }
    }
    for (let i = 1; i < count; ++i) {
      values[i] += values[i - 1];
    }
    return values;
  }

  // Vectors, stored component by component.
  vectors(count, convert) {
    const packed = this.numbers(3 * count, 2);
    const values = new Float32Array(3 * count);
    for (let i = 0; i < count; ++i) {
      for (let k = 0; k < 3; ++k) {
        values[3 * i + k] = convert(packed[k * count + i], k);
      }
    }
    return values;
  }
}

export async function readOrgan(base64) {
  const bytes = await inflated(base64);
  const length = new DataView(bytes.buffer).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(bytes.subarray(4, 4 + length)));
  const reader = new Reader(bytes, 4 + length);
  const place = (value, k) => header.origin[k] + (value / 65535) * header.size;
  const shift = (value) => ((value - 32768) / 32767) * header.displacement;
  const mesh = ({ points, triangles }) => ({
    positions: reader.vectors(points, place),
    triangles: reader.numbers(3 * triangles, points < 65536 ? 2 : 4),
  });
  const organ = { header };
  organ.shell = mesh(header.shell);
  organ.edges = reader.numbers(2 * header.edges, header.shell.points < 65536 ? 2 : 4);
  organ.distance = header.tops.distance === null ? null : reader.small(header.shell.points);
  organ.states = header.states.map((label) => ({
    label,
    displacement: reader.vectors(header.shell.points, shift),
    membrane: reader.small(header.shell.points),
    stress: reader.small(header.shell.points),
  }));
  organ.surface = header.surface && mesh(header.surface);
  organ.solids = header.solids && {
    ...mesh(header.solids),
    displacements: header.states.map(() => reader.vectors(header.solids.points, shift)),
  };
  return organ;
}
