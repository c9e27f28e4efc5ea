// The packet of pages/relighting.py: planes of half floats and what they mean.

const FLOATS = floatOfHalf(); // of each half float's 65,536 patterns

export function packetOf(data) {
  const view = new DataView(data);
  if (String.fromCharCode(...new Uint8Array(data, 0, 4)) !== "PBLT") throw new Error("not the light of a view");
  const length = view.getUint32(4, true);
  const facts = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 8, length)));
  const size = 3 * facts.width * facts.height;
  const planes = new Map();
  facts.planes.forEach((name, k) => planes.set(name, new Uint16Array(data, 8 + length + 2 * size * k, size)));
  return { ...facts, planes };
}

// Every step-th pixel of a plane as numbers; factor takes a scale out.
export function numbers(halves, step, factor) {
  const n = Math.ceil(halves.length / 3 / step);
  const out = new Float32Array(3 * n);
  for (let k = 0; k < n; k++) {
    for (let c = 0; c < 3; c++) out[3 * k + c] = FLOATS[halves[3 * step * k + c]] * factor;
  }
  return out;
}

function floatOfHalf() {
  const table = new Float32Array(65536);
  for (let bits = 0; bits < 65536; bits++) {
    const exponent = (bits >> 10) & 31, fraction = bits & 1023;
    let value = exponent === 0 ? fraction * 2 ** -24 : exponent === 31 ? (fraction ? NaN : Infinity) : (1 + fraction / 1024) * 2 ** (exponent - 15);
    table[bits] = bits & 0x8000 ? -value : value;
  }
  return table;
}
