/* SPDX-License-Identifier: Apache-2.0 */
/* Reads view files: docs/formats.md. */
#include "colonnade_view_parts.h"
#include "colonnade_words.h"

enum { VERSION = 3, HEADER_WORDS = 12, FIXED_WORDS = 85, LIGHT_WORDS = 11, ROOM_WORDS = 49, TILE_WORDS = 2 };
enum { MAC_BITS = 32, SCENE_BITS = 40 };

/* Reads a view file word by word; its length is checked before. */
struct reader {
    const uint8_t *bytes;
    size_t next;
};

static uint32_t read_word(struct reader *reader) { return colonnade_word(reader->bytes, reader->next++); }

static int32_t read_signed(struct reader *reader) { return (int32_t)read_word(reader); }

static uint64_t read_wide(struct reader *reader) {
    const uint64_t low = read_word(reader);
    return low | (uint64_t)read_word(reader) << 32;
}

static void read_vector(struct reader *reader, int64_t vector[3]) {
    for (int axis = 0; axis < 3; ++axis) vector[axis] = (int64_t)read_wide(reader);
}

static void read_pose(struct reader *reader, struct colonnade_pose *pose) {
    read_vector(reader, pose->position);
    for (int i = 0; i < 9; ++i) pose->rotation[i / 3][i % 3] = read_signed(reader);
}

static bool read_factor(struct reader *reader, struct colonnade_factor *factor) {
    factor->mantissa = read_wide(reader);
    factor->exponent = read_signed(reader);
    return factor->mantissa >> 63 != 0 && factor->exponent > -256 && factor->exponent < 256;
}

/* A width of at most `most` bits, limited to what is computed; the rest goes to `more`. */
static int32_t read_width(struct reader *reader, int32_t limit, int32_t most, int32_t *more) {
    const int32_t bits = read_signed(reader);
    *more = bits > limit && bits <= most ? bits - limit : 0;
    return bits - *more;
}

static bool read_numbers(struct reader *reader, struct colonnade_view_scene *scene) {
    scene->mac_bits = read_width(reader, MAC_BITS, 64, &scene->more_mac_bits);
    scene->scene_bits = read_width(reader, SCENE_BITS, 72, &scene->more_grid_bits);
    const int32_t fraction = read_signed(reader);
    const bool is_fraction = colonnade_is_within(fraction, -12, 64);
    scene->grid_fraction = is_fraction ? fraction - scene->more_grid_bits : 0;
    scene->coordinate_bits = read_signed(reader);
    scene->box_pad_log = read_signed(reader);
    scene->mantissa_bits = read_signed(reader);
    scene->vertex_bits = read_signed(reader);
    scene->max_width = read_word(reader);
    scene->max_height = read_word(reader);
    scene->exposure = read_word(reader);
    scene->frame_address = read_word(reader);
    scene->camera_address = read_word(reader);
    scene->lights_address = read_word(reader);
    scene->environment_address = read_word(reader);
    scene->window_address = read_word(reader);
    scene->gather_address = read_word(reader);
    return colonnade_is_within(scene->mac_bits, 16, MAC_BITS) &&
           colonnade_is_within(scene->scene_bits, 16, SCENE_BITS) && is_fraction &&
           colonnade_is_within(scene->grid_fraction, -12, 19) && colonnade_is_within(scene->coordinate_bits, 4, 13) &&
           colonnade_is_within(scene->box_pad_log, 0, 24) && colonnade_is_within(scene->mantissa_bits, 8, 32) &&
           colonnade_is_within(scene->vertex_bits, 8, 24) && scene->max_width <= 4096 && scene->max_height <= 4096;
}

static bool read_mesh(struct reader *reader, struct colonnade_view_scene *scene) {
    bool is_good = read_factor(reader, &scene->steps);
    read_vector(reader, scene->offset);
    for (int axis = 0; axis < 3; ++axis) scene->low[axis] = read_signed(reader);
    for (int axis = 0; axis < 3; ++axis) scene->high[axis] = read_signed(reader);
    for (int axis = 0; axis < 3; ++axis)
        is_good &= colonnade_is_within(scene->low[axis], 0, scene->high[axis]) &&
                   colonnade_is_within(scene->high[axis], 0, ((int64_t)1 << scene->vertex_bits) - 1);
    return is_good && colonnade_is_place(scene->offset);
}

