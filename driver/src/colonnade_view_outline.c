/* SPDX-License-Identifier: Apache-2.0 */
/* The part of a picture in which the object may be. */
#include "colonnade_view_parts.h"

enum { OUTLINE_NORMAL = 2047 };

/* The object's padded box, relative to the eye, rounded outwards to 30 bits. */
struct box {
    int32_t planes[3][2];
};

static void find_box(struct colonnade_view *view, const struct colonnade_work *work, struct box *box) {
    const struct colonnade_view_scene *scene = &view->scene;
    const int shift = work->unit_shift, fraction = scene->grid_fraction;
    const int64_t pad = ((int64_t)1 << scene->box_pad_log) + 1;
    int64_t planes[3][2];
    uint64_t most = 0;
    for (int axis = 0; axis < 3; ++axis) {
        /* The device's eye is the registers' */
        const int64_t eye = colonnade_shift_left(colonnade_nearest(work->eye[axis], 16 + shift), shift);
        const int64_t low = scene->low[axis] - pad, high = scene->high[axis] + pad;
        planes[axis][0] = (fraction < 0 ? colonnade_floor(low, -fraction) : colonnade_shift_left(low, fraction)) - eye;
        planes[axis][1] =
            (fraction < 0 ? -colonnade_floor(-high, -fraction) : colonnade_shift_left(high, fraction)) - eye;
        most |= colonnade_magnitude(planes[axis][0]) | colonnade_magnitude(planes[axis][1]);
    }
    int down = colonnade_bit_length(most) - 29;
    if (down < 0) down = 0;
    for (int axis = 0; axis < 3; ++axis) {
        box->planes[axis][0] = (int32_t)colonnade_floor(planes[axis][0], down);
        box->planes[axis][1] = (int32_t)-colonnade_floor(-planes[axis][1], down);
    }
}

/* The half-plane of the pixels whose rays lie on one side of a plane through the eye: normal * ray >= 0. The normal has
 * no component along an axis. Answers whether it cuts the frame. */
static bool find_half_plane(const struct colonnade_view *view, const struct colonnade_view_rays *rays,
                            const int32_t normal[3], int axis, int32_t half_plane[3]) {
    const int b = (axis + 1) % 3, c = (axis + 2) % 3;
    const int32_t *step_x = rays->step_x, *step_y = rays->step_y, *direction = rays->first;
    const int64_t x = (int64_t)normal[b] * step_x[b] + (int64_t)normal[c] * step_x[c];
    const int64_t y = (int64_t)normal[b] * step_y[b] + (int64_t)normal[c] * step_y[c];
    const int64_t first = (int64_t)normal[b] * direction[b] + (int64_t)normal[c] * direction[c];
    const uint64_t size_x = colonnade_magnitude(x), size_y = colonnade_magnitude(y);
    const uint64_t most = size_x > size_y ? size_x : size_y;
    const int64_t limit = ((int64_t)1 << (12 + view->scene.coordinate_bits)) - 1;
    half_plane[0] = half_plane[1] = 0;
    half_plane[2] = (int32_t)-limit;
    if (most == 0) return first < 0;
    /* Any common factor will do: its error is none of the half-plane's */
    const int down = colonnade_bit_length(most) - 31;
    const int64_t near_x = colonnade_nearest(x, down), near_y = colonnade_nearest(y, down);
    const uint32_t larger = (uint32_t)colonnade_magnitude(size_x > size_y ? near_x : near_y);
    const int64_t factor = ((uint32_t)OUTLINE_NORMAL << 20) / ((larger >> 12) + 1);
    half_plane[0] = (int32_t)colonnade_nearest(near_x * factor, 32);
    half_plane[1] = (int32_t)colonnade_nearest(near_y * factor, 32);
    const int up = rays->shift - down;
    int64_t offset = first < 0 ? -limit : limit;
    if (colonnade_bit_length(colonnade_magnitude(first)) + up <= 48) {
        const int64_t scaled = up >= 0 ? colonnade_shift_left(first, up) : -colonnade_floor(-first, -up);
        offset = -colonnade_floor(-scaled * factor, 32);
    }
    /* The rounded normal, and a pixel for the device's rounding */
    offset += ((int64_t)view->camera.width + view->camera.height) / 2 + 2 + OUTLINE_NORMAL;
    if (offset >= limit) return false;
    if (offset > -limit) half_plane[2] = (int32_t)offset;
    return true;
}

/* Planes through the eye and the edges between a face of the box that faces the eye and one that does not: four or six,
 * none if the eye is in the box. They also hold where the box reaches behind the camera. */
