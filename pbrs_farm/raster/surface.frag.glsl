// One surface, lit in linear light. Written: premultiplied linear colour in 0..1, coverage in alpha.
// MODE_DL or MODE_IL chooses the lights; GLOSSY, TEXTURED, ALPHA_CUTOUT, TRANSPARENT, WITH_SPOTS and
// WITH_LINES leave out what is not needed.

in vec3 position;
in vec3 normal;
in vec2 uv;

layout(std140) uniform Material {
    vec4 diffuse;   // linear rgb, opacity
    vec4 specular;  // linear rgb, Phong exponent
    vec4 emission;  // linear rgb a lamp's part shows under its own light, 0
    vec4 flags;     // 1 = window pane, cutoff of alpha, 0, 0
};

struct Light {
    vec4 position;   // xyz, form: 0 point, 1 spot, 2 line
    vec4 intensity;  // rgb, exponent of the cosine of a spot
    vec4 direction;  // unit, cosine of the half angle of a spot
    vec4 end;        // other end of a line, its length
};

#ifdef MODE_IL
layout(std140) uniform Lights {
    vec4 n_lights;   // how many of them hold, share of light that passes through, 0, 0
    // Four vec4 a light, not Light[]: Mesa unrolls a loop over an array of known length, and an
    // unrolled loop of a CPU's shader is paid in full however few lights there are.
    vec4 lights[4 * N_LIGHTS];
};
uniform float white_per_lx;
uniform sampler2DMS prepass_depth;  // depth of what each sample sees, drawn before
#endif

uniform sampler2D diffuse_texture;
uniform vec3 eye;
uniform vec3 forward;
uniform vec3 sky;

out vec4 colour;

// Light reflected from one direction: diffuse share and Blinn's highlight, both without colour.
vec2 reflected(vec3 n, vec3 to_light, vec3 to_eye) {
    float cosine = max(dot(n, to_light), 0.0);
#ifdef GLOSSY
    vec3 halfway = to_light + to_eye;
    float peak = max(dot(n, halfway), 0.0) * inversesqrt(max(dot(halfway, halfway), 1e-8));
    return vec2(cosine, cosine > 0.0 ? pow(peak, specular.w) : 0.0);
#else
    return vec2(cosine, 0.0);
#endif
}

#ifdef MODE_IL
// Incident illuminance I / d^2 at p of one light, lx times colour; sets to_light, a unit vector.
vec3 incident(Light light, vec3 p, out vec3 to_light) {
    vec3 d = light.position.xyz - p;
    float squared = dot(d, d);
    float falloff = 1.0 / (squared + SOFTENING2);
#ifdef WITH_LINES
    if (light.position.w == 2.0) {
        // The mean of 1 / d^2 along the line, seen from its nearest point.
        vec3 along = (light.end.xyz - light.position.xyz) / max(light.end.w, 1e-6);
        float foot = -dot(d, along);
        vec3 off = d + along * foot;
        float h = sqrt(dot(off, off) + SOFTENING2);
        falloff = (atan(light.end.w - foot, h) + atan(foot, h)) / (h * max(light.end.w, 1e-6));
        d += along * clamp(foot, 0.0, light.end.w);
        squared = dot(d, d);
    }
#endif
    to_light = d * inversesqrt(max(squared, 1e-12));
#ifdef WITH_SPOTS
    if (light.position.w == 1.0) {
        float cosine = dot(-to_light, light.direction.xyz);
        falloff *= cosine >= light.direction.w ? pow(max(cosine, 0.0), light.intensity.w) : 0.0;
    }
#endif
    return light.intensity.rgb * falloff;
}

// Whether every sample of the pixel lies behind the depth pre-pass: a software renderer shades what
// it then hides, and lighting it would cost as much as lighting what is visible.
bool is_occluded() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    float farthest = 0.0;
    for (int i = 0; i < N_SAMPLES; ++i) {
        farthest = max(farthest, texelFetch(prepass_depth, pixel, i).r);
    }
    return gl_FragCoord.z > farthest + fwidth(gl_FragCoord.z);
}

// Lamp light varies a hundredfold within a room: WHITE times a lit floor's light is just white.
vec3 tone_mapped(vec3 x) {
    return x * (1.0 + x / (WHITE * WHITE)) / (1.0 + x);
}
#endif

void main() {
#ifdef TEXTURED
    vec4 texel = texture(diffuse_texture, uv);
#else
    const vec4 texel = vec4(1.0);
#endif
#ifdef ALPHA_CUTOUT
#ifdef TEXTURED
    // Alpha is not filtered over the pixel, as labels' is not: far leaves would melt away.
    float alpha = textureLod(diffuse_texture, uv, 0.0).a;
#else
    const float alpha = 1.0;
#endif
    if (alpha < flags.y) discard;
#endif
    vec3 to_eye = normalize(eye - position);
    vec3 n = normalize(normal);
    n = dot(n, to_eye) < 0.0 ? -n : n;

    // Cube faces share a headlight at the eye: forward is 0.
    vec3 to_head = forward == vec3(0.0) ? to_eye : -forward;
    vec3 diffuse_light = vec3(0.0);
    vec3 specular_light = vec3(0.0);
#ifdef MODE_DL
    vec2 head = reflected(n, to_head, to_eye);
    vec2 key = reflected(n, vec3(3.0, 4.0, 5.0) * inversesqrt(50.0), to_eye);
    vec2 fill = reflected(n, vec3(-3.0, -2.0, -3.0) * inversesqrt(22.0), to_eye);
    diffuse_light = vec3(DL_SCALE * (0.5 * head.x + key.x + 0.5 * fill.x));
    specular_light = vec3(DL_SCALE * (head.y + key.y + 0.5 * fill.y));
#else
    diffuse_light = vec3(IL_HEADLIGHT * reflected(n, to_head, to_eye).x);
    int count = is_occluded() ? 0 : int(n_lights.x);
    for (int i = 0; i < count; ++i) {
        Light light = Light(lights[4 * i], lights[4 * i + 1], lights[4 * i + 2], lights[4 * i + 3]);
        vec3 to_light;
        vec3 lx = white_per_lx * incident(light, position, to_light);
        vec2 got = reflected(n, to_light, to_eye);
        diffuse_light += lx * (got.x + n_lights.y * abs(dot(n, to_light)));
        specular_light += lx * got.y;
    }
#endif

    vec3 body = diffuse.rgb * texel.rgb * diffuse_light;
    vec3 highlight = specular.rgb * specular_light;
#ifdef MODE_IL
    body = tone_mapped(body) + emission.rgb;
#endif

#ifdef TRANSPARENT
    // Schlick's reflectance of a thin surface; it mirrors the sky.
    float fresnel = 0.04 + 0.96 * pow(1.0 - abs(dot(n, to_eye)), 5.0);
    vec3 mirrored = sky * (flags.x > 0.0 ? PANE_MIRROR : GLASS_MIRROR) * fresnel;
    float opacity = flags.x > 0.0 ? min(diffuse.a, PANE_OPACITY) : diffuse.a;
    colour = vec4(body * opacity + highlight + mirrored, clamp(opacity + fresnel * 0.5, 0.0, 1.0));
#else
    colour = vec4(body + highlight, 1.0);
#endif
    colour.rgb = clamp(colour.rgb, 0.0, 1.0);
}
