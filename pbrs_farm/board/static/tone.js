// White balance and exposure of a sum of light layers, as transport/develop computes them.
// Everything here has its counterpart in mode_pictures.py and tone_mapping.py; the GPU applies it.

const LUMINANCE = [0.2126, 0.7152, 0.0722];
const MITSUBA_LUMINANCE = [0.212671, 0.71516, 0.072169];
const METERED = [1 / 32, 4], LIT_SHARES = [0.5, 0.95];
const SATURATED = 0.35, SAME_HUE_COS = 0.9, FILLED = 0.5;
const TINT = [-0.1, 0.35], WARMTH = [-0.7, 1.6];
const BURN = 0.2, LOG_FLOOR = 1e-3;

// What the shader needs for a picture. light, albedo: Float32Array of n pixels x 3, absolute radiance.
export function toneOf(light, albedo, fields) {
  const gains = whiteBalance(light, albedo, fields).map(Math.fround);
  const n = light.length / 3;
  const isReleased = fields.preset === "released";
  const exposure = isReleased ? releasedExposure(light, gains, n, fields.key) : photoExposure(light, gains, n, fields.key) * 2 ** fields.exposure_ev;
  let largest = 0;
  if (isReleased) {
    for (let k = 0; k < n; k++) largest = Math.max(largest, dot(light, k, gains, MITSUBA_LUMINANCE));
  }
  const veil = isReleased ? [0, 0, 0] : strayLight(light, gains, n, exposure, fields);
  return { gains, exposure, veil, white: largest * exposure * (1 - BURN) ** 2, knee: fields.knee, pale: 1 / Math.max(Math.log2(fields.white), 1e-3), contrast: fields.contrast };
}

// The share of the picture's mean that the lens spreads over all of it, in exposed light.
function strayLight(light, gains, n, exposure, fields) {
  return gains.map((gain, c) => {
    let sum = 0;
    for (let k = 0; k < n; k++) sum += Math.min(Math.max(light[3 * k + c] * gain, 0) * exposure, fields.white);
    return (fields.flare * sum) / n;
  });
}

function dot(light, k, gains, weights) {
  return light[3 * k] * gains[0] * weights[0] + light[3 * k + 1] * gains[1] * weights[1] + light[3 * k + 2] * gains[2] * weights[2];
}

function releasedExposure(light, gains, n, key) {
  let sum = 0;
  for (let k = 0; k < n; k++) sum += Math.log(dot(light, k, gains, MITSUBA_LUMINANCE) + LOG_FLOOR);
  return key / Math.exp(sum / n);
}

function photoExposure(light, gains, n, key) {
  // Leave out pixels that hit nothing; clamp to METERED of the median.
  const levels = new Float64Array(n);
  let m = 0;
  for (let k = 0; k < n; k++) {
    const level = dot(light, k, gains, LUMINANCE);
    if (level > 0) levels[m++] = level;
  }
  if (m === 0) return 1;
  const lit = levels.subarray(0, m);
  const [low, high] = METERED.map((share) => share * percentile(lit, 0.5));
  let sum = 0;
  for (let k = 0; k < m; k++) sum += Math.log(Math.min(high, Math.max(low, lit[k])));
  return key / Math.exp(sum / m);
}

function whiteBalance(light, albedo, fields) {
  const found = fields.white_balance > 0 ? illuminant(light, albedo) : null;
  let gains = [1, 1, 1];
  if (found) {
    const level = weighted(found);
    gains = found.map((v) => (v / level) ** -fields.white_balance);
  }
  // The camera's errors: red and blue part by the warmth, green and both by the tint.
  gains = [gains[0] * 2 ** (fields.warmth_ev / 2), gains[1] * 2 ** fields.tint_ev, gains[2] * 2 ** (-fields.warmth_ev / 2)];
  const total = weighted(gains);
  return gains.map((g) => g / total);
}

