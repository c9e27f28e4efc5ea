// Sums light layers and applies the tone curve on the GPU: transport/develop/tone_mapping.py in GLSL.

const MOST_LAYERS = 128;

const VERTEX = `#version 300 es
void main() {
  // One triangle that covers the picture.
  gl_Position = vec4(float((gl_VertexID & 1) * 4 - 1), float((gl_VertexID & 2) * 2 - 1), 0.0, 1.0);
}`;

const LAYERS = `#version 300 es
precision highp float;
precision highp sampler2DArray;
uniform sampler2DArray u_light;
uniform vec3 u_factor[${MOST_LAYERS}];
uniform int u_layers, u_step;
uniform float u_height;
out vec4 colour;

// Of every step-th pixel, row 0 = top.
vec3 summed() {
  ivec2 at = ivec2(gl_FragCoord.xy) * u_step + u_step / 2;
  ivec2 pixel = ivec2(at.x, int(u_height) - 1 - at.y);
  vec3 sum = vec3(0.0);
  for (int k = 0; k < u_layers; k++) {
    sum += texelFetch(u_light, ivec3(pixel, k), 0).rgb * u_factor[k];
  }
  return sum;
}`;

const TONE = `
uniform float u_exposure, u_white, u_knee, u_pale, u_contrast;
uniform vec3 u_gains, u_veil;
uniform bool u_released;

const float SHOULDER = 0.6;

vec3 rolledOff(vec3 rgb) {
  float top = max(max(rgb.r, rgb.g), rgb.b);
  float soft = SHOULDER + u_knee * log(1.0 + max(top - SHOULDER, 0.0) / u_knee);
  float target = top > SHOULDER ? min(soft, 1.0) : top;
  vec3 scaled = rgb * (top > 0.0 ? target / top : 1.0);
  float level = dot(rgb, vec3(0.2126, 0.7152, 0.0722));
  float fade = clamp(log2(max(level, 1.0)) * u_pale, 0.0, 1.0);
  return mix(scaled, vec3(target), fade);
}

vec3 reinhard(vec3 rgb) {
  float luminance = dot(rgb, vec3(0.212671, 0.715160, 0.072169));
  if (u_white <= 0.0) return rgb;
  float scaled = luminance * u_exposure;
  float mapped = scaled * (1.0 + scaled / (u_white * u_white)) / (1.0 + scaled);
  return rgb * (luminance > 0.0 ? mapped / luminance : 0.0);
}

vec3 curved(vec3 rgb) {
  float luma = dot(rgb, vec3(0.299, 0.587, 0.114));
  if (u_contrast == 1.0 || luma <= 0.0) return rgb;
  float light = pow(luma, u_contrast), dark = pow(max(1.0 - luma, 0.0), u_contrast);
  float tone = light / (light + dark);
  return clamp(tone + (rgb - luma) * min(tone / luma, 1.0), 0.0, 1.0);
}

vec4 toned(vec3 light) {
  vec3 rgb = max(light * u_gains, 0.0);
  vec3 linear = clamp(u_released ? reinhard(rgb) : rolledOff(rgb * u_exposure + u_veil), 0.0, 1.0);
  vec3 low = 12.92 * linear, high = 1.055 * pow(linear, vec3(1.0 / 2.4)) - 0.055;
  vec3 encoded = mix(high, low, vec3(lessThanEqual(linear, vec3(0.0031308))));
  return vec4(u_released ? encoded : curved(clamp(encoded, 0.0, 1.0)), 1.0);
}`;

// All layers, toned: the picture as `relight` writes it.
const PICTURE = `${LAYERS}${TONE}
void main() { colour = toned(summed()); }`;

// Sum of the layers that no moving control changes; a half float holds 65504.
const SUM = `${LAYERS}
void main() { colour = vec4(min(summed(), 60000.0), 1.0); }`;

// What is still, and what moves times its factor.
const MOVING = `#version 300 es
precision highp float;
uniform sampler2D u_still, u_moving;
uniform vec3 u_move;
uniform float u_scale;
out vec4 colour;
${TONE}
void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  colour = toned((texelFetch(u_still, at, 0).rgb + texelFetch(u_moving, at, 0).rgb * u_move) * u_scale);
}`;

