/* SPDX-License-Identifier: Apache-2.0 */
/* Writes vertices into the records of a mesh: docs/driver.md. */
#include "colonnade_mesh.h"

#include "colonnade_integers.h"
#include "colonnade_mesh_parts.h"

enum format { NEAR_PAIR, TRIANGLE, FLAT_PAIR, FAR_PAIR };

/* The format of a pair: near or far, by its largest delta, else flat. */
static enum format format_of(const struct colonnade_mesh *mesh, const struct colonnade_vertex *const corners[4]) {
    uint32_t reach = 0;
    for (int i = 1; i < 4; ++i)
        for (int axis = 0; axis < 3; ++axis) {
            const int32_t delta = corners[i]->position[axis] - corners[0]->position[axis];
            reach |= (uint32_t)(delta < 0 ? ~delta : delta);
        }
    if (reach >> (mesh->delta_bits - 1) == 0) return NEAR_PAIR;
    return reach >> mesh->delta_bits == 0 ? FAR_PAIR : FLAT_PAIR;
}

static void put_normal(const struct colonnade_mesh *mesh, struct colonnade_record *record, enum format format, int corner,
                       const int16_t code[2]) {
    for (int i = 0; i < 2; ++i) {
        const int place = 2 * corner + i;
        const uint32_t bits = (uint32_t)(int32_t)code[i];
        if (format == TRIANGLE) colonnade_put(record, mesh->fields[FIELD_NORMALS + place], OCTAHEDRAL_BITS, bits);
        else colonnade_put(record, mesh->fields[FIELD_HIGH_NORMALS + place], OCTAHEDRAL_BITS - 1, bits >> 1);
        if (format == NEAR_PAIR) colonnade_put(record, mesh->fields[FIELD_LOW_NORMALS + place], 1, bits);
    }
}

static void widen(int32_t low[3], int32_t high[3], const int32_t other_low[3], const int32_t other_high[3]) {
    for (int axis = 0; axis < 3; ++axis) {
        if (other_low[axis] < low[axis]) low[axis] = other_low[axis];
        if (other_high[axis] > high[axis]) high[axis] = other_high[axis];
    }
}

/* Writes a leaf; its material and whether it is clear stay. Answers whether it has become a flat pair. */
static bool write_leaf(const struct colonnade_mesh *mesh, const struct colonnade_vertex *vertices, const uint8_t *words,
                       uint32_t *to, int32_t low[3], int32_t high[3]) {
    const struct colonnade_vertex *corners[4];
    const bool is_pair = colonnade_word(words, 3) >> 16 != COLONNADE_MESH_NO_VERTEX;
    const int count = is_pair ? 4 : 3;
    struct colonnade_record record = {{0}};
    const uint8_t *fields = mesh->fields;
    for (int i = 0; i < count; ++i) corners[i] = &vertices[colonnade_word(words, (size_t)i)];
    const enum format format = is_pair ? format_of(mesh, corners) : TRIANGLE;
    colonnade_put(&record, fields[FIELD_FORMAT], 2, format);
    colonnade_put(&record, fields[FIELD_MATERIAL], 8, colonnade_field(to, fields[FIELD_MATERIAL], 8));
    colonnade_put(&record, fields[FIELD_IS_CLEAR], 1, colonnade_field(to, fields[FIELD_IS_CLEAR], 1));
    for (int axis = 0; axis < 3; ++axis) low[axis] = high[axis] = corners[0]->position[axis];
    for (int i = 0; i < count; ++i) {
        const int32_t *at = corners[i]->position, *from = corners[0]->position;
        const bool is_relative = i > 0 && (format == NEAR_PAIR || format == FAR_PAIR);
        for (int axis = 0; axis < 3; ++axis) {
            const int place = 3 * i + axis;
            const uint32_t delta = (uint32_t)(at[axis] - from[axis]);
            if (!is_relative) colonnade_put(&record, fields[FIELD_VERTICES + place], mesh->vertex_bits, (uint32_t)at[axis]);
            else colonnade_put(&record, fields[FIELD_DELTAS + place - 3], mesh->delta_bits, delta);
            if (is_relative && format == FAR_PAIR) colonnade_put(&record, fields[FIELD_SIGNS + place - 3], 1, delta >> 31);
        }
        widen(low, high, at, at);
        if (format != FLAT_PAIR) put_normal(mesh, &record, format, i, corners[i]->normal);
    }
    colonnade_store(to, &record);
    return format == FLAT_PAIR;
}

