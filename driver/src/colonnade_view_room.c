/* SPDX-License-Identifier: Apache-2.0 */
/* Projection to the maps of a room, window and occlusion: docs/driver.md. */
#include "colonnade_view_parts.h"
#include "colonnade_words.h"

enum { SLOPE_PIXELS = 1024, ROTATION_FRACTION = 14, LENGTH_BITS = 28, MARGIN_PARTS = 50 };

/* The least shift right, also a negative one, after which magnitudes of at most `most` fit `bits` bits and a sign. */
static int find_shift(uint64_t most, int bits) {
    int shift = colonnade_bit_length(most) - bits;
    const uint64_t limit = ((uint64_t)1 << bits) - 1;
    if (shift > 0 && most > limit << shift) ++shift;
    return shift;
}

/* A grid position p is at matrix * p + offset in the maps; the offset is -matrix * eye. The sight is the maps'. */
static bool set_projection(struct colonnade_view *view, const struct colonnade_work *work) {
    const struct colonnade_view_scene *scene = &view->scene;
    const int bits = scene->mac_bits;
    const int64_t along[3] = {scene->map_lens[0], scene->map_lens[1], SLOPE_PIXELS * COLONNADE_PIXEL};
    const int64_t centre[3] = {scene->map_lens[2], scene->map_lens[3], 0};
    const int length_along = colonnade_block_length(along), length_centre = colonnade_block_length(centre);
    const int up = 61 - (length_along > length_centre ? length_along : length_centre);
    int64_t matrix[3][3], offset[3] = {0};
    uint64_t most = 0;
    for (int row = 0; row < 3; ++row)
        for (int axis = 0; axis < 3; ++axis) {
            const int64_t sum = colonnade_product(colonnade_shift_left(along[row], up), work->axes[row][axis]) +
                                colonnade_product(colonnade_shift_left(centre[row], up), work->axes[2][axis]);
            const uint64_t size = colonnade_multiply_high(colonnade_magnitude(sum) << 4, scene->projection.mantissa);
            if (size > most) most = size;
            matrix[row][axis] = colonnade_signed(size, sum < 0);
        }
    /* The matrix is these numbers * 2^power */
    const int power = 32 + scene->projection.exponent - up;
    const int down = find_shift(most, bits - 1), exponent = -(power + down);

    const int eye_up = 62 - colonnade_block_length(work->eye);
    for (int row = 0; row < 3; ++row)
        for (int axis = 0; axis < 3; ++axis)
            offset[row] -= colonnade_product(matrix[row][axis], colonnade_shift_left(work->eye[axis], eye_up));
    const int whole = -(power + 48 - eye_up + exponent), least = find_shift(colonnade_largest(offset), bits - 1);
    const int shift = least > whole ? least - whole : 0;
    /* Of the device's steps */
    const int32_t more = scene->more_mac_bits, limit = colonnade_exponent_limit(scene);
    const int32_t scaled = exponent + scene->more_grid_bits + more;
    if (shift > scene->scene_bits || scaled < -limit - 1 || scaled > limit) return false;

    uint32_t *to = colonnade_computed(view) + VIEW_ENVIRONMENT;
    for (int i = 0; i < 9; ++i) to = colonnade_set_mac(scene, to, colonnade_nearest(matrix[i / 3][i % 3], down), more);
    for (int row = 0; row < 3; ++row)
        to = colonnade_set_mac(scene, to, colonnade_nearest(offset[row], whole + shift), more);
    *to++ = (uint32_t)(shift + scene->more_grid_bits);
    *to++ = (uint32_t)scaled & (2 * (uint32_t)limit + 1);
    for (int i = 0; i < 9; ++i)
        *to++ = colonnade_bits(colonnade_nearest(work->axes[i % 3][i / 3], 60 - ROTATION_FRACTION), 16);
    return true;
}

/* Lengths from the eye, in 2^unit steps of 2^-16, of 28 bits. */
struct lengths {
    int unit;
    int32_t rows[2][3][3]; /* axes of the camera, and of the world, in the object's axes, 2^-30 */
    int32_t planes[3][2];  /* the object's box */
    int32_t lights[COLONNADE_VIEW_LIGHTS][3];
    int32_t walls[3][2]; /* the room's box, in the world's axes */
};

