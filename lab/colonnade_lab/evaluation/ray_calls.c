// A program for Embree 4 that measures the calls of single rays and packets of 16 on one mesh: CPU nanoseconds a ray,
// and rays that hit. Usage: ray_calls FILE VERTICES FACES RAYS closest|occluded; FILE has vertices float[3], faces
// uint32[3], rays float[8]: origin, tnear, direction, tfar
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

typedef void *Handle;
Handle rtcNewDevice(const char *), rtcNewScene(Handle), rtcNewGeometry(Handle, int);
void *rtcSetNewGeometryBuffer(Handle, int, unsigned, int, size_t, size_t);
void rtcCommitGeometry(Handle), rtcCommitScene(Handle);
unsigned rtcAttachGeometry(Handle, Handle);
void rtcIntersect1(Handle, void *, void *), rtcOccluded1(Handle, void *, void *);
void rtcIntersect16(const int *, Handle, void *, void *), rtcOccluded16(const int *, Handle, void *, void *);

enum { tfar = 8, mask = 9, geometry_id = 18, words = 24, lanes = 16, repeats = 3 };
static float packet[words * lanes] __attribute__((aligned(64)));
static const int all[lanes]
    __attribute__((aligned(64))) = {-1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1};

static void *bytes_of(FILE *file, size_t size) {
    void *const result = malloc(size + 16);
    if (!result || fread(result, 1, size, file) != size) exit(1);
    return result;
}

static double nanoseconds(void) {
    struct timespec now;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return now.tv_sec * 1e9 + now.tv_nsec;
}

// Sets lane `lane` of a packet of `width` rays.
static void set(const float *ray, int width, int lane) {
    const uint32_t none = ~0u;
    for (int word = 0; word < words; ++word) memset(&packet[word * width + lane], 0, 4);
    for (int word = 0; word < 7; ++word) packet[word * width + lane] = ray[word];
    packet[tfar * width + lane] = ray[7];
    memcpy(&packet[mask * width + lane], &none, 4);
    memcpy(&packet[geometry_id * width + lane], &none, 4);
}

int main(int count, char **argument) {
    if (count != 6) return 2;
    const size_t vertices = strtoul(argument[2], NULL, 10), faces = strtoul(argument[3], NULL, 10),
                 rays = strtoul(argument[4], NULL, 10);
    const int is_occlusion = strcmp(argument[5], "occluded") == 0;
    FILE *const file = fopen(argument[1], "rb");
    if (!file) return 1;
    Handle device = rtcNewDevice(NULL), scene = rtcNewScene(device), geometry = rtcNewGeometry(device, 0);
    memcpy(rtcSetNewGeometryBuffer(geometry, 1, 0, 0x9003, 12, vertices), bytes_of(file, 12 * vertices), 12 * vertices);
    memcpy(rtcSetNewGeometryBuffer(geometry, 0, 0, 0x5003, 12, faces), bytes_of(file, 12 * faces), 12 * faces);
    const float *const all_rays = bytes_of(file, 32 * rays);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene, geometry);
    rtcCommitScene(scene);
    for (int width = 1; width <= lanes; width += lanes - 1) {
        double least = INFINITY;
        size_t hits = 0;
        for (int repeat = 0; repeat < repeats; ++repeat) {
            const double begin = nanoseconds();
            hits = 0;
            for (size_t i = 0; i + width <= rays; i += width) {
                for (int lane = 0; lane < width; ++lane) set(all_rays + 8 * (i + lane), width, lane);
                if (width == 1) (is_occlusion ? rtcOccluded1 : rtcIntersect1)(scene, packet, NULL);
                else (is_occlusion ? rtcOccluded16 : rtcIntersect16)(all, scene, packet, NULL);
                for (int lane = 0; lane < width; ++lane) {
                    uint32_t id;
                    memcpy(&id, &packet[geometry_id * width + lane], 4);
                    hits += is_occlusion ? packet[tfar * width + lane] < 0 : id != ~0u;
                }
            }
            least = fmin(least, (nanoseconds() - begin) / (rays / width * width));
        }
        printf("%.1f %zu\n", least, hits);
    }
    return 0;
}
