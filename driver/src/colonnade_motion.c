/* SPDX-License-Identifier: Apache-2.0 */
/* Clip files of instances: docs/driver.md. */
#include "colonnade_motion.h"

#include "colonnade_mesh_parts.h"
#include "colonnade_view_parts.h"

enum { VERSION = 1, HEADER_WORDS = 12, FIXED_WORDS = HEADER_WORDS + 13, OBJECT_WORDS = 11, CLIP_WORDS = 2 };
enum { POSITION_BITS = 20, BOX_WORDS = 6, LIMIT = 1 << 16 };
enum { RECORD_BYTES = 4 * RECORD_WORDS, PAIR_BYTES = 128 /* of lines, which the device reads at once */ };

static uint32_t most(uint32_t a, uint32_t b) { return a > b ? a : b; }

static struct colonnade_keys keys_of(const struct colonnade_motion *motion) {
    const uint32_t numbers = MATRIX_WORDS * motion->objects;
    return (struct colonnade_keys){motion->key_words, motion->keys, numbers, numbers, motion->duration};
}

static void read_object(const struct colonnade_motion *motion, uint32_t index, struct colonnade_object *object) {
    const uint8_t *at = motion->object_words + 4 * (size_t)OBJECT_WORDS * index;
    for (size_t axis = 0; axis < 3; ++axis) {
        object->low[axis] = colonnade_signed_word(at, axis);
        object->high[axis] = colonnade_signed_word(at, 3 + axis);
    }
    object->offset = colonnade_word(at, 6) | (uint64_t)colonnade_word(at, 7) << 32;
    object->root = colonnade_word(at, 8);
    object->material_base = colonnade_word(at, 9);
}

static bool read_numbers(struct colonnade_motion *motion, const uint8_t *bytes) {
    uint32_t numbers[FIXED_WORDS - HEADER_WORDS];
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; ++i) numbers[i] = colonnade_word(bytes, HEADER_WORDS + i);
    *motion = (struct colonnade_motion){
        .world = {(int32_t)numbers[0], (int32_t)numbers[1], (int32_t)numbers[2]},
        .instances_address = numbers[3],
        .bounds_address = numbers[4],
        .offset_address = numbers[5],
        .instance_words = numbers[6],
        .offset_words = numbers[7],
        .objects = numbers[8],
        .keys = numbers[9],
        .duration = numbers[10],
        .shift = (int32_t)numbers[11],
        .clips = numbers[12],
    };
    const struct colonnade_world *world = &motion->world;
    return colonnade_is_within(world->vertex_bits, 10, 24) && colonnade_is_within(world->grid_fraction, -11, 51) &&
           colonnade_is_within(world->vertex_bits + world->grid_fraction, 13, 61) &&
           colonnade_is_within(world->scene_bits, 16, 72) && motion->instance_words >= 1 &&
           motion->instance_words <= colonnade_instance_words(world) && motion->offset_words <= 2 &&
           motion->objects >= 1 && motion->objects <= COLONNADE_INSTANCES && motion->keys >= 1 &&
           motion->keys <= 1 << 24 && colonnade_is_within(motion->shift, 0, POSITION_BITS) &&
           motion->clips <= COLONNADE_INSTANCES;
}

static bool are_objects(const struct colonnade_motion *motion) {
    const int64_t last = ((int64_t)1 << motion->world.vertex_bits) - 1;
    for (uint32_t i = 0; i < motion->objects; ++i) {
        struct colonnade_object object;
        read_object(motion, i, &object);
        for (int axis = 0; axis < 3; ++axis)
            if (!colonnade_is_within(object.low[axis], 0, object.high[axis]) || object.high[axis] > last) return false;
    }
    return true;
}

/* Opens clips, each with its root and its size in bytes before it. They fill the rest of the file. */
static enum colonnade_error open_clips(struct colonnade_motion *motion, const struct colonnade_design *design,
                                       const uint8_t *at, size_t words) {
    uint32_t records = 0;
    for (uint32_t i = 0; i < motion->clips; ++i) {
        struct colonnade_mesh *mesh = &motion->meshes[i];
        if (words < CLIP_WORDS) return COLONNADE_TRUNCATED;
        const uint32_t bytes = colonnade_word(at, 1);
        words -= CLIP_WORDS;
        if (bytes % 4 != 0 || bytes / 4 > words) return COLONNADE_TRUNCATED;
        const enum colonnade_error error = colonnade_mesh_open(mesh, design, at + 4 * CLIP_WORDS, bytes);
        if (error != COLONNADE_OK) return error;
        motion->roots[i][0] = colonnade_word(at, 0);
        motion->vertices = most(motion->vertices, mesh->vertices);
        motion->depth = most(motion->depth, mesh->depth);
        motion->pose_words = most(motion->pose_words, colonnade_mesh_pose_words(mesh));
        records += mesh->records;
        words -= bytes / 4;
        at += 4 * CLIP_WORDS + (size_t)bytes;
    }
    motion->copy_bytes = (records * RECORD_BYTES + PAIR_BYTES - 1) / PAIR_BYTES * PAIR_BYTES;
    return words == 0 ? COLONNADE_OK : COLONNADE_TRUNCATED;
}

