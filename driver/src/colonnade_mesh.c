/* SPDX-License-Identifier: Apache-2.0 */
/* Writes vertices into the records of a mesh: docs/driver.md. */
#include "colonnade_mesh.h"

#include "colonnade_integers.h"
#include "colonnade_mesh_parts.h"

enum format { NEAR_PAIR, TRIANGLE, FLAT_PAIR, FAR_PAIR };

/* A record that is put together. */
struct record {
    uint32_t words[RECORD_WORDS];
};

static void put(struct record *record, uint32_t low, int32_t width, uint32_t value) {
    uint32_t *word = &record->words[low / 32];
    const uint32_t bits = value & (((uint32_t)1 << width) - 1), at = low % 32;
    word[0] |= bits << at;
    if (at + (uint32_t)width > 32) word[1] |= bits >> (32 - at);
}

static uint32_t get(const uint32_t *record, uint32_t low, int32_t width) {
    const uint32_t *word = &record[low / 32], at = low % 32;
    const uint32_t more = at + (uint32_t)width > 32 ? word[1] << (32 - at) : 0;
    return (word[0] >> at | more) & (((uint32_t)1 << width) - 1);
}

static uint32_t *record_at(uint32_t *copy, uint32_t root, uint32_t address) {
    return copy + (size_t)RECORD_WORDS * (address - root);
}

static void store(uint32_t *to, const struct record *record) {
    for (int i = 0; i < RECORD_WORDS; ++i) to[i] = record->words[i];
}

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

