/* The part of CUDA's driver API that Dr.Jit calls. Device memory is the host's; a launch has ended
   when it returns. Dr.Jit's own kernels of reductions and the like are written out here, its compiled
   ones are translated. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <xmmintrin.h>

#include "kernel.h"

typedef void *P;
struct module { void *library; };
struct function {
  char name[256];
  void (*run)(const void *params, const void *table, uint32_t grid, uint32_t block);
};

static void die(const char *what, const char *name) {
  fprintf(stderr, "cuda_on_cpu: %s %s\n", what, name);
  abort();
}

/* ---- the one device ---- */
int cuInit(unsigned flags) { return 0; }
int cuDeviceGetCount(int *n) { *n = 1; return 0; }
int cuDeviceGet(int *device, int i) { *device = i; return 0; }
int cuDriverGetVersion(int *version) { *version = 12080; return 0; }
int cuDeviceGetName(char *name, int n, int device) { snprintf(name, n, "CUDA on the CPU"); return 0; }
int cuDeviceTotalMem_v2(size_t *n, int device) { *n = (size_t) 16 << 30; return 0; }
int cuDeviceTotalMem(size_t *n, int device) { return cuDeviceTotalMem_v2(n, device); }
int cuDevicePrimaryCtxRetain(P *context, int device) { *context = (P) 1; return 0; }
int cuDeviceGetAttribute(int *value, int attribute, int device) {
  /* multiprocessors, unified addressing, compute capability 9.0, shared memory, memory pools */
  static const int known[][2] = {{16, 132}, {41, 1}, {75, 9}, {76, 0}, {97, 232448}, {115, 1}};
  *value = 0;
  for (size_t i = 0; i < sizeof known / sizeof *known; i++)
    if (known[i][0] == attribute)
      *value = known[i][1];
  return 0;
}

/* ---- memory ---- */
static int allocate(P *p, size_t n) {
  n = (n + 4095) / 4096 * 4096; /* compress() writes a little past what it was given */
  *p = aligned_alloc(256, n ? n : 4096);
  return *p ? 0 : 2;
}
int cuMemAlloc(P *p, size_t n) { return allocate(p, n); }
int cuMemAlloc_v2(P *p, size_t n) { return allocate(p, n); }
int cuMemAllocHost(P *p, size_t n) { return allocate(p, n); }
int cuMemAllocHost_v2(P *p, size_t n) { return allocate(p, n); }
int cuMemAllocAsync(P *p, size_t n, P stream) { return allocate(p, n); }
int cuMemFree(P p) { free(p); return 0; }
int cuMemFree_v2(P p) { free(p); return 0; }
int cuMemFreeHost(P p) { free(p); return 0; }
int cuMemFreeAsync(P p, P stream) { free(p); return 0; }
int cuMemcpy(P to, P from, size_t n) { memcpy(to, from, n); return 0; }
int cuMemcpyAsync(P to, P from, size_t n, P stream) { memcpy(to, from, n); return 0; }
int cuMemsetD8Async(P p, uint8_t x, size_t n, P stream) { memset(p, x, n); return 0; }
int cuMemsetD16Async(uint16_t *p, uint16_t x, size_t n, P stream) { while (n--) *p++ = x; return 0; }
int cuMemsetD32Async(uint32_t *p, uint32_t x, size_t n, P stream) { while (n--) *p++ = x; return 0; }
int cuPointerGetAttribute(int *value, int attribute, P p) { *value = 0; return 0; }

/* ---- streams and events: everything has happened already ---- */
int cuStreamCreate(P *stream, unsigned flags) { *stream = (P) 2; return 0; }
int cuEventCreate(P *event, unsigned flags) { *event = (P) 3; return 0; }
int cuEventElapsedTime(float *ms, P a, P b) { *ms = 0; return 0; }
int cuLaunchHostFunc(P stream, void (*call)(void *), void *data) { call(data); return 0; }
int cuOccupancyMaxPotentialBlockSize(int *grid, int *block, P f, P g, size_t n, int limit) {
  *grid = 132, *block = 256;
  return 0;
}
int cuGetErrorName(int error, const char **text) { *text = "error"; return 0; }
int cuGetErrorString(int error, const char **text) { *text = "error of cuda_on_cpu"; return 0; }