enum colonnade_error colonnade_motion_open(struct colonnade_motion *motion, const struct colonnade_design *design,
                                           const void *data, size_t bytes) {
    const uint8_t *at = data;
    const enum colonnade_error error =
        colonnade_check_header(design, at, bytes, 4 * FIXED_WORDS, "CLNDMOVE", VERSION, COLONNADE_NOT_A_CLIP);
    if (error != COLONNADE_OK) return error;
    struct colonnade_motion found;
    if (!read_numbers(&found, at)) return COLONNADE_NOT_A_CLIP;
    const uint64_t keys = FIXED_WORDS + (uint64_t)OBJECT_WORDS * found.objects;
    const uint64_t end = keys + (uint64_t)found.keys * (1 + MATRIX_WORDS * found.objects);
    if (bytes % 4 != 0 || end > bytes / 4) return COLONNADE_TRUNCATED;
    found.object_words = at + 4 * FIXED_WORDS;
    found.key_words = at + 4 * keys;
    if (design->invalidate != 0) {
        found.invalidate_address = (design->invalidate - COLONNADE_DEVICE_BASE) / 4;
        found.count_address = (design->scene - COLONNADE_DEVICE_BASE) / 4;
    }
    const enum colonnade_error clips = open_clips(&found, design, at + 4 * end, (size_t)(bytes / 4 - end));
    if (clips != COLONNADE_OK) return clips;
    const struct colonnade_keys all = keys_of(&found);
    if (!are_objects(&found) || !colonnade_are_keys(&all)) return COLONNADE_NOT_A_CLIP;
    if (!colonnade_are_frame_registers(design, found.instances_address, found.objects * found.instance_words) ||
        !colonnade_are_frame_registers(design, found.bounds_address, BOX_WORDS) ||
        (found.offset_words != 0 && !colonnade_are_frame_registers(design, found.offset_address, found.offset_words)))
        return COLONNADE_BAD_REGISTER;
    *motion = found;
    return COLONNADE_OK;
}

void colonnade_motion_transforms(const struct colonnade_motion *motion, uint32_t time,
                                 struct colonnade_transform *transforms) {
    const struct colonnade_keys keys = keys_of(motion);
    int32_t pose[MATRIX_WORDS * COLONNADE_INSTANCES];
    colonnade_find_pose(&keys, time, pose);
    for (uint32_t i = 0; i < motion->objects; ++i) {
        const int32_t *matrix = pose + MATRIX_WORDS * i;
        for (int row = 0; row < 3; ++row) {
            for (int column = 0; column < 3; ++column) transforms[i].linear[row][column] = matrix[4 * row + column];
            transforms[i].position[row] = colonnade_shift_left(matrix[4 * row + 3], POSITION_BITS - motion->shift);
        }
        transforms[i].exponent = colonnade_signed_word(motion->object_words, (size_t)OBJECT_WORDS * i + 10);
    }
}

/* A row or column of three numbers by a vector of up to 2^61, to nearest. */
static int64_t turned(const int32_t factors[3], const int64_t vector[3]) {
    int64_t high = 0, low = 0;
    for (int i = 0; i < 3; ++i) {
        high += factors[i] * (vector[i] >> 31);
        low += factors[i] * (vector[i] & INT32_MAX);
    }
    return 2 * high + colonnade_nearest(low, COLONNADE_ROTATION_BITS);
}

