/* SPDX-License-Identifier: Apache-2.0 */
/* Registers of a frame from poses: docs/driver.md.
 *
 * Integers only: no allocation, no floating point, no library. The same poses give the same words on every processor.
 */
#ifndef COLONNADE_VIEW_H
#define COLONNADE_VIEW_H

#include "colonnade.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    COLONNADE_VIEW_LIGHTS = 8,
    COLONNADE_VIEW_EDGES = 6, /* half-planes of frame.objectOutline */
    COLONNADE_VIEW_RAYS = 4,  /* gathered rays of a path */
    /* Words that are computed, at most: of frame, camera, lights, environment, its window, and sample points. Numbers
     * of more than 32 bits have two. */
    COLONNADE_VIEW_FRAME = 7 + 3 * COLONNADE_VIEW_EDGES,
    COLONNADE_VIEW_CAMERA = 2 * 12 + 1,
    COLONNADE_VIEW_LIGHT = 2 * 3 + 5,
    COLONNADE_VIEW_ENVIRONMENT = 2 * 12 + 11,
    COLONNADE_VIEW_WINDOW = 8,
    COLONNADE_VIEW_GATHER = 2 * COLONNADE_VIEW_RAYS,
    COLONNADE_VIEW_WORDS = COLONNADE_VIEW_FRAME + COLONNADE_VIEW_CAMERA + COLONNADE_VIEW_LIGHTS * COLONNADE_VIEW_LIGHT +
        COLONNADE_VIEW_ENVIRONMENT + COLONNADE_VIEW_WINDOW + COLONNADE_VIEW_GATHER
};

/* World = rotation * local + position. */
struct colonnade_pose {
    int64_t position[3];    /* 2^-32 m */
    int32_t rotation[3][3]; /* 2^-30, [row][column] */
};

/* A pinhole camera; its own axes are x right, y down, z forward. The centre of pixel (x, y) is at (x + 1/2, y + 1/2).
 */
struct colonnade_camera {
    struct colonnade_pose pose;
    int64_t fx, fy; /* focal lengths, 2^-32 pixels, from 1/16 to 2^24 pixels */
    int64_t cx, cy; /* principal point, 2^-32 pixels, up to 2^24 pixels from pixel 0 */
    uint32_t width, height;
};

struct colonnade_light {
    int64_t position[3]; /* 2^-32 m */
    uint32_t colour[3];  /* linear red, green, blue, 2^-16 */
    uint64_t reach;      /* distance of that intensity, 2^-32 m; 0: constant intensity */
};

/* A positive number, mantissa * 2^exponent, with the mantissa's top bit set. */
struct colonnade_factor {
    uint64_t mantissa;
    int32_t exponent;
};

/* Numbers of the design, of the mesh and of the room, from the view file. */
struct colonnade_view_scene {
    /* Operands of at most 32 bits, positions of at most 40 */
    int32_t mac_bits, scene_bits, grid_fraction, coordinate_bits, box_pad_log, mantissa_bits, vertex_bits;
    int32_t more_mac_bits, more_grid_bits; /* that the design has below these; they are 0 */
    uint32_t max_width, max_height;
    uint32_t exposure; /* of lights, 2^-16 */
    uint32_t frame_address, camera_address, lights_address, environment_address, window_address;
    uint32_t gather_address; /* 0: the sample points are constant */
    uint32_t lights, constants;
    struct colonnade_factor steps;      /* grid steps in a metre */
    int64_t offset[3];                  /* grid position of the mesh's origin, negated, 2^-16 steps */
    int32_t low[3], high[3];            /* the object's bounds, vertex units */
    struct colonnade_factor metres;     /* metres in a grid step */
    struct colonnade_factor projection; /* 1 / (1024 * depthUnit), in a grid step */
    int64_t map_lens[4];                /* fx, fy, cx, cy of the maps, 2^-32 of their pixels */
    struct colonnade_pose map_pose;     /* of the maps' camera */
    int64_t room_low[3], room_high[3];  /* all of the room's surface, 2^-32 m */
    uint32_t window; /* 0: none, 1: the pixels that the object may darken, 2: the whole frame, 3: constant registers */
    uint32_t occlusion, edge, max_tolerance; /* edge and tolerance in grid steps */
    uint32_t tile_size, tile_columns, tile_rows;
    const uint8_t *tiles, *writes;
};

/* What differs between the passes of a frame. */
struct colonnade_sample {
    int64_t shift[2];                       /* of the rays from the pixels' centres, right and down, 2^-32 pixels */
    uint8_t points[COLONNADE_VIEW_RAYS][2]; /* `gather.points` */
};

/* The caller's memory; only the functions below read and write it. It points into the view file. */
struct colonnade_view {
    struct colonnade_view_scene scene;
    struct colonnade_camera camera;
    struct colonnade_pose object;
    struct colonnade_light lights[COLONNADE_VIEW_LIGHTS];
    struct colonnade_sample sample;
    uint32_t words[2][COLONNADE_VIEW_WORDS];
    bool is_map_camera; /* in a room: the camera took its maps */
    bool accepted;      /* which of `words` the device has */
    bool is_known;      /* it has them */
    bool is_computed;   /* the others are a whole frame */
};

/* Reads a view file, which `colonnade pack --view-file` writes. Poses and lights are its scene's. */
enum colonnade_error colonnade_view_open(struct colonnade_view *view, const struct colonnade_design *design,
                                         const void *data, size_t bytes);

/* The rotation of a unit quaternion x, y, z, w, 2^-30 each. */
enum colonnade_error colonnade_rotation(int32_t rotation[3][3], const int32_t quaternion[4]);

/* In a room the device marches from this camera; until the first call the camera is the file's. */
enum colonnade_error colonnade_view_set_camera(struct colonnade_view *view, const struct colonnade_camera *camera);
/* Where the object is, 2^-32 m; until the first call it is where the file has it. */
enum colonnade_error colonnade_view_set_object(struct colonnade_view *view, const struct colonnade_pose *object);
/* The bounds of what moves within the object's cube, vertex units; until the first call they are the file's. */
enum colonnade_error colonnade_view_set_bounds(struct colonnade_view *view, const int32_t low[3],
                                               const int32_t high[3]);
/* Light `index` of the scene, 0 to its count - 1; until the first call it is the file's. */
enum colonnade_error colonnade_view_set_light(struct colonnade_view *view, uint32_t index,
                                              const struct colonnade_light *light);

/* Pass `index` of a frame of 1, 2, 4, ... 64 passes: the host's pixel shift and sample points (docs/sampling.md). It
 * holds until the next call, whatever moves; until the first one a frame has one pass. */
enum colonnade_error colonnade_view_set_sample(struct colonnade_view *view, uint32_t index, uint32_t count);

/* Computes the registers. `frame` has changes from the accepted ones, in `writes`, which has space for `capacity`
 * pairs of words; colonnade_view_most_writes says how many are enough. */
enum colonnade_error colonnade_view_frame(struct colonnade_view *view, uint8_t *writes, uint32_t capacity,
                                          struct colonnade_frame *frame);
/* The pairs of words that a frame has at most. */
uint32_t colonnade_view_most_writes(const struct colonnade_view *view);

/* The device has the last frame: call it when colonnade_set_frame has returned COLONNADE_OK. */
void colonnade_view_accept(struct colonnade_view *view);

/* The device has lost its registers, by a reset: the next frame has all of them. */
void colonnade_view_forget(struct colonnade_view *view);

#ifdef __cplusplus
}
#endif

#endif
