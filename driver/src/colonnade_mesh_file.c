/* SPDX-License-Identifier: Apache-2.0 */
/* Reads clip files: docs/driver.md. */
#include "colonnade_integers.h"
#include "colonnade_mesh_parts.h"

enum { VERSION = 1, HEADER_WORDS = 12, NUMBER_WORDS = 16, FIELDS = 85, FIELD_WORD = HEADER_WORDS + NUMBER_WORDS };
enum { FIXED_WORDS = FIELD_WORD + (FIELDS + 3) / 4, MOST = 1 << 24 };

/* The bit behind vectors of so many fields that follow one another from a bit on, the last field of each lowest; more
 * than a record has, if their places, which it reads, are others. */
static int follow(const uint8_t **places, int vectors, int size, int width, int bit) {
    bool is_good = true;
    for (int vector = 0; vector < vectors; ++vector, *places += size)
        for (int i = size; i-- > 0; bit += width) is_good &= (*places)[i] == bit;
    return is_good ? bit : RECORD_BITS + 1;
}

/* Whether fields have the places in which they are written. The file has them in the order of the calls. */
static bool are_fields(const struct colonnade_mesh *mesh, const uint8_t *places) {
    const int vertex = mesh->vertex_bits, high = OCTAHEDRAL_BITS - 1;
    int node = follow(&places, 2 * COLONNADE_MESH_CHILDREN, 3, mesh->box_bits, 0);
    node = follow(&places, 1, 3, vertex + 1, node);
    node = follow(&places, 1, 1, mesh->address_bits, node);
    node = follow(&places, 2, 1, COUNT_BITS, node);
    const int flat = follow(&places, 4, 3, vertex, 0), deltas = follow(&places, 3, 3, mesh->delta_bits, 3 * vertex);
    const int far_pair = follow(&places, 3, 3, 1, deltas + 4 * 2 * high);
    const int triangle = follow(&places, 3, 2, OCTAHEDRAL_BITS, 3 * 3 * vertex);
    const int near_pair = follow(&places, 4, 2, 1, follow(&places, 4, 2, high, deltas));
    return node <= RECORD_BITS && flat <= LEAF_HEAD && far_pair <= LEAF_HEAD && triangle <= LEAF_HEAD &&
           near_pair <= LEAF_HEAD && places[0] == LEAF_HEAD + KEPT_BITS && places[1] == LEAF_HEAD &&
           places[2] == LEAF_HEAD + KEPT_BITS - 1;
}

static bool read_numbers(struct colonnade_mesh *mesh, const uint8_t *bytes) {
    int32_t numbers[NUMBER_WORDS];
    for (int i = 0; i < NUMBER_WORDS; ++i) numbers[i] = colonnade_signed_word(bytes, (size_t)(HEADER_WORDS + i));
    *mesh = (struct colonnade_mesh){
        .vertex_bits = numbers[0],
        .delta_bits = numbers[1],
        .box_bits = numbers[2],
        .address_bits = numbers[3],
        .leaf_records = (uint32_t)numbers[4],
        .records = (uint32_t)numbers[5],
        .depth = (uint32_t)numbers[6],
        .vertices = (uint32_t)numbers[7],
        .leaves = (uint32_t)numbers[8],
        .bones = (uint32_t)numbers[9],
        .targets = (uint32_t)numbers[10],
        .changes = (uint32_t)numbers[11],
        .keys = (uint32_t)numbers[12],
        .duration = (uint32_t)numbers[13],
        .linear_shift = numbers[14],
        .shift = numbers[15],
    };
    return colonnade_is_within(mesh->vertex_bits, 10, 24) && colonnade_is_within(mesh->delta_bits, 4, 24) &&
           colonnade_is_within(mesh->box_bits, 4, 7) && colonnade_is_within(mesh->address_bits, 4, 22) &&
           colonnade_is_within(numbers[4], 1, 2) && colonnade_is_within(numbers[5], 2, 1 << 22) &&
           colonnade_is_within(numbers[6], 1, 257) && colonnade_is_within(numbers[7], 1, MOST) &&
           colonnade_is_within(numbers[8], 1, MOST) && colonnade_is_within(numbers[9], 1, 1 << 16) &&
           colonnade_is_within(numbers[10], 0, 1 << 16) && colonnade_is_within(numbers[11], 0, MOST) &&
           colonnade_is_within(numbers[12], 1, MOST) && colonnade_is_within(mesh->linear_shift, 0, 32) &&
           colonnade_is_within(mesh->shift, 2, 20);
}