enum colonnade_error colonnade_motion_move(const struct colonnade_view *view, const struct colonnade_pose *move,
                                           const int64_t pivot[3], struct colonnade_transform *transform) {
    const int down = view->scene.grid_fraction - POSITION_BITS + 16;
    int64_t from[3], to[3], linear[3][3];
    int32_t rows[3][3];
    if (!colonnade_is_pose(move) || !colonnade_is_place(pivot)) return COLONNADE_BAD_POSE;
    if (!colonnade_is_within(transform->exponent, -LIMIT, LIMIT)) return COLONNADE_OUTSIDE;
    for (int axis = 0; axis < 3; ++axis) {
        if (colonnade_magnitude(transform->position[axis]) >> 50 != 0) return COLONNADE_OUTSIDE;
        to[axis] = pivot[axis] + move->position[axis];
    }
    if (!colonnade_find_on_grid(view, pivot, from) || !colonnade_find_on_grid(view, to, to)) return COLONNADE_TOO_FAR;
    /* The rotation in the axes of the grid */
    for (int b = 0; b < 3; ++b) {
        int64_t column[3], half[3];
        for (int row = 0; row < 3; ++row) column[row] = view->object.rotation[row][b];
        for (int row = 0; row < 3; ++row) half[row] = turned(move->rotation[row], column);
        for (int a = 0; a < 3; ++a) {
            const int32_t axis[3] = {view->object.rotation[0][a], view->object.rotation[1][a],
                                     view->object.rotation[2][a]};
            rows[a][b] = (int32_t)turned(axis, half);
        }
    }
    for (int axis = 0; axis < 3; ++axis) from[axis] = transform->position[axis] - colonnade_nearest(from[axis], down);
    int length = 0;
    for (int a = 0; a < 3; ++a) {
        for (int b = 0; b < 3; ++b) {
            const int64_t column[3] = {transform->linear[0][b], transform->linear[1][b], transform->linear[2][b]};
            linear[a][b] = turned(rows[a], column);
        }
        if (colonnade_block_length(linear[a]) > length) length = colonnade_block_length(linear[a]);
    }
    const int more = length > 30 ? length - 30 : 0;
    for (int a = 0; a < 3; ++a) {
        for (int b = 0; b < 3; ++b) transform->linear[a][b] = (int32_t)colonnade_nearest(linear[a][b], more);
        transform->position[a] = turned(rows[a], from) + colonnade_nearest(to[a], down);
    }
    transform->exponent += more;
    return COLONNADE_OK;
}

enum colonnade_error colonnade_motion_find(const struct colonnade_motion *motion,
                                           const struct colonnade_transform *transforms,
                                           struct colonnade_instance *instances) {
    for (uint32_t i = 0; i < motion->objects; ++i) {
        struct colonnade_object object;
        read_object(motion, i, &object);
        const enum colonnade_error error =
            colonnade_find_instance(&motion->world, &object, &transforms[i], &instances[i]);
        if (error != COLONNADE_OK) return error;
    }
    return COLONNADE_OK;
}

/* Appends a pair of words, unless the device has it. */
static uint8_t *append(uint8_t *to, uint32_t address, uint32_t value, bool is_known, uint32_t before) {
    if (is_known && value == before) return to;
    colonnade_write_word(to, address);
    colonnade_write_word(to + 4, value);
    return to + 8;
}

static bool has_other_root(const struct colonnade_motion *motion, const struct colonnade_instance *instances,
                           const struct colonnade_instance *before) {
    const uint32_t root = colonnade_instance_root(&motion->world);
    bool is_other = false;
    for (uint32_t i = 0; i < motion->objects; ++i) is_other |= instances[i].words[root] != before[i].words[root];
    return is_other;
}

uint32_t colonnade_motion_writes(const struct colonnade_motion *motion, const struct colonnade_instance *instances,
                                 const struct colonnade_instance *before, uint8_t *writes) {
    const bool is_known = before != NULL;
    const struct colonnade_instance *old = is_known ? before : instances;
    const struct colonnade_shared now = colonnade_find_shared(instances, motion->objects);
    const struct colonnade_shared last = colonnade_find_shared(old, motion->objects);
    uint8_t *to = writes;
    for (uint32_t i = 0; i < motion->objects; ++i)
        for (uint32_t word = 0; word < motion->instance_words; ++word)
            to = append(to, motion->instances_address + motion->instance_words * i + word, instances[i].words[word],
                        is_known, old[i].words[word]);
    for (uint32_t axis = 0; axis < 3; ++axis) {
        to = append(to, motion->bounds_address + axis, (uint32_t)now.low[axis], is_known, (uint32_t)last.low[axis]);
        to = append(to, motion->bounds_address + 3 + axis, (uint32_t)now.high[axis], is_known,
                    (uint32_t)last.high[axis]);
    }
    for (uint32_t word = 0; word < motion->offset_words; ++word)
        to = append(to, motion->offset_address + word, (uint32_t)(now.offset >> (32 * word)), is_known,
                    (uint32_t)(last.offset >> (32 * word)));
    if (motion->records != 0 && (!is_known || has_other_root(motion, instances, before))) {
        to = append(to, motion->invalidate_address, 1, false, 0);
        to = append(to, motion->count_address, motion->records, false, 0);
    }
    return (uint32_t)((to - writes) / 8);
}
