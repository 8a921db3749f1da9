/* SPDX-License-Identifier: Apache-2.0 */
/* Writes vertices into the records of a mesh: docs/driver.md. */
#include "colonnade_mesh.h"

#include "colonnade_integers.h"
#include "colonnade_mesh_parts.h"

enum format { NEAR_PAIR, TRIANGLE, FLAT_PAIR, FAR_PAIR };

static void put_position(struct colonnade_writer *writer, const int32_t position[3], uint32_t bits) {
    for (int axis = 3; axis-- > 0;) colonnade_put(writer, colonnade_low_bits((uint32_t)position[axis], bits), bits);
}

/* The bits of a code from one on, v below u. */
static uint32_t code_bits(const int16_t code[2], int low, uint32_t count) {
    const uint32_t u = (uint32_t)(code[0] >> low), v = (uint32_t)(code[1] >> low);
    return colonnade_low_bits(v, count) | colonnade_low_bits(u, count) << count;
}

/* Writes a leaf; its material and whether it is clear stay. Answers whether it has become a flat pair. */
static bool write_leaf(const struct colonnade_mesh *mesh, const struct colonnade_vertex *vertices, const uint8_t *words,
                       uint32_t *to, int32_t low[3], int32_t high[3]) {
    const uint32_t vertex_bits = (uint32_t)mesh->vertex_bits, delta_bits = (uint32_t)mesh->delta_bits;
    uint32_t space[LEAF_WORDS];
    words = colonnade_aligned(words, LEAF_WORDS, space);
    const bool is_pair = colonnade_word(words, 3) >> 16 != COLONNADE_MESH_NO_VERTEX;
    const int count = is_pair ? 4 : 3;
    const struct colonnade_vertex *corners[4];
    int32_t deltas[9]; /* in the order of their fields: z, y, x of each */
    uint32_t reach = 0;
    for (int i = 0; i < count; ++i) corners[i] = &vertices[colonnade_word(words, (size_t)i)];
    for (int axis = 0; axis < 3; ++axis) {
        const int32_t from = corners[0]->position[axis];
        int32_t least = 0, most = 0;
        for (int i = 1; i < count; ++i) {
            const int32_t delta = deltas[3 * i - 1 - axis] = corners[i]->position[axis] - from;
            if (delta < least) least = delta;
            if (delta > most) most = delta;
        }
        low[axis] = from + least;
        high[axis] = from + most;
        reach |= (uint32_t)(most | (least < 0 ? ~least : 0));
    }
    enum format format = TRIANGLE;
    if (is_pair) format = reach >> (delta_bits - 1) == 0 ? NEAR_PAIR : reach >> delta_bits == 0 ? FAR_PAIR : FLAT_PAIR;
    const uint32_t kept = colonnade_leaf_head(to);
    struct colonnade_writer writer = {to, 0, 0};
    put_position(&writer, corners[0]->position, vertex_bits);
    if (format == NEAR_PAIR || format == FAR_PAIR) {
        uint32_t lowest = 0, signs = 0;
        for (int i = 0; i < 8; i += 2) { /* two of up to 14 bits at once */
            const uint32_t upper = colonnade_low_bits((uint32_t)deltas[i + 1], delta_bits) << delta_bits;
            colonnade_put(&writer, upper | colonnade_low_bits((uint32_t)deltas[i], delta_bits), 2 * delta_bits);
        }
        colonnade_put(&writer, colonnade_low_bits((uint32_t)deltas[8], delta_bits), delta_bits);
        for (int i = 0; i < 4; ++i) {
            colonnade_put(&writer, code_bits(corners[i]->normal, 1, OCTAHEDRAL_BITS - 1), 2 * (OCTAHEDRAL_BITS - 1));
            lowest |= code_bits(corners[i]->normal, 0, 1) << (2 * i);
        }
        if (format == FAR_PAIR)
            for (int i = 0; i < 9; ++i) signs |= (uint32_t)deltas[i] >> 31 << i;
        colonnade_put(&writer, format == NEAR_PAIR ? lowest : signs, 9);
    } else {
        for (int i = 1; i < count; ++i) put_position(&writer, corners[i]->position, vertex_bits);
        for (int i = 0; format == TRIANGLE && i < 3; ++i)
            colonnade_put(&writer, code_bits(corners[i]->normal, 0, OCTAHEDRAL_BITS), 2 * OCTAHEDRAL_BITS);
    }
    colonnade_put_leaf_head(&writer, to, kept, format);
    return format == FLAT_PAIR;
}

/* A box's planes, less `below` before they are rounded down to the grid of a node, side by side. */
static uint32_t planes(const int32_t box[3], int32_t below, const int exponent[3], int bits) {
    uint32_t found = 0;
    for (int axis = 0; axis < 3; ++axis) found = (found << bits) + (uint32_t)((box[axis] - below) >> exponent[axis]);
    return found;
}