static void put_normal(const struct colonnade_mesh *mesh, struct record *record, enum format format, int corner,
                       const int16_t code[2]) {
    for (int i = 0; i < 2; ++i) {
        const int place = 2 * corner + i;
        const uint32_t bits = (uint32_t)(int32_t)code[i];
        if (format == TRIANGLE) put(record, mesh->fields[FIELD_NORMALS + place], OCTAHEDRAL_BITS, bits);
        else put(record, mesh->fields[FIELD_HIGH_NORMALS + place], OCTAHEDRAL_BITS - 1, bits >> 1);
        if (format == NEAR_PAIR) put(record, mesh->fields[FIELD_LOW_NORMALS + place], 1, bits);
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
    struct record record = {{0}};
    const uint8_t *fields = mesh->fields;
    for (int i = 0; i < count; ++i) corners[i] = &vertices[colonnade_word(words, (size_t)i)];
    const enum format format = is_pair ? format_of(mesh, corners) : TRIANGLE;
    put(&record, fields[FIELD_FORMAT], 2, format);
    put(&record, fields[FIELD_MATERIAL], 8, get(to, fields[FIELD_MATERIAL], 8));
    put(&record, fields[FIELD_IS_CLEAR], 1, get(to, fields[FIELD_IS_CLEAR], 1));
    for (int axis = 0; axis < 3; ++axis) low[axis] = high[axis] = corners[0]->position[axis];
    for (int i = 0; i < count; ++i) {
        const int32_t *at = corners[i]->position, *from = corners[0]->position;
        const bool is_relative = i > 0 && (format == NEAR_PAIR || format == FAR_PAIR);
        for (int axis = 0; axis < 3; ++axis) {
            const int place = 3 * i + axis;
            const uint32_t delta = (uint32_t)(at[axis] - from[axis]);
            if (!is_relative) put(&record, fields[FIELD_VERTICES + place], mesh->vertex_bits, (uint32_t)at[axis]);
            else put(&record, fields[FIELD_DELTAS + place - 3], mesh->delta_bits, delta);
            if (is_relative && format == FAR_PAIR) put(&record, fields[FIELD_SIGNS + place - 3], 1, delta >> 31);
        }
        widen(low, high, at, at);
        if (format != FLAT_PAIR) put_normal(mesh, &record, format, i, corners[i]->normal);
    }
    store(to, &record);
    return format == FLAT_PAIR;
}

/* Writes a node from its children's boxes; where they lie stays. Answers its own box. */
static void write_node(const struct colonnade_mesh *mesh, const struct colonnade_mesh_node *node, uint32_t *to, int32_t low[3],
                       int32_t high[3]) {
    struct record record = {{0}};
    const uint8_t *fields = mesh->fields;
    const int32_t most = ((int32_t)1 << mesh->box_bits) - 1;
    for (int axis = 0; axis < 3; ++axis) low[axis] = node->low[0][axis], high[axis] = node->high[0][axis];
    for (uint32_t child = 1; child < node->children; ++child) widen(low, high, node->low[child], node->high[child]);
    for (int axis = 0; axis < 3; ++axis) {
        int32_t exponent = colonnade_bit_length((uint32_t)(high[axis] - low[axis])) - mesh->box_bits;
        if (exponent < 0) exponent = 0;
        while (((high[axis] - 1) >> exponent) + 1 - (low[axis] >> exponent) > most) ++exponent;
        const int32_t origin = low[axis] >> exponent;
        put(&record, fields[FIELD_CORNER + axis], mesh->vertex_bits + 1, (uint32_t)((2 * origin + 1) << exponent));
        for (uint32_t child = 0; child < node->children; ++child) {
            const uint8_t *planes = fields + FIELD_PLANES + 6 * child + axis;
            const int32_t raised = ((node->high[child][axis] - 1) >> exponent) + 1;
            put(&record, planes[0], mesh->box_bits, (uint32_t)((node->low[child][axis] >> exponent) - origin));
            put(&record, planes[3], mesh->box_bits, (uint32_t)(raised - origin));
        }
    }
    put(&record, fields[FIELD_FIRST], mesh->address_bits, get(to, fields[FIELD_FIRST], mesh->address_bits));
    put(&record, fields[FIELD_LEAVES], COUNT_BITS, get(to, fields[FIELD_LEAVES], COUNT_BITS));
    put(&record, fields[FIELD_NODES], COUNT_BITS, get(to, fields[FIELD_NODES], COUNT_BITS));
    store(to, &record);
}

/* The walk over the tree. Children of a node are beside each other, nodes first; subtrees follow depth first, so that both
 * records and leaves are met in their order. */
struct walk {
    const struct colonnade_mesh *mesh;
    const struct colonnade_vertex *vertices;
    uint32_t *copy;
    uint32_t root, next, leaf; /* the next record and the next leaf */
    uint32_t flat_pairs;
};

/* Enters a node and writes its leaves; answers whether it is one of the clip's tree. */
static bool enter(struct walk *walk, struct colonnade_mesh_node *node, uint32_t address) {
    const struct colonnade_mesh *mesh = walk->mesh;
    const uint32_t *record = record_at(walk->copy, walk->root, address);
    const uint32_t nodes = get(record, mesh->fields[FIELD_NODES], COUNT_BITS), step = mesh->leaf_records;
    const uint32_t leaves = get(record, mesh->fields[FIELD_LEAVES], COUNT_BITS);
    node->address = address;
    node->first = get(record, mesh->fields[FIELD_FIRST], mesh->address_bits);
    node->nodes = nodes;
    node->children = nodes + leaves;
    node->next = 0;
    if (node->children == 0 || node->children > COLONNADE_MESH_CHILDREN || node->first != walk->next ||
        nodes + leaves * step > walk->root + mesh->records - walk->next || leaves > mesh->leaves - walk->leaf)
        return false;
    walk->next += nodes + leaves * step;
    for (uint32_t i = 0; i < leaves; ++i) {
        uint32_t *to = record_at(walk->copy, walk->root, node->first + nodes + i * step);
        const uint8_t *words = mesh->leaf_words + 4 * (size_t)LEAF_WORDS * walk->leaf++;
        walk->flat_pairs += write_leaf(mesh, walk->vertices, words, to, node->low[nodes + i], node->high[nodes + i]);
    }
    return true;
}

enum colonnade_error colonnade_mesh_refit(const struct colonnade_mesh *mesh, const struct colonnade_vertex *vertices,
                                          uint32_t *copy, uint32_t root, struct colonnade_mesh_node *path,
                                          struct colonnade_refit *result) {
    struct walk walk = {mesh, vertices, copy, root, root + 1, 0, 0};
    struct colonnade_refit found;
    uint32_t depth = 0;
    if (!enter(&walk, path, root)) return COLONNADE_OTHER_RECORDS;
    for (;;) {
        struct colonnade_mesh_node *node = &path[depth];
        if (node->next < node->nodes) {
            ++depth;
            if (depth == mesh->depth || !enter(&walk, &path[depth], node->first + node->next)) return COLONNADE_OTHER_RECORDS;
            continue;
        }
        write_node(mesh, node, record_at(copy, root, node->address), found.low, found.high);
        if (depth == 0) break;
        node = &path[--depth];
        for (int axis = 0; axis < 3; ++axis) {
            node->low[node->next][axis] = found.low[axis];
            node->high[node->next][axis] = found.high[axis];
        }
        ++node->next;
    }
    if (walk.next != root + mesh->records || walk.leaf != mesh->leaves) return COLONNADE_OTHER_RECORDS;
    found.flat_pairs = walk.flat_pairs;
    *result = found;
    return COLONNADE_OK;
}