static bool are_vertices(const struct colonnade_mesh *mesh) {
    for (size_t i = 0; i < mesh->vertices; ++i) {
        const uint8_t *at = mesh->vertex_words + 4 * VERTEX_WORDS * i, *halves = at + 4 * 3;
        uint32_t others = 0;
        for (size_t axis = 0; axis < 3; ++axis)
            if (colonnade_magnitude(colonnade_signed_word(at, axis)) >> BOUND_BITS != 0) return false;
        for (size_t k = 0; k < 4; ++k)
            if (colonnade_half(halves, 3 + k) >= mesh->bones) return false;
        for (size_t k = 0; k < 3; ++k) others += colonnade_half(halves, 7 + k);
        if (others > 1 << WEIGHT_BITS) return false;
    }
    return true;
}

static bool are_leaves(const struct colonnade_mesh *mesh) {
    for (size_t i = 0; i < (size_t)LEAF_WORDS * mesh->leaves; ++i) {
        const uint32_t vertex = colonnade_word(mesh->leaf_words, i);
        const bool is_none = i % LEAF_WORDS == 3 && vertex >> 16 == COLONNADE_MESH_NO_VERTEX;
        if (vertex >= mesh->vertices && !is_none) return false;
    }
    return true;
}

/* Changes ascend by vertex. */
static bool are_changes(const struct colonnade_mesh *mesh) {
    uint32_t last = 0;
    for (size_t i = 0; i < mesh->changes; ++i) {
        const uint8_t *at = mesh->change_words + 4 * CHANGE_WORDS * i;
        const uint32_t vertex = colonnade_word(at, 0);
        if (vertex < last || vertex >= mesh->vertices || colonnade_half(at + 4 * 4, 3) >= mesh->targets) return false;
        for (size_t axis = 0; axis < 3; ++axis)
            if (colonnade_magnitude(colonnade_signed_word(at, 1 + axis)) >> BOUND_BITS != 0) return false;
        last = vertex;
    }
    return true;
}

bool colonnade_are_keys(const struct colonnade_keys *keys) {
    uint32_t last = 0;
    for (size_t key = 0; key < keys->count; ++key) {
        const uint8_t *at = keys->words + 4 * (1 + (size_t)keys->numbers) * key;
        if (colonnade_word(at, 0) < last || (key == 0 && colonnade_word(at, 0) != 0)) return false;
        last = colonnade_word(at, 0);
        for (size_t i = 0; i < keys->numbers; ++i)
            if (colonnade_magnitude(colonnade_signed_word(at, 1 + i)) >>
                    (i < keys->of_matrices ? MATRIX_BITS : TARGET_BITS) !=
                0)
                return false;
    }
    return last == keys->duration;
}

enum colonnade_error colonnade_mesh_open(struct colonnade_mesh *mesh, const struct colonnade_design *design,
                                         const void *data, size_t bytes) {
    const uint8_t *words = data;
    const enum colonnade_error error =
        colonnade_check_header(design, words, bytes, 4 * FIXED_WORDS, "CLNDCLIP", VERSION, COLONNADE_NOT_A_CLIP);
    if (error != COLONNADE_OK) return error;
    struct colonnade_mesh found;
    if (!read_numbers(&found, words) || !are_fields(&found, words + 4 * FIELD_WORD)) return COLONNADE_NOT_A_CLIP;
    const uint64_t leaves = FIXED_WORDS + (uint64_t)VERTEX_WORDS * found.vertices;
    const uint64_t changes = leaves + (uint64_t)LEAF_WORDS * found.leaves;
    const uint64_t keys = changes + (uint64_t)CHANGE_WORDS * found.changes;
    const uint64_t end = keys + (uint64_t)found.keys * (1 + colonnade_mesh_pose_words(&found));
    if (bytes % 4 != 0 || end != bytes / 4) return COLONNADE_TRUNCATED;
    found.vertex_words = words + 4 * FIXED_WORDS;
    found.leaf_words = words + 4 * leaves;
    found.change_words = words + 4 * changes;
    found.key_words = words + 4 * keys;
    const struct colonnade_keys all = {found.key_words, found.keys, colonnade_mesh_pose_words(&found),
                                       MATRIX_WORDS * found.bones, found.duration};
    if (!are_vertices(&found) || !are_leaves(&found) || !are_changes(&found) || !colonnade_are_keys(&all))
        return COLONNADE_NOT_A_CLIP;
    *mesh = found;
    return COLONNADE_OK;
}