static void set_outline(struct colonnade_view *view, const struct colonnade_view_rays *rays, const struct box *box) {
    uint32_t *words = colonnade_computed(view) + VIEW_OUTLINE;
    for (int i = 0; i < 3 * COLONNADE_VIEW_EDGES; ++i) words[i] = 0;
    bool faces[3][2];
    for (int axis = 0; axis < 3; ++axis) {
        faces[axis][0] = box->planes[axis][0] > 0;
        faces[axis][1] = box->planes[axis][1] < 0;
    }
    int used = 0;
    for (int edge = 0; edge < 12 && used < COLONNADE_VIEW_EDGES; ++edge) {
        const int axis = edge / 4, b = (axis + 1) % 3, c = (axis + 2) % 3, at_b = edge & 1, at_c = edge >> 1 & 1;
        if (faces[b][at_b] == faces[c][at_c]) continue;
        /* The plane through the eye and an edge along the axis; the opposite edge is inside */
        int32_t normal[3], half_plane[3];
        normal[axis] = 0;
        normal[b] = box->planes[c][at_c];
        normal[c] = -box->planes[b][at_b];
        if ((int64_t)normal[b] * box->planes[b][!at_b] + (int64_t)normal[c] * box->planes[c][!at_c] < 0)
            normal[b] = -normal[b], normal[c] = -normal[c];
        if (!find_half_plane(view, rays, normal, axis, half_plane)) continue;
        words[3 * used] = colonnade_bits(half_plane[0], 12);
        words[3 * used + 1] = colonnade_bits(half_plane[1], 12);
        words[3 * used + 2] = colonnade_bits(half_plane[2], 13 + view->scene.coordinate_bits);
        ++used;
    }
}

static void find_cross(const int32_t a[3], const int32_t b[3], int64_t cross[3]) {
    for (int axis = 0; axis < 3; ++axis) {
        const int next = (axis + 1) % 3, last = (axis + 2) % 3;
        cross[axis] = (int64_t)a[next] * b[last] - (int64_t)a[last] * b[next];
    }
}

static uint32_t clip(int64_t pixel, uint32_t size) {
    if (pixel < 0) return 0;
    return pixel > (int64_t)size ? size : (uint32_t)pixel;
}

/* The pixels around the corners of the box, a pixel wider; the whole frame if the box reaches behind the camera, none
 * if it lies there. A corner is at x = (step_y x first) * corner / d, y = (first x step_x) * corner / d with d =
 * (step_x x step_y)
 * * corner. */
static void set_rectangle(struct colonnade_view *view, const struct colonnade_view_rays *rays, const struct box *box) {
    const uint32_t size[2] = {view->camera.width, view->camera.height};
    const int up = 31 - view->scene.mac_bits;
    int32_t first[3], step_x[3], step_y[3];
    int64_t normals[3][3];
    for (int axis = 0; axis < 3; ++axis) { /* up to 2^30 */
        first[axis] = (int32_t)colonnade_nearest(rays->first[axis], -up);
        step_x[axis] = (int32_t)colonnade_nearest(rays->step_x[axis], -up);
        step_y[axis] = (int32_t)colonnade_nearest(rays->step_y[axis], -up);
    }
    find_cross(step_y, first, normals[0]);
    find_cross(first, step_x, normals[1]);
    find_cross(step_x, step_y, normals[2]);
    const int length_x = colonnade_block_length(normals[0]), length_y = colonnade_block_length(normals[1]);
    const int exponent = (length_x > length_y ? length_x : length_y) - 30;
    const int depth_exponent = colonnade_block_length(normals[2]) - 30;
    int64_t terms[3][3][2];
    for (int i = 0; i < 3; ++i)
        for (int axis = 0; axis < 3; ++axis) {
            const int32_t normal = (int32_t)colonnade_nearest(normals[i][axis], i < 2 ? exponent : depth_exponent);
            for (int side = 0; side < 2; ++side) terms[i][axis][side] = (int64_t)normal * box->planes[axis][side];
        }
    struct colonnade_extent extent = {.is_empty = true};
    bool is_before = true, is_behind = true;
    for (int corner = 0; corner < 8; ++corner) {
        int64_t point[3];
        for (int i = 0; i < 3; ++i)
            point[i] = terms[i][0][corner & 1] + terms[i][1][corner >> 1 & 1] + terms[i][2][corner >> 2];
        is_behind = is_behind && point[2] < -((int64_t)1 << 40);
        is_before = is_before && colonnade_include(&extent, point);
    }
    const int power = exponent - depth_exponent + rays->shift;
    uint32_t *words = colonnade_computed(view) + VIEW_RECT;
    for (int i = 0; i < 2; ++i) {
        words[i] = is_before ? clip((int64_t)colonnade_whole(extent.low[i], power) - 1, size[i]) : 0;
        words[2 + i] = is_before ? clip((int64_t)colonnade_whole(extent.high[i], power) + 3, size[i]) : size[i];
    }
    if (is_behind || words[0] >= words[2] || words[1] >= words[3])
        for (int i = 0; i < 4; ++i) words[i] = 0;
}

void colonnade_view_outline(struct colonnade_view *view, const struct colonnade_work *work,
                            const struct colonnade_view_rays *rays) {
    struct box box;
    find_box(view, work, &box);
    set_outline(view, rays, &box);
    set_rectangle(view, rays, &box);
}
