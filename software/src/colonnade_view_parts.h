/* What the files of colonnade_view share. */
#ifndef COLONNADE_VIEW_PARTS_H
#define COLONNADE_VIEW_PARTS_H

#include "colonnade_integers.h"

/* Places in the computed words. */
enum {
    VIEW_FRAME = 0,
    VIEW_RECT = VIEW_FRAME + 2,
    VIEW_OUTLINE = VIEW_FRAME + 6,
    VIEW_UNIT_SHIFT = VIEW_FRAME + COLONNADE_VIEW_FRAME - 1,
    VIEW_CAMERA = VIEW_FRAME + COLONNADE_VIEW_FRAME,
    VIEW_LIGHTS = VIEW_CAMERA + COLONNADE_VIEW_CAMERA,
    VIEW_ENVIRONMENT = VIEW_LIGHTS + COLONNADE_VIEW_LIGHTS * COLONNADE_VIEW_LIGHT,
    VIEW_WINDOW = VIEW_ENVIRONMENT + COLONNADE_VIEW_ENVIRONMENT
};

/* A frame in work. Positions are on the object's grid. */
struct colonnade_work {
    int64_t axes[3][3]; /* right, down and forward in the object's axes, 2^-60 */
    int64_t eye[3];     /* 2^-16 steps */
    int64_t lights[COLONNADE_VIEW_LIGHTS][3];
};

/* The words of the frame in work. */
static inline uint32_t *colonnade_computed(struct colonnade_view *view) { return view->words[!view->accepted]; }

/* A value of a register of `width` bits. */
static inline uint32_t colonnade_bits(int64_t value, int width) {
    return (uint32_t)value & (width < 32 ? ((uint32_t)1 << width) - 1 : UINT32_MAX);
}

/* The registers of the environment, of the view's map camera. */
enum colonnade_error colonnade_view_room(struct colonnade_view *view, const struct colonnade_work *work);

#endif
