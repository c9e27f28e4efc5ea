// Sums light layers and applies the tone curve on the GPU: transport/develop/tone_mapping.py in GLSL.

const MOST_LAYERS = 128;

const VERTEX = `#version 300 es
void main() {
  // One triangle that covers the picture.
  gl_Position = vec4(float((gl_VertexID & 1) * 4 - 1), float((gl_VertexID & 2) * 2 - 1), 0.0, 1.0);
}`;

const FRAGMENT = `#version 300 es
precision highp float;
precision highp sampler2DArray;
uniform sampler2DArray u_light;
uniform vec3 u_factor[${MOST_LAYERS}];
uniform int u_layers;
uniform float u_height, u_exposure, u_white;
uniform vec3 u_gains;
uniform bool u_released;
out vec4 colour;

const float SHOULDER = 0.6, WHITE = 16.0;

vec3 rolledOff(vec3 rgb) {
  float top = max(max(rgb.r, rgb.g), rgb.b);
  float over = max(top - SHOULDER, 0.0), room = 1.0 - SHOULDER;
  float rise = log(1.0 + over / room) / log(1.0 + (WHITE - SHOULDER) / room);
  float soft = SHOULDER + room * max(rise, over / (over + room) * (1.0 - 1.0 / WHITE));
  float target = top > SHOULDER ? min(soft, 1.0) : top;
  vec3 scaled = rgb * (top > 0.0 ? target / top : 1.0);
  float fade = clamp(log2(max(top, 1e-9) / 2.0) / 5.0, 0.0, 1.0);
  return mix(scaled, vec3(target), fade);
}

vec3 reinhard(vec3 rgb) {
  float luminance = dot(rgb, vec3(0.212671, 0.715160, 0.072169));
  if (u_white <= 0.0) return rgb;
  float scaled = luminance * u_exposure;
  float mapped = scaled * (1.0 + scaled / (u_white * u_white)) / (1.0 + scaled);
  return rgb * (luminance > 0.0 ? mapped / luminance : 0.0);
}

void main() {
  ivec2 pixel = ivec2(int(gl_FragCoord.x), int(u_height) - 1 - int(gl_FragCoord.y));
  vec3 sum = vec3(0.0);
  for (int k = 0; k < u_layers; k++) {
    sum += texelFetch(u_light, ivec3(pixel, k), 0).rgb * u_factor[k];
  }
  vec3 rgb = max(sum * u_gains, 0.0);
  vec3 linear = clamp(u_released ? reinhard(rgb) : rolledOff(rgb * u_exposure), 0.0, 1.0);
  vec3 low = 12.92 * linear, high = 1.055 * pow(linear, vec3(1.0 / 2.4)) - 0.055;
  colour = vec4(mix(high, low, vec3(lessThanEqual(linear, vec3(0.0031308)))), 1.0);
}`;

export class LightGl {
  // layers: Uint16Array of half floats each, (H, W, 3).
  constructor(canvas, width, height, layers) {
    if (layers.length > MOST_LAYERS) throw new Error(`more than ${MOST_LAYERS} lamps in one view`);
    canvas.width = width;
    canvas.height = height;
    const gl = canvas.getContext("webgl2", { alpha: false, antialias: false, preserveDrawingBuffer: true });
    if (!gl) throw new Error("this browser has no WebGL 2");
    this.gl = gl;
    this.program = programOf(gl);
    gl.useProgram(this.program);
    const texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D_ARRAY, texture);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 2);
    gl.texStorage3D(gl.TEXTURE_2D_ARRAY, 1, gl.RGB16F, width, height, layers.length);
    layers.forEach((halves, k) => gl.texSubImage3D(gl.TEXTURE_2D_ARRAY, 0, 0, 0, k, width, height, 1, gl.RGB, gl.HALF_FLOAT, halves));
    gl.texParameteri(gl.TEXTURE_2D_ARRAY, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
    gl.texParameteri(gl.TEXTURE_2D_ARRAY, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
    gl.viewport(0, 0, width, height);
    this.height = height;
  }

  // factors: Float32Array, 3 of each layer, the packet's scale taken out.
  draw(factors, { gains, exposure, white }, isReleased) {
    const { gl } = this;
    const at = (name) => gl.getUniformLocation(this.program, name);
    gl.uniform3fv(at("u_factor"), factors);
    gl.uniform1i(at("u_layers"), factors.length / 3);
    gl.uniform1f(at("u_height"), this.height);
    gl.uniform1f(at("u_exposure"), exposure);
    gl.uniform1f(at("u_white"), white);
    gl.uniform3fv(at("u_gains"), gains);
    gl.uniform1i(at("u_released"), isReleased ? 1 : 0);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }
}

function programOf(gl) {
  const program = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader) || "the shader fails");
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program) || "the program fails");
  return program;
}
