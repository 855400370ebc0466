/* Embree's nanoseconds for the packets of the bench `rays`, beside ours (see examples/dump_rays.rs):
 *
 *   cc -O3 -march=native -o embree embree.c -ldl
 *   ./embree LIBRARY FILE...      LIBRARY: libembree4.so or libembree3.so, e.g. out of the Python package embreex
 *
 * Per file: 16 rays one by one (rtcOccluded1), packets of 8 and of 16 (rtcOccluded8, rtcOccluded16) with the coherent flag
 * set, and the share of rays that it answers as we do. The fastest of 30 runs over all packets, one thread.
 */
#include <dlfcn.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

typedef void *Handle;

/* Embree's RTCRay, RTCRay8, RTCRay16: origin, near, direction, time, far, mask, id, flags. */
#define RAYS(N)                                                                                                        \
  struct Rays##N {                                                                                                     \
    float ox[N], oy[N], oz[N], near[N], dx[N], dy[N], dz[N], time[N], far[N];                                          \
    uint32_t mask[N], id[N], flags[N];                                                                                 \
  } __attribute__((aligned(4 * N)))
RAYS(1);
RAYS(8);
RAYS(16);

/* Both RTCIntersectContext (3) and RTCOccludedArguments (4) begin with the flags. */
struct Context3 {
  uint32_t flags;
  void *filter;
  uint32_t instance[2];
};
struct Arguments4 {
  uint32_t flags, mask;
  void *context, *filter, *occluded;
  float extent;
};

static Handle library;
static void *find(const char *name) {
  void *symbol = dlsym(library, name);
  if (!symbol) {
    fprintf(stderr, "no %s\n", name);
    exit(1);
  }
  return symbol;
}

static double now(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return t.tv_sec + 1e-9 * t.tv_nsec;
}

int main(int count, char **names) {
  if (count < 3 || !(library = dlopen(names[1], RTLD_NOW))) {
    fprintf(stderr, "usage: %s LIBRARY FILE... %s\n", names[0], count < 3 ? "" : dlerror());
    return 2;
  }
  int four = dlsym(library, "rtcForwardIntersect1") != NULL;
  Handle (*new_device)(const char *) = find("rtcNewDevice");
  Handle (*new_scene)(Handle) = find("rtcNewScene");
  Handle (*new_geometry)(Handle, int) = find("rtcNewGeometry");
  void *(*new_buffer)(Handle, int, unsigned, int, size_t, size_t) = find("rtcSetNewGeometryBuffer");
  void (*commit_geometry)(Handle) = find("rtcCommitGeometry");
  unsigned (*attach)(Handle, Handle) = find("rtcAttachGeometry");
  void (*quality)(Handle, int) = find("rtcSetSceneBuildQuality");
  void (*commit)(Handle) = find("rtcCommitScene");
  void *one = find("rtcOccluded1"), *eight = find("rtcOccluded8"), *sixteen = find("rtcOccluded16");

  Handle device = new_device("threads=1,set_affinity=0");
  for (int f = 2; f < count; f++) {
    FILE *file = fopen(names[f], "rb");
    uint32_t triangles, packets;
    if (!file || fread(&triangles, 4, 1, file) != 1) return 1;
    Handle scene = new_scene(device), mesh = new_geometry(device, 0);
    quality(scene, 2); /* high */
    float *corners = new_buffer(mesh, 1, 0, 0x9003, 12, 3 * (size_t)triangles); /* vertices, float3 */
    uint32_t *indices = new_buffer(mesh, 0, 0, 0x5003, 12, triangles);          /* indices, uint3 */
    if (fread(corners, 36, triangles, file) != triangles) return 1;
    for (uint32_t k = 0; k < 3 * triangles; k++) indices[k] = k;
    commit_geometry(mesh);
    attach(scene, mesh);
    double start = now();
    commit(scene);
    double build = now() - start;
    if (fread(&packets, 4, 1, file) != 1) return 1;
    float (*rays)[8][16] = malloc(packets * sizeof *rays);
    uint32_t *answers = malloc(4 * packets);
    for (uint32_t k = 0; k < packets; k++)
      if (fread(rays[k], sizeof *rays, 1, file) != 1 || fread(&answers[k], 4, 1, file) != 1) return 1;
    fclose(file);

    struct Context3 context = {1, NULL, {~0u, ~0u}};
    struct Arguments4 arguments = {1, ~0u, NULL, NULL, NULL, 0.0f};
    int valid[16] __attribute__((aligned(64)));
    memset(valid, -1, sizeof valid);
    double best[3] = {1e9, 1e9, 1e9};
    uint64_t same = 0;
    for (int run = 0; run < 30; run++)
      for (int way = 0; way < 3; way++) {
        start = now();
        same = 0;
        for (uint32_t k = 0; k < packets; k++) {
          uint32_t bits = 0;
          float(*r)[16] = rays[k];
#define FILL(R, N, AT)                                                                                                 \
  for (int j = 0; j < N; j++) {                                                                                        \
    R.ox[j] = r[0][AT + j], R.oy[j] = r[1][AT + j], R.oz[j] = r[2][AT + j];                                            \
    R.dx[j] = r[3][AT + j], R.dy[j] = r[4][AT + j], R.dz[j] = r[5][AT + j];                                            \
    R.near[j] = r[6][AT + j], R.far[j] = r[7][AT + j], R.time[j] = 0, R.mask[j] = ~0u, R.id[j] = 0, R.flags[j] = 0;    \
  }
#define ASK(N, FUNCTION)                                                                                               \
  for (int at = 0; at < 16; at += N) {                                                                                 \
    struct Rays##N ray;                                                                                                \
    FILL(ray, N, at)                                                                                                   \
    if (four)                                                                                                          \
      ((void (*)(const int *, Handle, void *, void *))FUNCTION)(valid, scene, &ray, &arguments);                       \
    else                                                                                                               \
      ((void (*)(const int *, Handle, void *, void *))FUNCTION)(valid, scene, &context, &ray);                         \
    for (int j = 0; j < N; j++) bits |= (uint32_t)(ray.far[j] < 0) << (at + j);                                        \
  }
          if (way == 0) {
            for (int at = 0; at < 16; at++) {
              struct Rays1 ray;
              FILL(ray, 1, at)
              if (four)
                ((void (*)(Handle, void *, void *))one)(scene, &ray, NULL);
              else {
                context.flags = 0;
                ((void (*)(Handle, void *, void *))one)(scene, &context, &ray);
                context.flags = 1;
              }
              bits |= (uint32_t)(ray.far[0] < 0) << at;
            }
          } else if (way == 1) {
            ASK(8, eight)
          } else {
            ASK(16, sixteen)
          }
          same += 16 - __builtin_popcount(bits ^ answers[k]);
        }
        double spent = now() - start;
        if (spent < best[way]) best[way] = spent;
      }
    printf("%s: one by one %.0f ns, packets of 8 %.0f ns, of 16 %.0f ns; same answer for %.6f of the rays; built in %.3f s\n",
           names[f], best[0] * 1e9 / packets, best[1] * 1e9 / packets, best[2] * 1e9 / packets,
           same / (16.0 * packets), build);
    free(rays);
    free(answers);
  }
  return 0;
}