/* Writes a node from its children's boxes; where they lie stays. Answers its own box. */
static void write_node(const struct colonnade_mesh *mesh, const struct colonnade_mesh_node *node, uint32_t *to, int32_t low[3],
                       int32_t high[3]) {
    struct colonnade_record record = {{0}};
    const uint8_t *fields = mesh->fields;
    const int32_t most = ((int32_t)1 << mesh->box_bits) - 1;
    for (int axis = 0; axis < 3; ++axis) low[axis] = node->low[0][axis], high[axis] = node->high[0][axis];
    for (uint32_t child = 1; child < node->children; ++child) widen(low, high, node->low[child], node->high[child]);
    for (int axis = 0; axis < 3; ++axis) {
        int32_t exponent = colonnade_bit_length((uint32_t)(high[axis] - low[axis])) - mesh->box_bits;
        if (exponent < 0) exponent = 0;
        while (((high[axis] - 1) >> exponent) + 1 - (low[axis] >> exponent) > most) ++exponent;
        const int32_t origin = low[axis] >> exponent;
        colonnade_put(&record, fields[FIELD_CORNER + axis], mesh->vertex_bits + 1, (uint32_t)((2 * origin + 1) << exponent));
        for (uint32_t child = 0; child < node->children; ++child) {
            const uint8_t *planes = fields + FIELD_PLANES + 6 * child + axis;
            const int32_t raised = ((node->high[child][axis] - 1) >> exponent) + 1;
            colonnade_put(&record, planes[0], mesh->box_bits, (uint32_t)((node->low[child][axis] >> exponent) - origin));
            colonnade_put(&record, planes[3], mesh->box_bits, (uint32_t)(raised - origin));
        }
    }
    colonnade_put(&record, fields[FIELD_FIRST], mesh->address_bits,
                  colonnade_field(to, fields[FIELD_FIRST], mesh->address_bits));
    colonnade_put(&record, fields[FIELD_LEAVES], COUNT_BITS, colonnade_field(to, fields[FIELD_LEAVES], COUNT_BITS));
    colonnade_put(&record, fields[FIELD_NODES], COUNT_BITS, colonnade_field(to, fields[FIELD_NODES], COUNT_BITS));
    colonnade_store(to, &record);
}

/* Enters a node; answers whether it is one of the clip's tree. */
static bool enter(struct colonnade_mesh_walk *walk, uint32_t address) {
    const struct colonnade_mesh *mesh = walk->mesh;
    if (walk->open == mesh->depth) return false;
    const uint32_t *record = walk->copy + (size_t)RECORD_WORDS * (address - walk->root);
    const uint32_t nodes = colonnade_field(record, mesh->fields[FIELD_NODES], COUNT_BITS), step = mesh->leaf_records;
    const uint32_t leaves = colonnade_field(record, mesh->fields[FIELD_LEAVES], COUNT_BITS);
    struct colonnade_mesh_node *node = &walk->path[walk->open++];
    node->address = address;
    node->first = colonnade_field(record, mesh->fields[FIELD_FIRST], mesh->address_bits);
    node->nodes = nodes;
    node->children = nodes + leaves;
    node->next = 0;
    node->leaf = walk->leaf;
    if (node->children == 0 || node->children > COLONNADE_MESH_CHILDREN || node->first != walk->next ||
        nodes + leaves * step > walk->root + mesh->records - walk->next || leaves > mesh->leaves - walk->leaf)
        return false;
    walk->next += nodes + leaves * step;
    walk->leaf += leaves;
    return true;
}