/* The product of a camera's or the world's axis with a vector in the object's axes. */
static int32_t find_along(const int32_t row[3], const int32_t x, const int32_t y, const int32_t z) {
    return (int32_t)colonnade_nearest((int64_t)row[0] * x + (int64_t)row[1] * y + (int64_t)row[2] * z, 30);
}

static void find_lengths(const struct colonnade_view *view, const struct colonnade_pose *pose,
                         const struct colonnade_work *work, struct lengths *lengths) {
    const struct colonnade_view_scene *scene = &view->scene;
    const int64_t limit = (int64_t)1 << 60;
    int64_t planes[3][2], walls[3][2];
    uint64_t most = (uint64_t)1 << (scene->vertex_bits + scene->grid_fraction + 16);
    for (int axis = 0; axis < 3; ++axis) {
        const int fraction = scene->grid_fraction + 16;
        planes[axis][0] = colonnade_shift_left(scene->low[axis], fraction) - work->eye[axis];
        planes[axis][1] = colonnade_shift_left(scene->high[axis], fraction) - work->eye[axis];
        const int64_t eye = pose->position[axis];
        walls[axis][0] = colonnade_scaled(scene->room_low[axis] - eye, &scene->steps, 16, limit);
        walls[axis][1] = colonnade_scaled(scene->room_high[axis] - eye, &scene->steps, 16, limit);
        for (int side = 0; side < 2; ++side)
            most |= colonnade_magnitude(planes[axis][side]) | colonnade_magnitude(walls[axis][side]);
        for (uint32_t i = 0; i < scene->lights; ++i)
            most |= colonnade_magnitude(work->lights[i][axis] - work->eye[axis]);
        for (int i = 0; i < 3; ++i) {
            lengths->rows[0][i][axis] = (int32_t)colonnade_nearest(work->axes[i][axis], 30);
            lengths->rows[1][i][axis] = view->object.rotation[i][axis];
        }
    }
    const int unit = colonnade_bit_length(most) - LENGTH_BITS;
    lengths->unit = unit;
    for (int axis = 0; axis < 3; ++axis) {
        for (int side = 0; side < 2; ++side) {
            lengths->planes[axis][side] = (int32_t)colonnade_nearest(planes[axis][side], unit);
            lengths->walls[axis][side] = (int32_t)colonnade_nearest(walls[axis][side], unit);
        }
        for (uint32_t i = 0; i < scene->lights; ++i)
            lengths->lights[i][axis] = (int32_t)colonnade_nearest(work->lights[i][axis] - work->eye[axis], unit);
    }
}

/* Corners of the object's box with a margin, in vertex units, along the axes of the camera (0) or of the world (1). */
static void find_corners(const struct colonnade_view_scene *scene, const struct lengths *lengths, int which,
                         int32_t margin, int32_t corners[8][3]) {
    const int32_t wider =
        (int32_t)colonnade_nearest(colonnade_shift_left(margin, scene->grid_fraction + 16), lengths->unit) +
        (margin != 0 ? 2 : 0); /* the rounding of corners and lights */
    for (int corner = 0; corner < 8; ++corner)
        for (int i = 0; i < 3; ++i) {
            int32_t point[3];
            for (int axis = 0; axis < 3; ++axis)
                point[axis] = lengths->planes[axis][corner >> axis & 1] + (corner >> axis & 1 ? wider : -wider);
            corners[corner][i] = find_along(lengths->rows[which][i], point[0], point[1], point[2]);
        }
}

static bool include_corners(struct colonnade_extent *extent, int32_t corners[8][3]) {
    for (int corner = 0; corner < 8; ++corner) {
        const int64_t point[3] = {corners[corner][0], corners[corner][1], corners[corner][2]};
        if (!colonnade_include(extent, point)) return false;
    }
    return true;
}

/* A rectangle that may be unbounded: the whole picture. */
struct region {
    struct colonnade_extent extent;
    bool is_whole;
};