export class LightGl {
  // layers: Uint16Array of half floats each, (H, W, 3).
  constructor(canvas, width, height, layers) {
    if (layers.length > MOST_LAYERS) throw new Error(`more than ${MOST_LAYERS} lamps in one view`);
    const gl = canvas.getContext("webgl2", { alpha: false, antialias: false, depth: false, stencil: false });
    if (!gl) throw new Error("this browser has no WebGL 2");
    Object.assign(this, { gl, canvas, width, height });
    this.picture = programOf(gl, PICTURE);
    // Sums are kept where half floats can be drawn into: nearly everywhere.
    const hasHalf = gl.getExtension("EXT_color_buffer_float") || gl.getExtension("EXT_color_buffer_half_float");
    this.sum = hasHalf && programOf(gl, SUM);
    this.moving = hasHalf && programOf(gl, MOVING);
    gl.bindTexture(gl.TEXTURE_2D_ARRAY, gl.createTexture());
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 2);
    gl.texStorage3D(gl.TEXTURE_2D_ARRAY, 1, gl.RGB16F, width, height, layers.length);
    layers.forEach((halves, k) => gl.texSubImage3D(gl.TEXTURE_2D_ARRAY, 0, 0, 0, k, width, height, 1, gl.RGB, gl.HALF_FLOAT, halves));
    nearest(gl, gl.TEXTURE_2D_ARRAY);
  }

  // factors: Float32Array, 3 of each layer, the packet's scale taken out. step: draw every step-th pixel.
  draw(factors, tone, isReleased, step) {
    this.#setSize(step);
    this.gl.useProgram(this.picture.program);
    this.#setLayers(this.picture.at, factors, step);
    this.#setTone(this.picture.at, tone, isReleased);
    this.gl.drawArrays(this.gl.TRIANGLES, 0, 3);
  }

  // Keep two sums of layers, of what stays and of what moves; false where this machine cannot.
  hold(still, moving, step) {
    if (!this.sum) return false;
    const { gl } = this;
    this.#setSize(step);
    gl.useProgram(this.sum.program);
    this.held = [still, moving].map((factors, k) => {
      const target = this.held?.[k] ?? { texture: gl.createTexture(), frame: gl.createFramebuffer() };
      gl.activeTexture(gl.TEXTURE1 + k);
      gl.bindTexture(gl.TEXTURE_2D, target.texture);
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA16F, this.canvas.width, this.canvas.height, 0, gl.RGBA, gl.HALF_FLOAT, null);
      nearest(gl, gl.TEXTURE_2D);
      gl.bindFramebuffer(gl.FRAMEBUFFER, target.frame);
      gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, target.texture, 0);
      this.#setLayers(this.sum.at, factors, step);
      gl.drawArrays(gl.TRIANGLES, 0, 3);
      return target;
    });
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.activeTexture(gl.TEXTURE0);
    return true;
  }

  // The kept sums, what moves times a factor of each colour; scale: what the packet's is taken out by.
  drawHeld(factor, scale, tone, isReleased, step) {
    const { gl } = this;
    this.#setSize(step);
    const { program, at } = this.moving;
    gl.useProgram(program);
    gl.uniform1i(at.u_still, 1);
    gl.uniform1i(at.u_moving, 2);
    gl.uniform3fv(at.u_move, factor);
    gl.uniform1f(at.u_scale, scale);
    this.#setTone(at, tone, isReleased);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  #setSize(step) {
    const width = Math.floor(this.width / step), height = Math.floor(this.height / step);
    if (this.canvas.width !== width || this.canvas.height !== height) Object.assign(this.canvas, { width, height });
    this.gl.viewport(0, 0, width, height);
  }

  #setLayers(at, factors, step) {
    const { gl } = this;
    gl.uniform3fv(at.u_factor, factors);
    gl.uniform1i(at.u_layers, factors.length / 3);
    gl.uniform1i(at.u_step, step);
    gl.uniform1f(at.u_height, this.height);
  }

  #setTone(at, { gains, exposure, veil, white, knee, pale, contrast }, isReleased) {
    const { gl } = this;
    gl.uniform1f(at.u_exposure, exposure);
    gl.uniform1f(at.u_white, white);
    gl.uniform1f(at.u_knee, knee);
    gl.uniform1f(at.u_pale, pale);
    gl.uniform1f(at.u_contrast, contrast);
    gl.uniform3f(at.u_veil, ...veil);
    gl.uniform3fv(at.u_gains, gains);
    gl.uniform1i(at.u_released, isReleased ? 1 : 0);
  }
}

function nearest(gl, kind) {
  gl.texParameteri(kind, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
  gl.texParameteri(kind, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
}

// A program and the places of its uniforms, which are asked for once.
function programOf(gl, fragment) {
  const program = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader) || "the shader fails");
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program) || "the program fails");
  const at = {};
  for (let k = gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS) - 1; k >= 0; k--) {
    const name = gl.getActiveUniform(program, k).name.replace("[0]", "");
    at[name] = gl.getUniformLocation(program, name);
  }
  return { program, at };
}