/* Writes a node from its children's boxes; where they lie stays. Answers its own box. */
static void write_node(const struct colonnade_mesh *mesh, const struct colonnade_mesh_node *node, uint32_t *to,
                       int32_t low[3], int32_t high[3]) {
    const int box_bits = mesh->box_bits;
    const int32_t most = ((int32_t)1 << box_bits) - 1;
    const uint32_t children = node->children;
    struct colonnade_writer writer = {to, 0, 0};
    int exponent[3];
    for (int axis = 0; axis < 3; ++axis) {
        int32_t least = node->low[0][axis], largest = node->high[0][axis];
        for (uint32_t child = 1; child < children; ++child) {
            if (node->low[child][axis] < least) least = node->low[child][axis];
            if (node->high[child][axis] > largest) largest = node->high[child][axis];
        }
        int shift = colonnade_bit_length((uint32_t)(largest - least) >> box_bits);
        while (((largest - 1) >> shift) + 1 - (least >> shift) > most) ++shift;
        low[axis] = least;
        high[axis] = largest;
        exponent[axis] = shift;
    }
    /* No plane is below the origin or further than `most` above it: sums and differences of all three carry nothing
     * over */
    const uint32_t origins = planes(low, 0, exponent, box_bits);
    const uint32_t raised = origins - ((uint32_t)1 << 2 * box_bits | (uint32_t)1 << box_bits | 1);
    for (uint32_t child = 0; child < children; ++child) {
        colonnade_put(&writer, planes(node->low[child], 0, exponent, box_bits) - origins, 3 * (uint32_t)box_bits);
        colonnade_put(&writer, planes(node->high[child], 1, exponent, box_bits) - raised, 3 * (uint32_t)box_bits);
    }
    colonnade_pad(&writer, to, 6 * COLONNADE_MESH_CHILDREN * (uint32_t)box_bits);
    for (int axis = 3; axis-- > 0;) {
        const uint32_t bits = (uint32_t)mesh->vertex_bits + 1,
                       doubled = (uint32_t)(low[axis] >> exponent[axis]) * 2 + 1;
        colonnade_put(&writer, colonnade_low_bits(doubled << exponent[axis], bits), bits);
    }
    colonnade_put_node_head(mesh, &writer, to, node->first, children - node->nodes, node->nodes);
}

/* A node's head. */
static uint32_t head_of(const struct colonnade_mesh *mesh, const uint32_t *record) {
    const uint32_t low = colonnade_node_head(mesh), at = low % 32, *word = record + low / 32;
    const bool is_in_two = at + (uint32_t)mesh->address_bits + 2 * COUNT_BITS > 32;
    return word[0] >> at | (is_in_two ? word[1] << (32 - at) : 0);
}

/* Enters a node; answers whether it is one of the clip's tree. */
static bool enter(struct colonnade_mesh_walk *walk, uint32_t address) {
    const struct colonnade_mesh *mesh = walk->mesh;
    if (walk->open == mesh->depth) return false;
    const uint32_t head = head_of(mesh, walk->copy + (size_t)RECORD_WORDS * (address - walk->root));
    const uint32_t counts = head >> mesh->address_bits, leaves = colonnade_low_bits(counts, COUNT_BITS);
    const uint32_t nodes = colonnade_low_bits(counts >> COUNT_BITS, COUNT_BITS), children = nodes + leaves;
    const uint32_t records = nodes + leaves * mesh->leaf_records;
    struct colonnade_mesh_node *node = &walk->path[walk->open++];
    node->address = address;
    node->first = walk->next;
    node->nodes = nodes;
    node->children = children;
    node->next = 0;
    node->leaf = walk->leaf;
    if (children == 0 || children > COLONNADE_MESH_CHILDREN ||
        colonnade_low_bits(head, (uint32_t)mesh->address_bits) != walk->next ||
        records > walk->root + mesh->records - walk->next || leaves > mesh->leaves - walk->leaf)
        return false;
    walk->next += records;
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
        const uint32_t change = node->first ^ (node->first - from_root + root), low = colonnade_node_head(mesh),
                       at = low % 32;
        to[low / 32] ^= change << at;
        if (at + (uint32_t)mesh->address_bits > 32) to[low / 32 + 1] ^= change >> (32 - at);
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
        uint32_t *to = copy + (size_t)RECORD_WORDS * (node->first + node->nodes - root);
        const uint8_t *words = mesh->leaf_words + 4 * (size_t)LEAF_WORDS * node->leaf;
        for (uint32_t i = node->nodes; i < node->children; ++i) {
            found.flat_pairs += write_leaf(mesh, vertices, words, to, node->low[i], node->high[i]);
            to += RECORD_WORDS * mesh->leaf_records;
            words += 4 * LEAF_WORDS;
        }
        struct colonnade_mesh_node *parent = walk.open == 0 ? NULL : &path[walk.open - 1];
        int32_t *low = parent == NULL ? found.low : parent->low[parent->next - 1];
        int32_t *high = parent == NULL ? found.high : parent->high[parent->next - 1];
        write_node(mesh, node, copy + (size_t)RECORD_WORDS * (node->address - root), low, high);
        areas += area = colonnade_half_area(low, high);
        if (parent == NULL) break;
    }
    const enum colonnade_error error = colonnade_mesh_end(&walk);
    found.cost = (uint32_t)(areas / (area / 256 + 1));
    if (error == COLONNADE_OK) *result = found;
    return error;
}

uint32_t colonnade_mesh_writes(const struct colonnade_design *design, uint32_t root, uint32_t records,
                               uint8_t *writes) {
    /* `scene.root` is behind `scene.recordCount`, the first word of its group */
    const uint32_t pairs[COLONNADE_MESH_WRITES][2] = {
        {design->invalidate, 1}, {design->scene, records}, {design->scene + 4, root}};
    if (design->scene_page == 0) return 0;
    for (int i = 0; i < COLONNADE_MESH_WRITES; ++i) {
        colonnade_write_word(writes + 8 * i, (pairs[i][0] - COLONNADE_DEVICE_BASE) / 4);
        colonnade_write_word(writes + 8 * i + 4, pairs[i][1]);
    }
    return COLONNADE_MESH_WRITES;
}
