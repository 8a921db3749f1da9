/* SPDX-License-Identifier: Apache-2.0 */
/* Points and poses on the grid of the object. */
#include "colonnade_view_parts.h"

bool colonnade_find_on_grid(const struct colonnade_view *view, const int64_t point[3], int64_t steps[3]) {
    const int64_t limit = (int64_t)1 << 61, reach = ((int64_t)1 << (view->scene.scene_bits - 1)) - 1;
    int64_t from[3];
    for (int axis = 0; axis < 3; ++axis) from[axis] = point[axis] - view->object.position[axis];
    for (int axis = 0; axis < 3; ++axis) {
        int64_t high = 0, low = 0;
        for (int row = 0; row < 3; ++row) {
            const int64_t factor = view->object.rotation[row][axis];
            high += factor * (int32_t)(from[row] >> 31);
            low += factor * (int32_t)(from[row] & INT32_MAX);
        }
        const int64_t along = 2 * high + colonnade_nearest(low, COLONNADE_ROTATION_BITS);
        steps[axis] = colonnade_scaled(along, &view->scene.steps, 16, limit) - view->scene.offset[axis];
        if (!colonnade_is_within(steps[axis], -(reach << 16) + 1, (reach << 16) - 1)) return false;
    }
    return true;
}

bool colonnade_find_sight(const struct colonnade_view *view, const struct colonnade_pose *pose,
                          struct colonnade_work *work) {
    for (int i = 0; i < 3; ++i)
        for (int axis = 0; axis < 3; ++axis) {
            work->axes[i][axis] = 0;
            for (int row = 0; row < 3; ++row)
                work->axes[i][axis] += (int64_t)pose->rotation[row][i] * view->object.rotation[row][axis];
        }
    return colonnade_find_on_grid(view, pose->position, work->eye);
}