static void intersect(struct region *region, const struct colonnade_extent *other) {
    if (region->is_whole) *region = (struct region){*other, false};
    for (int i = 0; i < 2; ++i) {
        if (colonnade_is_less(region->extent.low[i], other->low[i])) region->extent.low[i] = other->low[i];
        if (colonnade_is_less(other->high[i], region->extent.high[i])) region->extent.high[i] = other->high[i];
    }
}

static void unite(struct region *region, const struct region *other) {
    region->is_whole |= other->is_whole;
    if (region->is_whole) return;
    if (region->extent.is_empty) region->extent = other->extent;
    for (int i = 0; i < 2; ++i) {
        if (colonnade_is_less(other->extent.low[i], region->extent.low[i]))
            region->extent.low[i] = other->extent.low[i];
        if (colonnade_is_less(region->extent.high[i], other->extent.high[i]))
            region->extent.high[i] = other->extent.high[i];
    }
}

/* Where the shadow of the box by one light may be seen. The shadow is {c + t (c - L)} with c in the box and t >= 0; all
 * of the room's surface is on the inner side of each wall. Where all corners' rays go towards a wall, the part of the
 * shadow on its inner side is in the hull of the corners and of the points where these rays meet the wall. */
static struct region find_shadow(const struct lengths *lengths, uint32_t light, const struct colonnade_extent *box,
                                 int32_t corners[8][3], int32_t in_world[8][3]) {
    struct region region = {*box, false};
    const int32_t *place = lengths->lights[light];
    int32_t seen[3];
    for (int i = 0; i < 3; ++i) seen[i] = find_along(lengths->rows[0][i], place[0], place[1], place[2]);
    for (int corner = 0; corner < 8 && !region.is_whole; ++corner) { /* the shadow without an end */
        int64_t direction[3];
        for (int i = 0; i < 3; ++i) direction[i] = (int64_t)corners[corner][i] - seen[i];
        region.is_whole = !colonnade_include(&region.extent, direction);
    }
    for (int wall = 0; wall < 6; ++wall) {
        const int axis = wall / 2, sign = wall & 1 ? 1 : -1;
        const int32_t at = find_along(lengths->rows[1][axis], place[0], place[1], place[2]);
        int64_t towards[8], ahead[8], least_towards = INT64_MAX, least_ahead = 0;
        for (int corner = 0; corner < 8; ++corner) {
            towards[corner] = sign * ((int64_t)in_world[corner][axis] - at);
            ahead[corner] = sign * ((int64_t)lengths->walls[axis][wall & 1] - in_world[corner][axis]);
            if (towards[corner] < least_towards) least_towards = towards[corner];
            if (ahead[corner] < least_ahead) least_ahead = ahead[corner];
        }
        if (least_towards <= 0) continue;
        struct colonnade_extent extent = *box;
        bool is_bounded = true;
        for (int corner = 0; corner < 8 && is_bounded; ++corner) {
            /* A box that reaches through the wall moves it */
            const int64_t way = ahead[corner] - least_ahead;
            int64_t point[3];
            for (int i = 0; i < 3; ++i)
                point[i] = corners[corner][i] * towards[corner] + way * ((int64_t)corners[corner][i] - seen[i]);
            is_bounded = colonnade_include(&extent, point);
        }
        if (is_bounded) intersect(&region, &extent);
    }
    return region;
}

/* floor of a picture's coordinate: focal * ratio + centre, within +-2^28. The focal length is rounded to 32 bits. */
static int32_t find_pixel(struct colonnade_ratio ratio, int64_t focal, int64_t centre) {
    const int down = focal >> 48 == 0 ? 16 : 25, fraction = 32 - down;
    const uint64_t size = colonnade_magnitude(ratio.over) * (uint64_t)(focal >> down) / (uint32_t)ratio.under;
    const uint64_t limit = (uint64_t)1 << (27 + fraction);
    const int64_t from = colonnade_signed(size < limit ? size : limit, ratio.over < 0) - (ratio.over < 0);
    return (int32_t)colonnade_floor(from + (centre >> down), fraction);
}

