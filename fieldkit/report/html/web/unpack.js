// Reads the blocks that fieldkit/report/html/packing.py writes.

const NO_VALUE = 255;

// A block as typed arrays, four entries a point so that each begins at a multiple of four bytes. The points are
// reordered by steps of the golden section: any beginning of the arrays is then an even sample of the cloud.
export async function unpack(text, layer) {
  const bytes = await gunzip(bytesOf(text));
  const n = layer.count;
  if (bytes.length !== n * (6 + (layer.colored ? 3 : 0) + (layer.valued ? 1 : 0))) {
    throw new Error("the data of a layer is incomplete");
  }
  const place = places(n);
  const positions = new Uint16Array(4 * n);
  for (let axis = 0; axis < 3; axis++) {
    const high = axis * n, low = (axis + 3) * n;
    for (let i = 0, at = 0; i < n; i++) {
      const zigzag = (bytes[high + i] << 8) | bytes[low + i];
      at += (zigzag >> 1) ^ -(zigzag & 1);
      positions[4 * place[i] + axis] = at;
    }
  }
  let next = 6 * n;
  let colors = null, values = null;
  if (layer.colored) {
    colors = new Uint8Array(4 * n);
    for (let i = 0, green = 0, red = 0, blue = 0; i < n; i++) {
      green += bytes[next + i];
      red += bytes[next + n + i];
      blue += bytes[next + 2 * n + i];
      const at = 4 * place[i];
      colors[at] = red + green;
      colors[at + 1] = green;
      colors[at + 2] = blue + green;
    }
    next += 3 * n;
  }
  if (layer.valued) {
    values = new Uint8Array(n);
    for (let i = 0; i < n; i++) values[place[i]] = bytes[next + i];
  }
  return { positions, colors, values };
}

// Colours of values, from 0 for 0 to 254 for the scale's end.
export function paint(values, palette, missing) {
  const table = new Uint8Array(3 * 256);
  const last = palette.length - 1;
  for (let v = 0; v < NO_VALUE; v++) {
    const at = (v / (NO_VALUE - 1)) * last;
    const i = Math.min(Math.floor(at), last - 1);
    for (let c = 0; c < 3; c++) table[3 * v + c] = palette[i][c] + (at - i) * (palette[i + 1][c] - palette[i][c]);
  }
  table.set(missing, 3 * NO_VALUE);
  const colors = new Uint8Array(4 * values.length);
  for (let i = 0; i < values.length; i++) {
    const v = 3 * values[i];
    colors[4 * i] = table[v];
    colors[4 * i + 1] = table[v + 1];
    colors[4 * i + 2] = table[v + 2];
  }
  return colors;
}

export function rgb(hex) {
  const value = parseInt(hex.slice(1), 16);
  return [value >> 16, (value >> 8) & 255, value & 255];
}

function bytesOf(text) {
  if (Uint8Array.fromBase64) return Uint8Array.fromBase64(text);
  const packed = atob(text);
  const bytes = new Uint8Array(packed.length);
  for (let i = 0; i < packed.length; i++) bytes[i] = packed.charCodeAt(i);
  return bytes;
}

async function gunzip(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// Where point i goes: i × stride modulo n is a permutation if they have no common divisor; its inverse is wanted, so
// that place k holds point k × stride.
function places(n) {
  let stride = Math.max(1, Math.floor(0.6180339887498949 * n));
  while (gcd(stride, n) !== 1) stride++;
  const place = new Uint32Array(n);
  for (let k = 0, i = 0; k < n; k++) {
    place[i] = k;
    i += stride;
    if (i >= n) i -= n;
  }
  return place;
}

function gcd(a, b) {
  while (b) [a, b] = [b, a % b];
  return a;
}
