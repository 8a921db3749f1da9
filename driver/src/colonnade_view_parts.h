/* SPDX-License-Identifier: Apache-2.0 */
/* What the files of colonnade_view share. */
#ifndef COLONNADE_VIEW_PARTS_H
#define COLONNADE_VIEW_PARTS_H

#include "colonnade_integers.h"

#define COLONNADE_PIXEL ((int64_t)1 << 32) /* of a lens */

enum { COLONNADE_ROTATION_BITS = 30, COLONNADE_MAX_BLOCKS = 6 };

/* Contents of `environment.window`. */
enum { WINDOW_NONE, WINDOW_SHADOW, WINDOW_WHOLE, WINDOW_CONSTANT, WINDOW_NEAR }; /* shadow and near may both be */

/* Places in the computed words. */
enum {
    VIEW_FRAME = 0,
    VIEW_RECT = VIEW_FRAME + 2,
    VIEW_OUTLINE = VIEW_FRAME + 6,
    VIEW_UNIT_SHIFT = VIEW_FRAME + COLONNADE_VIEW_FRAME - 1,
    VIEW_CAMERA = VIEW_FRAME + COLONNADE_VIEW_FRAME,
    VIEW_LIGHTS = VIEW_CAMERA + COLONNADE_VIEW_CAMERA,
    VIEW_ENVIRONMENT = VIEW_LIGHTS + COLONNADE_VIEW_LIGHTS * COLONNADE_VIEW_LIGHT,
    VIEW_WINDOW = VIEW_ENVIRONMENT + COLONNADE_VIEW_ENVIRONMENT,
    VIEW_GATHER = VIEW_WINDOW + COLONNADE_VIEW_WINDOW
};

/* A frame in work. Positions are on the object's grid. */
struct colonnade_work {
    int64_t axes[3][3]; /* right, down and forward in the object's axes, 2^-60 */
    int64_t eye[3];     /* 2^-16 steps */
    int unit_shift;     /* of the registers' positions, to steps */
    int64_t lights[COLONNADE_VIEW_LIGHTS][3];
};

/* The words of the frame in work. */
static inline uint32_t *colonnade_computed(struct colonnade_view *view) { return view->words[!view->accepted]; }

/* Words of a register of `mac_bits` and those below. */
static inline uint32_t colonnade_mac_words(const struct colonnade_view_scene *scene) {
    return scene->more_mac_bits > 0 ? 2 : 1;
}

/* Sets such a register to value * 2^shift, which has `more_mac_bits` below at most, and answers the place behind it. */
static inline uint32_t *colonnade_set_mac(const struct colonnade_view_scene *scene, uint32_t *words, int64_t value,
                                          int shift) {
    const uint64_t bits = (uint64_t)value << shift;
    if (scene->more_mac_bits == 0) {
        *words++ = colonnade_bits(value, scene->mac_bits);
        return words;
    }
    *words++ = (uint32_t)bits;
    *words++ = colonnade_bits((int64_t)(bits >> 32), scene->more_mac_bits);
    return words;
}

/* The largest exponent of a register of exponents. */
static inline int32_t colonnade_exponent_limit(const struct colonnade_view_scene *scene) {
    const uint32_t bits = (uint32_t)(scene->scene_bits + scene->more_grid_bits);
    return ((int32_t)1 << colonnade_bit_length(2 * bits)) - 1;
}

/* The words that a device of a scene has, block by block. */
struct colonnade_block {
    uint32_t address, place, count;
};

/* Finds the blocks; answers their number. */
int colonnade_find_blocks(const struct colonnade_view_scene *scene,
                          struct colonnade_block blocks[COLONNADE_MAX_BLOCKS]);

/* Whether rows are unit and at right angles, to 2^-20, and right-handed, and the position is in the world. */
bool colonnade_is_pose(const struct colonnade_pose *pose);

/* Whether a position is in the world. */
bool colonnade_is_place(const int64_t position[3]);

/* Whether focal lengths and principal point, 2^-32 pixels, are a lens's. */
bool colonnade_is_lens(int64_t fx, int64_t fy, int64_t cx, int64_t cy);

/* Whether a scene's device renders the picture of a camera. */
enum colonnade_error colonnade_check_camera(const struct colonnade_view_scene *scene,
                                            const struct colonnade_camera *camera);

/* A point of the world on the object's grid, 2^-16 steps. Answers whether it is in the hardware's range. */
bool colonnade_find_on_grid(const struct colonnade_view *view, const int64_t point[3], int64_t steps[3]);

/* Axes and eye of a pose. Answers whether the eye is in the hardware's range. */
bool colonnade_find_sight(const struct colonnade_view *view, const struct colonnade_pose *pose,
                          struct colonnade_work *work);

/* The scaled rays of a picture, as whole numbers, from the registers. */
struct colonnade_view_rays {
    int32_t first[3], step_x[3], step_y[3];
    int shift; /* of `first` */
};

/* The registers of the object's outline and rectangle. */
void colonnade_view_outline(struct colonnade_view *view, const struct colonnade_work *work,
                            const struct colonnade_view_rays *rays);

/* The registers of the environment. */
enum colonnade_error colonnade_view_room(struct colonnade_view *view, const struct colonnade_work *work);

#endif