struct colonnade_mesh_node *colonnade_mesh_next(struct colonnade_mesh_walk *walk) {
    if (walk->open == 0) {
        if (walk->next != walk->root) return NULL;
        ++walk->next;
        if (!enter(walk, walk->root)) return NULL;
    }
    for (;;) {
        struct colonnade_mesh_node *node = &walk->path[walk->open - 1];
        if (node->next == node->nodes) break;
        if (!enter(walk, node->first + node->next++)) return NULL;
    }
    return &walk->path[--walk->open];
}

enum colonnade_error colonnade_mesh_end(const struct colonnade_mesh_walk *walk) {
    const struct colonnade_mesh *mesh = walk->mesh;
    const bool is_whole = walk->open == 0 && walk->next == walk->root + mesh->records && walk->leaf == mesh->leaves;
    return is_whole ? COLONNADE_OK : COLONNADE_OTHER_RECORDS;
}

enum colonnade_error colonnade_mesh_copy(const struct colonnade_mesh *mesh, const uint32_t *from, uint32_t from_root,
                                         uint32_t *copy, uint32_t root, struct colonnade_mesh_node *path) {
    struct colonnade_mesh_walk walk = {mesh, from, path, from_root, from_root, 0, 0};
    for (size_t i = 0; i < (size_t)RECORD_WORDS * mesh->records; ++i) copy[i] = from[i];
    for (struct colonnade_mesh_node *node; (node = colonnade_mesh_next(&walk)) != NULL;) {
        uint32_t *to = copy + (size_t)RECORD_WORDS * (node->address - from_root);
        struct colonnade_record change = {{0}};
        colonnade_put(&change, mesh->fields[FIELD_FIRST], mesh->address_bits, node->first ^ (node->first - from_root + root));
        for (int i = 0; i < RECORD_WORDS; ++i) to[i] ^= change.words[i];
    }
    return colonnade_mesh_end(&walk);
}

enum colonnade_error colonnade_mesh_refit(const struct colonnade_mesh *mesh, const struct colonnade_vertex *vertices,
                                          uint32_t *copy, uint32_t root, struct colonnade_mesh_node *path,
                                          struct colonnade_refit *result) {
    struct colonnade_mesh_walk walk = {mesh, copy, path, root, root, 0, 0};
    struct colonnade_refit found = {{0}, {0}, 0, 0};
    uint64_t areas = 0, area = 0;
    for (struct colonnade_mesh_node *node; (node = colonnade_mesh_next(&walk)) != NULL;) {
        for (uint32_t i = node->nodes; i < node->children; ++i) {
            const uint32_t leaf = i - node->nodes;
            uint32_t *to = copy + (size_t)RECORD_WORDS * (node->first + node->nodes + leaf * mesh->leaf_records - root);
            const uint8_t *words = mesh->leaf_words + 4 * (size_t)LEAF_WORDS * (node->leaf + leaf);
            found.flat_pairs += write_leaf(mesh, vertices, words, to, node->low[i], node->high[i]);
        }
        write_node(mesh, node, copy + (size_t)RECORD_WORDS * (node->address - root), found.low, found.high);
        areas += area = colonnade_half_area(found.low, found.high);
        if (walk.open == 0) break;
        struct colonnade_mesh_node *parent = &path[walk.open - 1];
        for (int axis = 0; axis < 3; ++axis) {
            parent->low[parent->next - 1][axis] = found.low[axis];
            parent->high[parent->next - 1][axis] = found.high[axis];
        }
    }
    const enum colonnade_error error = colonnade_mesh_end(&walk);
    found.cost = (uint32_t)(areas / (area / 256 + 1));
    if (error == COLONNADE_OK) *result = found;
    return error;
}