function illuminant(light, albedo) {
  const n = light.length / 3;
  // Pixels whose light and colour are known, the better lit half of them.
  let chosen = new Uint32Array(n), m = 0;
  const levels = new Float64Array(n);
  for (let k = 0; k < n; k++) {
    const a = 3 * k;
    const isUsable = albedo[a] > 0.02 && albedo[a + 1] > 0.02 && albedo[a + 2] > 0.02 && light[a] > 0 && light[a + 1] > 0 && light[a + 2] > 0;
    if (isUsable) {
      levels[m] = weighted([0, 1, 2].map((c) => light[a + c] / albedo[a + c]));
      chosen[m++] = k;
    }
  }
  if (m < 16) return null;
  const copy = levels.slice(0, m);
  const [low, high] = LIT_SHARES.map((share) => percentile(copy, share));
  let kept = 0;
  for (let k = 0; k < m; k++) if (levels[k] >= low && levels[k] <= high) chosen[kept++] = chosen[k];
  chosen = chosen.subarray(0, kept);
  // The illuminant is the median of radiance over albedo.
  const colour = [0, 1, 2].map((c) => {
    const logs = new Float64Array(kept);
    for (let k = 0; k < kept; k++) logs[k] = Math.log(light[3 * chosen[k] + c] / albedo[3 * chosen[k] + c]);
    return Math.exp(percentile(logs, 0.5));
  });
  return oneColourFills(albedo, chosen) ? asLampOrSky(colour) : colour;
}

const weighted = (rgb) => rgb[0] * LUMINANCE[0] + rgb[1] * LUMINANCE[1] + rgb[2] * LUMINANCE[2];

function oneColourFills(albedo, chosen) {
  const n = chosen.length;
  const hues = [0, 1, 2].map(() => new Float64Array(n));
  let m = 0;
  for (let k = 0; k < n; k++) {
    const [r, g, b] = albedo.subarray(3 * chosen[k], 3 * chosen[k] + 3);
    const top = Math.max(r, g, b);
    if (top - Math.min(r, g, b) <= SATURATED * top) continue;
    const mean = (r + g + b) / 3;
    const chroma = [r - mean, g - mean, b - mean];
    const length = Math.max(Math.hypot(...chroma), 1e-9);
    for (let c = 0; c < 3; c++) hues[c][m] = chroma[c] / length;
    m++;
  }
  if (m === 0) return false;
  const found = hues.map((h) => h.subarray(0, m));
  const common = found.map((h) => percentile(h.slice(), 0.5));
  const length = Math.hypot(...common);
  if (length === 0) return false;
  let same = 0;
  for (let k = 0; k < m; k++) {
    const cos = found[0][k] * common[0] + found[1][k] * common[1] + found[2][k] * common[2];
    if (cos > SAME_HUE_COS * length) same++;
  }
  return same / n > FILLED;
}

function asLampOrSky(light) {
  const [red, green, blue] = light.map(Math.log);
  const mean = (red + green + blue) / 3;
  const clamp = (v, [low, high]) => Math.min(high, Math.max(low, v));
  const tint = clamp(green - (red + blue) / 2, TINT), warmth = clamp(red - blue, WARMTH);
  const others = mean - tint / 3;
  return [others + warmth / 2, mean + (2 * tint) / 3, others - warmth / 2].map(Math.exp);
}

// A quantile of the numbers, interpolated as numpy does. Reorders them.
export function percentile(values, share) {
  const at = share * (values.length - 1);
  const below = Math.floor(at);
  const low = select(values, below);
  if (at === below) return low;
  // The next larger one is the least of those behind.
  let high = Infinity;
  for (let k = below + 1; k < values.length; k++) if (values[k] < high) high = values[k];
  return low + (high - low) * (at - below);
}

// Hoare's selection: afterwards values[wanted] is in its place and nothing behind it is smaller.
function select(values, wanted) {
  let left = 0, right = values.length - 1;
  while (left < right) {
    const pivot = values[(left + right) >> 1];
    let i = left, j = right;
    while (i <= j) {
      while (values[i] < pivot) i++;
      while (values[j] > pivot) j--;
      if (i <= j) {
        const swapped = values[i];
        values[i++] = values[j];
        values[j--] = swapped;
      }
    }
    if (wanted <= j) right = j;
    else if (wanted >= i) left = i;
    else break;
  }
  return values[wanted];
}
