/* The live encoder of a room's maps: words of the physical-attribute memory for each frame of a camera
 * (docs/captures.md, "Live encoder"). Equal frames in equal order give equal words on every processor. */
#ifndef COLONNADE_LIVE_H
#define COLONNADE_LIVE_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Sizes of the maps and their memories, as in the section physicalAttributeMemory of a configuration. Tiles have 16 by
 * 16 pixels. */
typedef struct {
    int32_t width, height;               /* pixels, up to 4096 */
    int32_t palette_size, heap_words;    /* of the albedo map, and of the normal map; up to 256 and 8192 */
    int32_t planes, plane_heap_words;    /* up to 128 and 8192 */
    int32_t bounding_planes;             /* up to 16 */
} colonnade_live_sizes;

/* A frame. Its maps are whole tiles, columns * 16 by rows * 16 pixels, row by row; what lies beyond width and height
 * repeats the last column and row. */
typedef struct {
    const uint8_t* albedo;   /* three bytes a pixel, sRGB */
    const uint8_t*
        normals;  /* three bytes a pixel, n * 127.5 + 127.5 in camera space: x right, y up, z towards the viewer */
    const uint32_t* depth;   /* along the optical axis, steps of 2^-16 m */
    double fx, fy, cx, cy;   /* pixels */
    double to_world[12];     /* view space (x right, y down, z forward) to world, three rows of four */
    double tolerance; /* of planes, metres: 0.006 for exact depth, about three times the sensor's noise otherwise */
} colonnade_live_frame;

typedef struct {
    uint32_t* descriptors; /* tiles */
    uint64_t* palette; /* palette_size */
    uint16_t* heap; /* heap_words */
} colonnade_live_vectors;

/* What an encoder writes; the caller owns the arrays. */
typedef struct {
    colonnade_live_vectors albedo, normals;
    uint16_t* plane_descriptors; /* tiles */
    uint64_t* planes; /* planes */
    uint16_t* plane_heap; /* plane_heap_words */
    uint64_t* bounding; /* 3 * bounding_planes */
    float* tile_error; /* tiles: 90th percentile of the error of their depth, metres along the view rays */
    float* tile_nearest; /* tiles: least and largest depth of the planes, metres along the optical axis */
    float* tile_furthest;
    double depth_unit; /* metres */
} colonnade_live_maps;

typedef struct colonnade_live colonnade_live;

/* An encoder, or a null pointer if a size is out of range. */
colonnade_live* colonnade_live_create(const colonnade_live_sizes* sizes);
/* Frees an encoder, or does nothing with a null pointer. */
void colonnade_live_destroy(colonnade_live* live);
/* Encodes the next frame. The frame before is the start of the search. */
void colonnade_live_encode(colonnade_live* live, const colonnade_live_frame* frame, colonnade_live_maps* maps);

#ifdef __cplusplus
}
#endif
#endif
