/* The part of OptiX 9.0 (ABI 105) that Dr.Jit and Mitsuba call. An acceleration structure is a scene of
   Embree; a module's ray generation program is translated, its other programs are never run. */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <dlfcn.h>

#include "kernel.h"

typedef void *P;
typedef uint64_t handle_t;

/* ---- Embree 4 ---- */
enum { TRIANGLES = 0, INDICES = 0, VERTICES = 1, UINT3 = 0x5003, FLOAT3 = 0x9003 };
P rtcNewDevice(const char *config);
P rtcNewScene(P device);
P rtcNewGeometry(P device, int type);
P rtcSetNewGeometryBuffer(P geometry, int kind, unsigned slot, int format, size_t stride, size_t n);
void rtcCommitGeometry(P geometry);
void rtcAttachGeometryByID(P scene, P geometry, unsigned id);
void rtcReleaseGeometry(P geometry);
void rtcCommitScene(P scene);
void rtcReleaseScene(P scene);
struct __attribute__((aligned(16))) ray_hit {
  float ox, oy, oz, nearest, dx, dy, dz, time, farthest;
  unsigned mask, id, flags;
  float nx, ny, nz, u, v;
  unsigned primitive, geometry, instance[12];
};
void rtcIntersect1(P scene, struct ray_hit *rayhit, P arguments);

/* ---- what OptiX is asked for ---- */
struct program_group { int kind; struct module *module; };
struct module { void (*run)(const void *params, const void *table, uint32_t grid, uint32_t block); };
struct group_request { int kind; unsigned flags; struct module *module; P others[5]; };
struct triangles {
  const P *vertices;
  unsigned n_vertices;
  int format;
  unsigned stride;
  P indices;
  unsigned n_triangles;
  int index_format;
  unsigned index_stride;
  P transform;
  const unsigned *flags;
  unsigned n_records;
  P record_offsets;
  unsigned offset_size, offset_stride, first_primitive;
};
struct instance {
  float transform[12];
  unsigned id, record_offset, mask, flags;
  handle_t handle;
  unsigned pad[2];
};
struct build_input {
  int type;
  union {
    struct triangles triangles;
    struct { const struct instance *list; unsigned n; } instances;
    char pad[1024];
  };
};
struct emitted { uint64_t *result; int type; };
enum { TRIANGLE_INPUT = 0x2141, INSTANCE_INPUT = 0x2143, RAY_GENERATION = 0x2421, CALLABLES = 0x2425 };
enum { BOTH_SIDES = 1 }; /* flag of an instance */

static int die(const char *what) {
  fprintf(stderr, "cuda_on_cpu: %s\n", what);
  abort();
}

/* ---- programs ---- */
void *compiled(const char *ptx, size_t n, const char *begins, char *name);
static int create_module(P context, P options, P pipeline, const char *ptx, size_t n, char *log, size_t *log_n,
                         struct module **out) {
  char name[256];
  *out = calloc(1, sizeof **out);
  void *library = compiled(ptx, n, ".entry __raygen__", name);
  if (library)
    (*out)->run = dlsym(library, name);
  if (log)
    *log = 0;
  return 0;
}
static int create_module_with_tasks(P context, P options, P pipeline, const char *ptx, size_t n, char *log,
                                    size_t *log_n, struct module **out, P *task) {
  *task = (P) 1;
  return create_module(context, options, pipeline, ptx, n, log, log_n, out);
}
static int compilation_state(P module, int *state) { *state = 0x2364; return 0; }
static int execute_task(P task, P *more, unsigned most, unsigned *n) { *n = 0; return 0; }
static int create_groups(P context, const struct group_request *asked, unsigned n, P options, char *log,
                         size_t *log_n, struct program_group **out) {
  for (unsigned i = 0; i < n; i++) {
    if (asked[i].kind == CALLABLES)
      die("a kernel with calls of functions");
    out[i] = calloc(1, sizeof **out);
    *out[i] = (struct program_group) {asked[i].kind, asked[i].module};
  }
  return 0;
}
static int create_pipeline(P context, P options, P link, struct program_group *const *groups, unsigned n,
                           char *log, size_t *log_n, struct module **out) {
  for (unsigned i = 0; i < n; i++)
    if (groups[i]->kind == RAY_GENERATION)
      *out = groups[i]->module;
  return 0;
}
static int stack_size(P group, unsigned *sizes, P pipeline) { memset(sizes, 0, 7 * 4); return 0; }
static int pack_header(P group, P record) { memset(record, 0, 32); return 0; }
static int launch(struct module *pipeline, P stream, P params, size_t n, P table, unsigned width,
                  unsigned height, unsigned depth) {
  pipeline->run(params, table, 1, width * height * depth);
  return 0;
}

/* ---- acceleration structures ---- */
struct accel {
  P scene; /* of Embree, or 0: instances */
  unsigned n;
  struct instance *instances;
  unsigned *first_primitive; /* of each geometry */
};
static P device;