/* ---- modules ---- */
/* The library of the first entry of a PTX text whose line begins as given; 0 = there is none. */
void *compiled(const char *ptx, size_t n, const char *begins, char *name) {
  const char *entry = memmem(ptx, n, begins, strlen(begins));
  if (!entry)
    return 0;
  entry += strlen(".entry ");
  size_t length = strcspn(entry, "(");
  memcpy(name, entry, length), name[length] = 0;
  const char *out = getenv("CUDA_ON_CPU");
  char path[512], part[512], command[4096];
  snprintf(path, sizeof path, "%s/%s.so", out, name);
  void *library = dlopen(path, RTLD_NOW);
  if (library)
    return library;
  /* Several processes may want it at once: each writes files of its own and renames the last. */
  snprintf(part, sizeof part, "%s/%s.%d", out, name, (int) getpid());
  snprintf(command, sizeof command, "%s.ptx", part);
  FILE *file = fopen(command, "w");
  fwrite(ptx, 1, n, file), fclose(file);
  snprintf(command, sizeof command,
           "%s '%s.ptx' '%s.c' && gcc -w -O1 -mfma -I'%s' -shared -fPIC -o '%s.so' '%s.c' "
           "'%s/libcuda_on_cpu.so' '%s/liboptix_on_cpu.so' -lm && mv '%s.so' '%s' && rm '%s.ptx' '%s.c'",
           getenv("CUDA_ON_CPU_TRANSLATE"), part, part, getenv("CUDA_ON_CPU_INCLUDE"), part, part,
           out, out, part, path, part, part);
  if (system(command) || !(library = dlopen(path, RTLD_NOW)))
    die("cannot translate", name);
  return library;
}
int cuModuleLoadDataEx(struct module **module, const char *ptx, unsigned n, P options, P values) {
  char name[256];
  *module = calloc(1, sizeof **module);
  (*module)->library = compiled(ptx, strlen(ptx), ".entry drjit_", name);
  return 0;
}
int cuModuleLoadData(struct module **module, const char *ptx) {
  return cuModuleLoadDataEx(module, ptx, 0, 0, 0);
}
int cuModuleGetFunction(struct function **function, struct module *module, const char *name) {
  *function = calloc(1, sizeof **function);
  snprintf((*function)->name, 256, "%s", name);
  if (module->library)
    (*function)->run = dlsym(module->library, name);
  return 0;
}

/* ---- Dr.Jit's own kernels ---- */
struct reduction {
  const void *in;
  void *out;
  uint32_t size, block, chunks_a_block, n_chunks;
};
#define REDUCED(T) { \
    const T *in = r->in; \
    T total = in[first]; \
    for (size_t i = first + 1; i < end; i++) \
      total = !strcmp(op, "add") ? total + in[i] : !strcmp(op, "mul") ? total * in[i] \
            : !strcmp(op, "min") ? (in[i] < total ? in[i] : total) \
            : (in[i] > total ? in[i] : total); \
    ((T *) r->out)[c] = total; }
