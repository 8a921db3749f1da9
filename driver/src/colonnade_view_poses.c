/* SPDX-License-Identifier: Apache-2.0 */
/* Poses, cameras and lights of a view: docs/driver.md. */
#include "colonnade_view_parts.h"

enum { WORLD_BITS = 60 };

bool colonnade_is_lens(int64_t fx, int64_t fy, int64_t cx, int64_t cy) {
    const int64_t least = COLONNADE_PIXEL / 16, most = COLONNADE_PIXEL << 24;
    return colonnade_is_within(fx, least, most) && colonnade_is_within(fy, least, most) &&
           colonnade_is_within(cx, -most, most) && colonnade_is_within(cy, -most, most);
}

bool colonnade_is_place(const int64_t position[3]) { return colonnade_block_length(position) <= WORLD_BITS; }

bool colonnade_is_pose(const struct colonnade_pose *pose) {
    const int32_t most = ((int32_t)1 << COLONNADE_ROTATION_BITS) + 1024;
    const int64_t one = (int64_t)1 << (2 * COLONNADE_ROTATION_BITS), error = one >> 20;
    for (int i = 0; i < 9; ++i)
        if (!colonnade_is_within(pose->rotation[i / 3][i % 3], -most, most)) return false;
    int64_t volume = 0;
    for (int i = 0; i < 3; ++i) {
        const int32_t *row = pose->rotation[i], *next = pose->rotation[(i + 1) % 3];
        int64_t length = 0, angle = 0;
        for (int axis = 0; axis < 3; ++axis) {
            length += (int64_t)row[axis] * row[axis];
            angle += (int64_t)row[axis] * next[axis];
        }
        if (!colonnade_is_within(length, one - error, one + error) || !colonnade_is_within(angle, -error, error))
            return false;
        const int32_t *second = pose->rotation[1], *third = pose->rotation[2];
        const int b = (i + 1) % 3, c = (i + 2) % 3;
        const int64_t minor = (int64_t)second[b] * third[c] - (int64_t)second[c] * third[b];
        volume += colonnade_nearest(minor, 32) * (pose->rotation[0][i] / 4);
    }
    return volume > 0 && colonnade_is_place(pose->position);
}

enum colonnade_error colonnade_check_camera(const struct colonnade_view_scene *scene,
                                            const struct colonnade_camera *camera) {
    if (!colonnade_is_pose(&camera->pose)) return COLONNADE_BAD_POSE;
    if (!colonnade_is_lens(camera->fx, camera->fy, camera->cx, camera->cy) || camera->width == 0 || camera->height == 0)
        return COLONNADE_BAD_LENS;
    return camera->width > scene->max_width || camera->height > scene->max_height ? COLONNADE_TOO_LARGE : COLONNADE_OK;
}

enum colonnade_error colonnade_rotation(int32_t rotation[3][3], const int32_t quaternion[4]) {
    int64_t norm = 0;
    const int64_t one = (int64_t)1 << COLONNADE_ROTATION_BITS;
    for (int i = 0; i < 4; ++i) {
        if (!colonnade_is_within(quaternion[i], -one - 1024, one + 1024)) return COLONNADE_BAD_POSE;
        norm += (int64_t)quaternion[i] * quaternion[i];
    }
    norm = colonnade_nearest(norm, COLONNADE_ROTATION_BITS);
    if (!colonnade_is_within(norm, one - 1024, one + 1024)) return COLONNADE_BAD_POSE;
    /* Twice the products, over the norm: 1 / norm is 2 - norm but for the square of its small error */
    int32_t twice[3][4];
    for (int i = 0; i < 3; ++i)
        for (int j = i; j < 4; ++j) {
            const int64_t product =
                colonnade_nearest((int64_t)quaternion[i] * quaternion[j], COLONNADE_ROTATION_BITS - 1);
            twice[i][j] = (int32_t)colonnade_nearest(product * (2 * one - norm), COLONNADE_ROTATION_BITS);
            if (j < 3) twice[j][i] = twice[i][j];
        }
    for (int axis = 0; axis < 3; ++axis) {
        const int b = (axis + 1) % 3, c = (axis + 2) % 3;
        rotation[axis][axis] = (int32_t)(one - twice[b][b] - (int64_t)twice[c][c]);
        rotation[b][axis] = (int32_t)((int64_t)twice[axis][b] + twice[c][3]);
        rotation[axis][b] = (int32_t)((int64_t)twice[axis][b] - twice[c][3]);
    }
    return COLONNADE_OK;
}

enum colonnade_error colonnade_view_set_camera(struct colonnade_view *view, const struct colonnade_camera *camera) {
    const enum colonnade_error error = colonnade_check_camera(&view->scene, camera);
    if (error != COLONNADE_OK) return error;
    view->camera = *camera;
    view->is_map_camera = false;
    return COLONNADE_OK;
}

enum colonnade_error colonnade_view_set_object(struct colonnade_view *view, const struct colonnade_pose *object) {
    if (!colonnade_is_pose(object)) return COLONNADE_BAD_POSE;
    view->object = *object;
    return COLONNADE_OK;
}

enum colonnade_error colonnade_view_set_bounds(struct colonnade_view *view, const int32_t low[3],
                                               const int32_t high[3]) {
    const int64_t most = ((int64_t)1 << view->scene.vertex_bits) - 1;
    for (int axis = 0; axis < 3; ++axis)
        if (!colonnade_is_within(low[axis], 0, high[axis]) || high[axis] > most) return COLONNADE_OUTSIDE;
    for (int axis = 0; axis < 3; ++axis) view->scene.low[axis] = low[axis], view->scene.high[axis] = high[axis];
    return COLONNADE_OK;
}

enum colonnade_error colonnade_view_set_light(struct colonnade_view *view, uint32_t index,
                                              const struct colonnade_light *light) {
    if (index >= view->scene.lights) return COLONNADE_NO_LIGHT;
    if (!colonnade_is_place(light->position)) return COLONNADE_BAD_POSE;
    view->lights[index] = *light;
    return COLONNADE_OK;
}
