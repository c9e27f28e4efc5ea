// One surface, lit in linear light. Written: premultiplied linear colour in 0..1, coverage in alpha.
// MODE_DL or MODE_IL chooses the lights; GLOSSY, TEXTURED, CUTOUT, SEE_THROUGH, WITH_SPOTS and
// WITH_LINES leave out what is not needed.

in vec3 position;
in vec3 normal;
in vec2 uv;

layout(std140) uniform Look {
    vec4 diffuse;   // linear rgb, opacity
    vec4 specular;  // linear rgb, Phong exponent
    vec4 glow;      // linear rgb a lamp's part shows under its own light, 0
    vec4 flags;     // 1 = window pane, 0, 0, 0
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
uniform sampler2DMS nearest;  // depth of what each sample sees, drawn before
#endif

uniform sampler2D picture;
uniform vec3 eye;
uniform vec3 forward;
uniform vec3 sky;

out vec4 colour;

// Light that arrives from one direction: diffuse share and Blinn's highlight, both without colour.
vec2 received(vec3 n, vec3 to_light, vec3 to_eye) {
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
// I / d^2 towards p of one light in lx times colour; to_light is set to the unit direction.
vec3 arriving(Light light, vec3 p, out vec3 to_light) {
    vec3 d = light.position.xyz - p;
    float squared = dot(d, d);
    float falloff = 1.0 / (squared + SOFT2);
#ifdef WITH_LINES
    if (light.position.w == 2.0) {
        // The mean of 1 / d^2 along the line, seen from its nearest point.
        vec3 along = (light.end.xyz - light.position.xyz) / max(light.end.w, 1e-6);
        float foot = -dot(d, along);
        vec3 off = d + along * foot;
        float h = sqrt(dot(off, off) + SOFT2);
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

// A software renderer shades what it then hides: no light is added where nothing will be seen.
bool is_hidden() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    float farthest = 0.0;
    for (int i = 0; i < N_SAMPLES; ++i) {
        farthest = max(farthest, texelFetch(nearest, pixel, i).r);
    }
    return gl_FragCoord.z > farthest + fwidth(gl_FragCoord.z);
}

// Lamp light varies a hundredfold within a room: WHITE times a lit floor's light is just white.
vec3 compressed(vec3 x) {
    return x * (1.0 + x / (WHITE * WHITE)) / (1.0 + x);
}
#endif

void main() {
#ifdef TEXTURED
    vec4 texel = texture(picture, uv);
#else
    const vec4 texel = vec4(1.0);
#endif
#ifdef CUTOUT
    if (texel.a < 0.5) discard;
#endif
    vec3 to_eye = normalize(eye - position);
    vec3 n = normalize(normal);
    n = dot(n, to_eye) < 0.0 ? -n : n;

    vec3 matt = vec3(0.0);
    vec3 gloss = vec3(0.0);
#ifdef MODE_DL
    vec2 head = received(n, -forward, to_eye);
    vec2 key = received(n, vec3(3.0, 4.0, 5.0) * inversesqrt(50.0), to_eye);
    vec2 fill = received(n, vec3(-3.0, -2.0, -3.0) * inversesqrt(22.0), to_eye);
    matt = vec3(DL_SCALE * (0.5 * head.x + key.x + 0.5 * fill.x));
    gloss = vec3(DL_SCALE * (head.y + key.y + 0.5 * fill.y));
#else
    matt = vec3(IL_HEADLIGHT * received(n, -forward, to_eye).x);
    int count = is_hidden() ? 0 : int(n_lights.x);
    for (int i = 0; i < count; ++i) {
        Light light = Light(lights[4 * i], lights[4 * i + 1], lights[4 * i + 2], lights[4 * i + 3]);
        vec3 to_light;
        vec3 lx = white_per_lx * arriving(light, position, to_light);
        vec2 got = received(n, to_light, to_eye);
        matt += lx * (got.x + n_lights.y * abs(dot(n, to_light)));
        gloss += lx * got.y;
    }
#endif

    vec3 body = diffuse.rgb * texel.rgb * matt;
    vec3 highlight = specular.rgb * gloss;
#ifdef MODE_IL
    body = compressed(body) + glow.rgb;
#endif

#ifdef SEE_THROUGH
    // Schlick's reflectance of a thin sheet; the sky stands for what it mirrors.
    float fresnel = 0.04 + 0.96 * pow(1.0 - abs(dot(n, to_eye)), 5.0);
    vec3 mirrored = sky * (flags.x > 0.0 ? PANE_MIRROR : GLASS_MIRROR) * fresnel;
    float opacity = flags.x > 0.0 ? min(diffuse.a, PANE_OPACITY) : diffuse.a;
    colour = vec4(body * opacity + highlight + mirrored, clamp(opacity + fresnel * 0.5, 0.0, 1.0));
#else
    colour = vec4(body + highlight, 1.0);
#endif
    colour.rgb = clamp(colour.rgb, 0.0, 1.0);
}