static bool read_room(struct reader *reader, struct colonnade_view_scene *scene) {
    bool is_good = read_factor(reader, &scene->metres);
    is_good &= read_factor(reader, &scene->projection);
    int64_t *lens = scene->map_lens;
    for (int i = 0; i < 4; ++i) lens[i] = (int64_t)read_wide(reader);
    is_good &= colonnade_is_lens(lens[0], lens[1], lens[2], lens[3]);
    read_pose(reader, &scene->map_pose);
    read_vector(reader, scene->room_low);
    read_vector(reader, scene->room_high);
    scene->window = read_word(reader);
    scene->occlusion = read_word(reader);
    scene->edge = read_word(reader);
    scene->max_tolerance = read_word(reader);
    scene->tile_size = read_word(reader);
    scene->tile_columns = read_word(reader);
    scene->tile_rows = read_word(reader);
    return is_good && colonnade_is_place(scene->room_low) && colonnade_is_place(scene->room_high) &&
           scene->tile_size >= 1 && scene->tile_size <= 4096 && scene->tile_columns <= 4096 && scene->tile_rows <= 4096;
}

enum colonnade_error colonnade_view_open(struct colonnade_view *view, const struct colonnade_design *design,
                                         const void *data, size_t bytes) {
    const size_t words = bytes / 4;
    enum colonnade_error error =
        colonnade_check_header(design, data, bytes, 4 * FIXED_WORDS, "CLNDVIEW", VERSION, COLONNADE_NOT_A_VIEW);
    if (error != COLONNADE_OK) return error;
    if (bytes % 4 != 0) return COLONNADE_TRUNCATED;
    struct reader reader = {data, HEADER_WORDS};
    struct colonnade_view found = {.is_known = false};
    struct colonnade_view_scene *scene = &found.scene;
    const bool is_good = read_numbers(&reader, scene);
    scene->lights = read_word(&reader);
    scene->constants = read_word(&reader);
    if (!is_good || scene->lights > COLONNADE_VIEW_LIGHTS || !read_mesh(&reader, scene)) return COLONNADE_NOT_A_VIEW;

    struct colonnade_pose object;
    struct colonnade_camera camera;
    read_pose(&reader, &object);
    read_pose(&reader, &camera.pose);
    camera.fx = (int64_t)read_wide(&reader);
    camera.fy = (int64_t)read_wide(&reader);
    camera.cx = (int64_t)read_wide(&reader);
    camera.cy = (int64_t)read_wide(&reader);
    camera.width = read_word(&reader);
    camera.height = read_word(&reader);
    const bool has_room = scene->environment_address != 0;
    if (words - reader.next < LIGHT_WORDS * scene->lights + (has_room ? ROOM_WORDS : 0)) return COLONNADE_TRUNCATED;
    struct colonnade_light lights[COLONNADE_VIEW_LIGHTS];
    for (uint32_t i = 0; i < scene->lights; ++i) {
        read_vector(&reader, lights[i].position);
        for (int channel = 0; channel < 3; ++channel) lights[i].colour[channel] = read_word(&reader);
        lights[i].reach = read_wide(&reader);
    }
    size_t tiles = 0;
    if (has_room) {
        found.is_map_camera = read_word(&reader) != 0;
        if (!read_room(&reader, scene)) return COLONNADE_NOT_A_VIEW;
        if (!colonnade_is_pose(&scene->map_pose)) return COLONNADE_BAD_POSE;
        tiles = (size_t)scene->tile_columns * scene->tile_rows;
    }
    const size_t left = words - reader.next;
    if (tiles > left / TILE_WORDS || scene->constants != (left - TILE_WORDS * tiles) / 2 || left % 2 != 0)
        return COLONNADE_TRUNCATED;
    scene->tiles = reader.bytes + 4 * reader.next;
    scene->writes = scene->tiles + 4 * TILE_WORDS * tiles;

    struct colonnade_block blocks[COLONNADE_MAX_BLOCKS];
    const int block_count = colonnade_find_blocks(scene, blocks);
    for (int i = 0; i < block_count; ++i)
        if (!colonnade_are_frame_registers(design, blocks[i].address, blocks[i].count)) return COLONNADE_BAD_REGISTER;
    for (size_t i = 0; i < scene->constants; ++i)
        if (!colonnade_are_frame_registers(design, colonnade_word(scene->writes, 2 * i), 1))
            return COLONNADE_BAD_REGISTER;

    error = colonnade_check_camera(scene, &camera);
    found.camera = camera;
    if (error == COLONNADE_OK) error = colonnade_view_set_object(&found, &object);
    for (uint32_t i = 0; error == COLONNADE_OK && i < scene->lights; ++i)
        error = colonnade_view_set_light(&found, i, &lights[i]);
    if (error == COLONNADE_OK) error = colonnade_view_set_sample(&found, 0, 1);
    if (error == COLONNADE_OK) *view = found;
    return error;
}