static void block_reduce(const char *name, const struct reduction *r) {
  char op[16] = "", type[16] = "";
  sscanf(name, "block_reduce_%15[a-z]_%15[a-z0-9]", op, type);
  size_t vector = strstr(name, "_vec_") ? (strstr(type, "64") ? 2 : 4) : 1;
  size_t chunk = atoi(strrchr(name, '_') + 1), size = r->size * vector, block = r->block * vector;
  if (strcmp(op, "add") && strcmp(op, "mul") && strcmp(op, "min") && strcmp(op, "max"))
    die("no reduction", name);
  for (size_t c = 0; c < r->n_chunks; c++) {
    size_t b = c / r->chunks_a_block, first = b * block + c % r->chunks_a_block * chunk;
    size_t end = first + chunk;
    end = end > (b + 1) * block ? (b + 1) * block : end;
    end = end > size ? size : end;
    if (!strcmp(type, "f32")) REDUCED(float)
    else if (!strcmp(type, "f64")) REDUCED(double)
    else if (!strcmp(type, "u32")) REDUCED(uint32_t)
    else if (!strcmp(type, "i32")) REDUCED(int32_t)
    else if (!strcmp(type, "u64")) REDUCED(uint64_t)
    else die("no reduction", name);
  }
}
struct prefix_sum {
  const void *in;
  void *scratch, *out;
  uint32_t size, block, chunks_a_block;
  uint8_t x_is_block, exclusive, reverse;
};
#define SUMMED(T) \
  for (size_t begin = 0; begin < s->size; begin += s->block) { \
    T total = 0; \
    for (size_t i = begin; i < begin + s->block && i < s->size; i++) { \
      T x = ((const T *) s->in)[i]; \
      ((T *) s->out)[i] = s->exclusive ? total : total + x; \
      total += x; } }
static void prefix_sum(const char *name, const struct prefix_sum *s) {
  if (s->reverse) die("no reverse", name);
  if (strstr(name, "_f32_")) SUMMED(float)
  else if (strstr(name, "_f64_")) SUMMED(double)
  else if (strstr(name, "_u32_")) SUMMED(uint32_t)
  else die("no", name);
}
static void compress(const uint8_t *in, uint32_t *out, uint32_t size, uint32_t *count) {
  *count = 0;
  for (uint32_t i = 0; i < size; i++)
    if (in[i])
      out[(*count)++] = i;
}
struct aggregated {
  int32_t size; /* in bytes; below 0: behind the pointer */
  uint32_t offset;
  const void *source;
};
static void aggregate(char *out, const struct aggregated *parts, uint32_t n) {
  for (uint32_t i = 0; i < n; i++) {
    const void *from = parts[i].size > 0 ? &parts[i].source : parts[i].source;
    memcpy(out + parts[i].offset, from, abs(parts[i].size));
  }
}
static void fill_64(uint64_t *out, uint32_t n, uint64_t value) { while (n--) *out++ = value; }

#define ARG(k, T) (*(T *) args[k])
int cuLaunchKernel(struct function *f, uint32_t gx, uint32_t gy, uint32_t gz, uint32_t bx, uint32_t by,
                   uint32_t bz, uint32_t shared, P stream, void **args, void **extra) {
  const char *name = f->name;
  if (f->run) f->run(extra[1], 0, gx, bx);
  else if (!strncmp(name, "block_reduce_", 13)) block_reduce(name, args[0]);
  else if (!strncmp(name, "block_prefix_reduce_add_", 24)) prefix_sum(name, args[0]);
  else if (!strcmp(name, "fill_64")) fill_64(ARG(0, P), ARG(1, uint32_t), ARG(2, uint64_t));
  else if (!strcmp(name, "aggregate")) aggregate(ARG(0, P), ARG(1, P), ARG(2, uint32_t));
  else if (!strcmp(name, "compress_small")) compress(ARG(0, P), ARG(1, P), ARG(2, uint32_t), ARG(3, P));
  else if (!strcmp(name, "compress_large_init")) return 0;
  else if (!strcmp(name, "compress_large")) compress(ARG(0, P), ARG(1, P), gx * 2048, ARG(3, P));
  else die("no kernel", name);
  return 0;
}

/* ---- threads of a translated kernel ---- */
void run_threads(thread_t thread, const char *params, const struct binding_table *table, uint32_t grid,
                 uint32_t block) {
#pragma omp parallel
  {
    /* Flush denormals, as the kernels ask for; nobody else on this thread may notice. */
    unsigned before = _mm_getcsr();
    _mm_setcsr(before | 0x8040);
#pragma omp for schedule(dynamic, 64)
    for (uint64_t k = 0; k < (uint64_t) grid * block; k++)
      thread(params, table, k / block, block, k % block, grid);
    _mm_setcsr(before);
  }
}
