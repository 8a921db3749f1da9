/* Plans and refits of meshes for the spec of the unit. Input: numbers of a mesh, as below; the places of all fields;
 * four vertices of each leaf; five numbers of each vertex; the words of each record. Output: entries of the plan and
 * its words; flat pairs, bounds; the words of each record. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

#include "colonnade_mesh.h"

enum { FIELDS = 85 };

static int64_t number(void) {
    int64_t value;
    if (scanf("%" SCNd64, &value) != 1) exit(1);
    return value;
}

static void *space(size_t count, size_t size) {
    void *found = calloc(count + 1, size);
    if (found == NULL) exit(1);
    return found;
}

static void print(const uint32_t *words, size_t count) {
    for (size_t i = 0; i < count; ++i) printf("%" PRIu32 " ", words[i]);
}

int main(void) {
    struct colonnade_mesh mesh = {0};
    int32_t *const bits[] = {&mesh.vertex_bits, &mesh.delta_bits, &mesh.box_bits, &mesh.address_bits};
    uint32_t *const counts[] = {&mesh.leaf_records, &mesh.records, &mesh.depth, &mesh.vertices, &mesh.leaves};
    for (size_t i = 0; i < 4; ++i) *bits[i] = (int32_t)number();
    for (size_t i = 0; i < 5; ++i) *counts[i] = (uint32_t)number();
    const uint32_t root = (uint32_t)number();
    for (size_t i = 0; i < FIELDS; ++i) number(); /* where the driver writes them */
    uint8_t *leaves = space(mesh.leaves, 16);
    for (size_t i = 0; i < 4 * (size_t)mesh.leaves; ++i) {
        const uint32_t vertex = (uint32_t)number();
        for (size_t byte = 0; byte < 4; ++byte) leaves[4 * i + byte] = (uint8_t)(vertex >> (8 * byte));
    }
    mesh.leaf_words = leaves;
    struct colonnade_vertex *vertices = space(mesh.vertices, sizeof *vertices);
    for (size_t i = 0; i < mesh.vertices; ++i) {
        for (size_t axis = 0; axis < 3; ++axis) vertices[i].position[axis] = (int32_t)number();
        for (size_t k = 0; k < 2; ++k) vertices[i].normal[k] = (int16_t)number();
    }
    uint32_t *records = space(mesh.records, 32);
    for (size_t i = 0; i < 8 * (size_t)mesh.records; ++i) records[i] = (uint32_t)number();

    struct colonnade_mesh_node *path = space(mesh.depth, sizeof *path);
    uint32_t *lines = space(mesh.vertices, sizeof *lines), entries;
    if (colonnade_mesh_plan(&mesh, records, root, path, lines, NULL, &entries) != COLONNADE_OK) return 1;
    uint32_t *plan = space(entries, 16);
    if (colonnade_mesh_plan(&mesh, records, root, path, lines, plan, &entries) != COLONNADE_OK) return 1;
    struct colonnade_refit result;
    if (colonnade_mesh_refit(&mesh, vertices, records, root, path, &result) != COLONNADE_OK) return 1;
    printf("%" PRIu32 " ", entries);
    print(plan, COLONNADE_PLAN_WORDS * (size_t)entries);
    printf("%" PRIu32 " ", result.flat_pairs);
    for (int axis = 0; axis < 3; ++axis) printf("%" PRId32 " ", result.low[axis]);
    for (int axis = 0; axis < 3; ++axis) printf("%" PRId32 " ", result.high[axis]);
    print(records, 8 * (size_t)mesh.records);
    return 0;
}
