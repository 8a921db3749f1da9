/* SPDX-License-Identifier: Apache-2.0 */
/* Writes plans of refits in hardware: docs/bus-shell.md. */
#include "colonnade_mesh.h"

#include "colonnade_mesh_parts.h"

enum { LINES, TRIANGLE, PAIR, NODE };
enum {
    ENTRY_LINES = COLONNADE_PLAN_WORDS - 1,
    RING_LINES = 128, /* that the unit holds, with requested ones */
    LINES_IN_FLIGHT = 32,
    LEAF_LINES = 4 /* at most, of a leaf; none of them may push out another one */
};

struct plan {
    uint32_t *lines; /* by line: how many had been read with it; 0: none */
    uint32_t *words;
    uint32_t entries, read;
};

static void add(struct plan *plan, uint32_t kind, uint32_t number, const uint32_t words[ENTRY_LINES]) {
    if (plan->words != NULL) {
        uint32_t *to = plan->words + (size_t)COLONNADE_PLAN_WORDS * plan->entries;
        to[0] = kind | number << 2;
        for (int i = 0; i < ENTRY_LINES; ++i) to[1 + i] = words[i];
    }
    ++plan->entries;
}

/* Reads the lines of a leaf that are not held. */
static void add_lines(struct plan *plan, const uint32_t *vertices, uint32_t count) {
    uint32_t found[ENTRY_LINES] = {0}, lines = 0;
    for (uint32_t i = 0; i < count; ++i) {
        const uint32_t line = vertices[i] / COLONNADE_LINE_VERTICES;
        uint32_t *held = &plan->lines[line];
        if (*held != 0 && plan->read - *held < RING_LINES - LINES_IN_FLIGHT - LEAF_LINES) continue;
        *held = ++plan->read;
        if (lines == ENTRY_LINES) {
            add(plan, LINES, lines, found);
            lines = found[1] = found[2] = 0;
        }
        found[lines++] = line;
    }
    if (lines > 0) add(plan, LINES, lines, found);
}

static void add_leaf(struct plan *plan, const uint8_t *words, const uint32_t *record, uint32_t at) {
    const bool is_pair = colonnade_word(words, 3) >> 16 != COLONNADE_MESH_NO_VERTEX;
    const uint32_t count = is_pair ? 4 : 3;
    uint32_t vertices[4], places[4] = {0};
    for (uint32_t i = 0; i < count; ++i) vertices[i] = colonnade_word(words, i);
    add_lines(plan, vertices, count);
    for (uint32_t i = 0; i < count; ++i)
        places[i] = (plan->lines[vertices[i] / COLONNADE_LINE_VERTICES] - 1) % RING_LINES * COLONNADE_LINE_VERTICES +
                    vertices[i] % COLONNADE_LINE_VERTICES;
    const uint32_t entry[ENTRY_LINES] = {
        places[0] | places[1] << 16,
        places[2] | places[3] << 16,
        colonnade_leaf_head(record),
    };
    add(plan, is_pair ? PAIR : TRIANGLE, at, entry);
}

enum colonnade_error colonnade_mesh_plan(const struct colonnade_mesh *mesh, const uint32_t *copy, uint32_t root,
                                         struct colonnade_mesh_node *path, uint32_t *lines, uint32_t *plan,
                                         uint32_t *entries) {
    struct colonnade_mesh_walk walk = {mesh, copy, path, root, root, 0, 0};
    struct plan to = {lines, plan, 0, 0};
    uint32_t boxes = 0;
    for (uint32_t i = 0; i < mesh->vertices; i += COLONNADE_LINE_VERTICES) lines[i / COLONNADE_LINE_VERTICES] = 0;
    for (const struct colonnade_mesh_node *node; (node = colonnade_mesh_next(&walk)) != NULL;) {
        const uint32_t leaves = node->children - node->nodes;
        for (uint32_t i = 0; i < leaves; ++i) {
            const uint32_t at = node->first - root + node->nodes + i * mesh->leaf_records;
            add_leaf(&to, mesh->leaf_words + 4 * (size_t)LEAF_WORDS * (node->leaf + i),
                     copy + (size_t)RECORD_WORDS * at, at);
        }
        if (boxes + leaves > COLONNADE_PLAN_BOXES) return COLONNADE_TOO_DEEP;
        boxes += leaves + 1 - node->children;
        const uint32_t entry[ENTRY_LINES] = {node->first - root, leaves | node->nodes << COUNT_BITS, 0};
        add(&to, NODE, node->address - root, entry);
        if (walk.open == 0) break;
    }
    *entries = to.entries;
    return colonnade_mesh_end(&walk);
}