static uint32_t clip(int32_t pixel, uint32_t size) {
    if (pixel < 0) return 0;
    return (uint32_t)pixel > size ? size : (uint32_t)pixel;
}

static void set_window(struct colonnade_view *view, const struct lengths *lengths) {
    const struct colonnade_view_scene *scene = &view->scene;
    const struct colonnade_camera *camera = &view->camera;
    const uint32_t size[2] = {camera->width, camera->height};
    const int64_t *shift = view->sample.shift;
    const int64_t focal[2] = {camera->fx, camera->fy}, centre[2] = {camera->cx - shift[0], camera->cy - shift[1]};
    struct region window = {{.is_empty = true}, scene->window == WINDOW_WHOLE};
    if ((scene->window & WINDOW_SHADOW) != 0) {
        const int32_t margin = ((int32_t)1 << scene->vertex_bits) / MARGIN_PARTS + 1;
        int32_t corners[8][3], in_world[8][3];
        find_corners(scene, lengths, 0, margin, corners);
        find_corners(scene, lengths, 1, margin, in_world);
        struct colonnade_extent box = {.is_empty = true};
        window.is_whole = !include_corners(&box, corners);
        for (uint32_t i = 0; i < scene->lights && !window.is_whole; ++i) {
            const struct region shadow = find_shadow(lengths, i, &box, corners, in_world);
            unite(&window, &shadow);
        }
    }
    if ((scene->window & WINDOW_NEAR) != 0 && !window.is_whole) { /* within an edge of the cube from the box */
        int32_t corners[8][3];
        struct region near = {{.is_empty = true}, false};
        find_corners(scene, lengths, 0, (int32_t)1 << scene->vertex_bits, corners);
        near.is_whole = !include_corners(&near.extent, corners);
        unite(&window, &near);
    }
    uint32_t *words = colonnade_computed(view) + VIEW_WINDOW;
    for (int i = 0; i < 2; ++i) {
        words[i] = words[2 + i] = 0;
        if (window.is_whole) words[2 + i] = size[i];
        else if (!window.extent.is_empty) {
            /* A pixel wider, and half a pixel for rays that do not pass through the middle */
            words[i] = clip(find_pixel(window.extent.low[i], focal[i], centre[i]) - 2, size[i]);
            words[2 + i] = clip(find_pixel(window.extent.high[i], focal[i], centre[i]) + 3, size[i]);
        }
    }
    if (words[0] >= words[2] || words[1] >= words[3])
        for (int i = 0; i < 4; ++i) words[i] = 0;
}

/* The tiles of the maps that a box covers, and its depths, 2^-10 m. */
struct cover {
    uint32_t low[2], high[2]; /* exclusive */
    int64_t near_depth, far_depth;
};

static struct cover find_cover(const struct colonnade_view *view, const struct lengths *lengths, int32_t margin) {
    const struct colonnade_view_scene *scene = &view->scene;
    const uint32_t tiles[2] = {scene->tile_columns, scene->tile_rows};
    int32_t corners[8][3];
    find_corners(scene, lengths, 0, margin, corners);
    struct colonnade_extent extent = {.is_empty = true};
    const bool is_before = include_corners(&extent, corners);
    int64_t near_depth = corners[0][2], far_depth = corners[0][2];
    for (int corner = 1; corner < 8; ++corner) {
        if (corners[corner][2] < near_depth) near_depth = corners[corner][2];
        if (corners[corner][2] > far_depth) far_depth = corners[corner][2];
    }
    struct cover cover;
    const int64_t limit = (int64_t)1 << 40;
    cover.near_depth = colonnade_scaled(near_depth, &scene->metres, 6 - lengths->unit, limit) - 1;
    cover.far_depth = colonnade_scaled(far_depth, &scene->metres, 6 - lengths->unit, limit) + 1;
    for (int i = 0; i < 2; ++i) {
        cover.low[i] = 0;
        cover.high[i] = tiles[i];
        if (!is_before) continue;
        const int64_t focal = scene->map_lens[i], centre = scene->map_lens[2 + i];
        const int32_t tile = (int32_t)scene->tile_size;
        const int32_t low = find_pixel(extent.low[i], focal, centre) - 1,
                      high = find_pixel(extent.high[i], focal, centre) + 1;
        cover.low[i] = clip(low / tile, tiles[i]);
        cover.high[i] = high < 0 ? 0 : clip(high / tile + 1, tiles[i]);
    }
    return cover;
}

