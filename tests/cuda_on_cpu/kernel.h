/* What a translated kernel is compiled with. */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <xmmintrin.h>

struct hit {
  uint32_t is_hit;
  float distance;
  uint32_t attributes[8], primitive, instance;
  uint64_t record;
};

/* OptixShaderBindingTable */
struct binding_table {
  char *ray_generation, *exception, *miss;
  unsigned miss_stride, miss_count;
  char *hit_groups;
  unsigned hit_stride, hit_count;
};

/* A kernel, and how all its threads are run: by grid x block. */
typedef void (*thread_t)(const char *params, const struct binding_table *table, uint32_t ctaid,
                         uint32_t ntid, uint32_t tid, uint32_t nctaid);
void run_threads(thread_t thread, const char *params, const struct binding_table *table,
                 uint32_t grid, uint32_t block);

/* ray: origin, direction, least and largest distance. */
void traverse(struct hit *hit, const struct binding_table *table, uint64_t scene, const float *ray,
              uint32_t sbt_offset, uint32_t sbt_stride);

static inline float f32_bits(uint32_t x) { float y; memcpy(&y, &x, 4); return y; }
static inline uint32_t bits_f32(float x) { uint32_t y; memcpy(&y, &x, 4); return y; }
static inline double f64_bits(uint64_t x) { double y; memcpy(&y, &x, 8); return y; }
static inline uint64_t bits_f64(double x) { uint64_t y; memcpy(&y, &x, 8); return y; }

/* Conversions saturate, and a NaN becomes 0. */
static inline uint32_t to_u32(float x) {
  return x != x || x <= 0 ? 0 : x >= 4294967296.0f ? 0xffffffffu : (uint32_t) x;
}
static inline int32_t to_s32(float x) {
  return x != x ? 0 : x <= -2147483648.0f ? INT32_MIN : x >= 2147483648.0f ? INT32_MAX : (int32_t) x;
}

static inline float min_num(float a, float b) { return fminf(a, b); }
static inline float max_num(float a, float b) { return fmaxf(a, b); }
static inline float min_nan(float a, float b) { return a != a || b != b ? NAN : a < b ? a : b; }
static inline float max_nan(float a, float b) { return a != a || b != b ? NAN : a > b ? a : b; }

static inline uint32_t reversed(uint32_t x) {
  uint32_t y = 0;
  for (int i = 0; i < 32; i++, x >>= 1)
    y = y << 1 | (x & 1);
  return y;
}

static inline float add_f32(float *place, float value) {
  uint32_t *bits = (uint32_t *) place, old = __atomic_load_n(bits, __ATOMIC_RELAXED);
  while (!__atomic_compare_exchange_n(bits, &old, bits_f32(f32_bits(old) + value), 1,
                                      __ATOMIC_RELAXED, __ATOMIC_RELAXED)) {
  }
  return f32_bits(old);
}