static void add_triangles(struct accel *accel, unsigned k, const struct triangles *t) {
  if (t->n_records != 1 || t->transform || (t->stride && t->stride != 12))
    die("triangles in a layout that Mitsuba did not use");
  P geometry = rtcNewGeometry(device, TRIANGLES);
  memcpy(rtcSetNewGeometryBuffer(geometry, VERTICES, 0, FLOAT3, 12, t->n_vertices), *t->vertices,
         12ul * t->n_vertices);
  memcpy(rtcSetNewGeometryBuffer(geometry, INDICES, 0, UINT3, 12, t->n_triangles), t->indices,
         12ul * t->n_triangles);
  accel->first_primitive[k] = t->first_primitive;
  rtcCommitGeometry(geometry);
  rtcAttachGeometryByID(accel->scene, geometry, k);
  rtcReleaseGeometry(geometry);
}
static int build_accel(P context, P stream, P options, const struct build_input *in, unsigned n, P temporary,
                       size_t temporary_n, P output, size_t output_n, handle_t *handle, struct emitted *emitted,
                       unsigned n_emitted) {
  struct accel *accel = calloc(1, sizeof *accel);
  device = device ? device : rtcNewDevice("threads=1");
  if (in->type == INSTANCE_INPUT) {
    size_t size = in->instances.n * sizeof(struct instance);
    accel->n = in->instances.n, accel->instances = memcpy(malloc(size), in->instances.list, size);
    for (unsigned k = 0; k < accel->n; k++) {
      const float *m = accel->instances[k].transform;
      for (unsigned i = 0; i < 12; i++)
        if (m[i] != (i % 5 == 0))
          die("an instance that is moved");
      if (!(accel->instances[k].flags & BOTH_SIDES))
        die("an instance whose triangles are seen from one side");
    }
  } else {
    accel->scene = rtcNewScene(device), accel->first_primitive = calloc(n, sizeof(unsigned));
    for (unsigned k = 0; k < n; k++)
      in[k].type == TRIANGLE_INPUT ? add_triangles(accel, k, &in[k].triangles) : die("a shape without triangles");
    rtcCommitScene(accel->scene);
  }
  *handle = (handle_t) accel;
  for (unsigned k = 0; k < n_emitted; k++)
    *emitted[k].result = 256;
  return 0;
}
static int accel_memory(P context, P options, P in, unsigned n, size_t *sizes) {
  sizes[0] = sizes[1] = sizes[2] = 256;
  return 0;
}
static int compact_accel(P context, P stream, handle_t in, P output, size_t n, handle_t *out) {
  *out = in;
  return 0;
}

static int find(const struct accel *accel, const struct instance *instance, struct hit *hit,
                const struct binding_table *table, float *ray, uint32_t offset, uint32_t stride) {
  struct ray_hit found = {ray[0], ray[1], ray[2], ray[6], ray[3], ray[4], ray[5], 0, ray[7], -1};
  found.geometry = -1;
  rtcIntersect1(accel->scene, &found, 0);
  if (found.geometry == -1)
    return 0;
  uint32_t record = (instance ? instance->record_offset : 0) + offset + stride * found.geometry;
  hit->is_hit = 1, hit->distance = ray[7] = found.farthest;
  hit->attributes[0] = bits_f32(found.u), hit->attributes[1] = bits_f32(found.v);
  hit->primitive = found.primitive + accel->first_primitive[found.geometry];
  hit->instance = instance ? instance->id : 0;
  hit->record = (uint64_t) (table->hit_groups + (size_t) table->hit_stride * record + 32);
  return 1;
}
void traverse(struct hit *hit, const struct binding_table *table, uint64_t handle, const float *given,
              uint32_t offset, uint32_t stride) {
  const struct accel *accel = (P) handle;
  float ray[8];
  memcpy(ray, given, sizeof ray);
  memset(hit, 0, sizeof *hit), hit->distance = ray[7];
  for (int i = 0; i < 6; i++)
    if (ray[i] - ray[i] != 0)
      return;
  if (accel->scene)
    find(accel, 0, hit, table, ray, offset, stride);
  for (unsigned k = 0; k < accel->n; k++)
    find((P) accel->instances[k].handle, accel->instances + k, hit, table, ray, offset, stride);
}

/* ---- the table of functions ---- */
static const char *error_text(int error) { return "error of cuda_on_cpu"; }
static int nothing(void) { return 0; }
static int new_context(P cuda, P options, P *out) { *out = (P) 1; return 0; }
static int property(P context, int which, P value, size_t n) { memset(value, 0, n); return 0; }
static int missing(void) { return die("a function of OptiX that nobody called before"); }

enum { N_FUNCTIONS = 52 };
int optixQueryFunctionTable(int abi, unsigned n, P options, P values, P *table, size_t size) {
  if (abi != 105 || size > N_FUNCTIONS * sizeof *table)
    return 7801; /* unsupported */
  for (size_t i = 0; i < size / sizeof *table; i++)
    table[i] = missing;
  static const struct { int at; P function; } ours[] = {
    {0, error_text}, {1, error_text}, {2, new_context}, {3, nothing}, {4, property}, {5, nothing},
    {6, nothing}, {7, nothing}, {12, create_module}, {13, create_module_with_tasks},
    {14, compilation_state}, {15, nothing}, {17, execute_task}, {18, create_groups}, {19, nothing},
    {20, stack_size}, {21, create_pipeline}, {22, nothing}, {23, nothing}, {24, accel_memory},
    {25, build_accel}, {29, compact_accel}, {40, pack_header}, {41, launch}};
  for (size_t i = 0; i < sizeof ours / sizeof *ours; i++)
    table[ours[i].at] = ours[i].function;
  return 0;
}