/* The room may hide the object where a tile under its box is nearer than the box's end; from a camera other than
 * the maps', always. The tolerance is twice the largest error of the tiles around the object, from 1/400 of the
 * distance to a tenth of the edge. The lengths are from the maps' camera. */
static void set_occlusion(struct colonnade_view *view, const struct colonnade_work *work,
                          const struct lengths *lengths) {
    const struct colonnade_view_scene *scene = &view->scene;
    uint32_t *words = colonnade_computed(view) + VIEW_WINDOW + 4;
    const int tolerance_words = scene->scene_bits + scene->more_grid_bits > 42 ? 2 : 1;
    words[0] = words[1] = words[2] = 0;
    words[1 + tolerance_words] = view->is_map_camera;
    if (scene->occlusion == 0) return;
    const struct cover around = find_cover(view, lengths, (int32_t)1 << (scene->vertex_bits - 1));
    const struct cover box = find_cover(view, lengths, 0);
    uint32_t error = 0;
    bool is_near = false, may_hide = !view->is_map_camera;
    for (uint32_t row = around.low[1]; row < around.high[1]; ++row)
        for (uint32_t column = around.low[0]; column < around.high[0]; ++column) {
            const size_t tile = 2 * ((size_t)row * scene->tile_columns + column);
            const uint32_t depths = colonnade_word(scene->tiles, tile);
            const uint32_t near_depth = depths & 0xFFFF, far_depth = depths >> 16;
            may_hide |= row >= box.low[1] && row < box.high[1] && column >= box.low[0] && column < box.high[0] &&
                        near_depth < box.far_depth;
            if (far_depth < around.near_depth || near_depth > around.far_depth) continue;
            const uint32_t found = colonnade_word(scene->tiles, tile + 1);
            if (found > error) error = found;
            is_near = true;
        }
    if (!may_hide) return;
    int64_t distance = 0;
    for (int axis = 0; axis < 3; ++axis) {
        const int64_t middle = colonnade_shift_left(scene->low[axis] + scene->high[axis], scene->grid_fraction + 15);
        const int64_t size = (int64_t)colonnade_magnitude(colonnade_floor(middle - work->eye[axis], 16));
        if (size > distance) distance = size;
    }
    const int64_t low = distance / 400, high = scene->edge / 10 > low ? scene->edge / 10 : low;
    int64_t tolerance = colonnade_scaled((int64_t)error << 17, &scene->steps, 32, high);
    if (!is_near) tolerance = high;
    if (tolerance < low) tolerance = low;
    if (tolerance > scene->max_tolerance) tolerance = scene->max_tolerance;
    const uint64_t in_steps = (uint64_t)tolerance << scene->more_grid_bits;
    words[0] = 1;
    words[1] = (uint32_t)in_steps;
    if (tolerance_words > 1) words[2] = (uint32_t)(in_steps >> 32);
}

enum colonnade_error colonnade_view_room(struct colonnade_view *view, const struct colonnade_work *work) {
    struct colonnade_work maps = *work;
    struct lengths lengths;
    if (!view->is_map_camera && !colonnade_find_sight(view, &view->scene.map_pose, &maps)) return COLONNADE_TOO_FAR;
    if (!set_projection(view, &maps)) return COLONNADE_TOO_FAR;
    if (view->scene.window == WINDOW_CONSTANT) return COLONNADE_OK;
    find_lengths(view, &view->camera.pose, work, &lengths);
    set_window(view, &lengths);
    if (!view->is_map_camera) find_lengths(view, &view->scene.map_pose, &maps, &lengths);
    set_occlusion(view, work, &lengths);
    return COLONNADE_OK;
}
