/* Trees over triangles, and their cost as they bend. Input, numbers: bits of vertices, deltas, planes and addresses;
 * the places of all fields; numbers of vertices, triangles and poses; four numbers of each triangle; five of each
 * vertex in each pose. Output, of the first pose: leaves, records, depth; vertices of leaves; words of records; the
 * cost. Then of each other pose the cost of that tree, and of one that is built for it. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

#include "colonnade_mesh.h"

enum { ROOT = 3, FIELDS = 85 };

static struct colonnade_mesh mesh;
static struct colonnade_vertex *vertices;
static struct colonnade_leaf *leaves;
static uint32_t *scratch, count;

static int64_t number(void) {
    int64_t value;
    if (scanf("%" SCNd64, &value) != 1) exit(1);
    return value;
}

static void *space(size_t items, size_t size) {
    void *found = calloc(items, size);
    if (found == NULL) exit(1);
    return found;
}

struct tree {
    struct colonnade_mesh mesh;
    uint8_t *words;
    uint32_t *records;
};

static struct tree build(void) {
    struct tree tree = {mesh, space(count, 16), space(2 * (size_t)count, 32)};
    colonnade_mesh_build(&tree.mesh, vertices, leaves, count, tree.words, tree.records, ROOT, scratch);
    return tree;
}

static uint32_t cost(const struct tree *tree) {
    struct colonnade_mesh_node *path = space(tree->mesh.depth, sizeof *path);
    struct colonnade_refit result;
    if (colonnade_mesh_refit(&tree->mesh, vertices, tree->records, ROOT, path, &result) != COLONNADE_OK) exit(1);
    free(path);
    return result.cost;
}

static void read_pose(uint32_t vertex_count) {
    for (size_t i = 0; i < vertex_count; ++i) {
        for (size_t axis = 0; axis < 3; ++axis) vertices[i].position[axis] = (int32_t)number();
        for (size_t k = 0; k < 2; ++k) vertices[i].normal[k] = (int16_t)number();
    }
}

int main(void) {
    int32_t *const bits[] = {&mesh.vertex_bits, &mesh.delta_bits, &mesh.box_bits, &mesh.address_bits};
    for (size_t i = 0; i < 4; ++i) *bits[i] = (int32_t)number();
    for (size_t i = 0; i < FIELDS; ++i) number(); /* where the driver writes them */
    const uint32_t vertex_count = (uint32_t)number(), triangle_count = (uint32_t)number(), poses = (uint32_t)number();
    struct colonnade_triangle *triangles = space(triangle_count, sizeof *triangles);
    vertices = space(vertex_count, sizeof *vertices);
    leaves = space(triangle_count, sizeof *leaves);
    scratch = space(vertex_count + 4 * (size_t)triangle_count, 4);
    for (size_t i = 0; i < triangle_count; ++i) {
        for (size_t k = 0; k < 3; ++k) triangles[i].vertices[k] = (uint32_t)number();
        triangles[i].material = (uint8_t)number();
        triangles[i].is_clear = i % 7 == 0;
    }
    read_pose(vertex_count);
    count = colonnade_mesh_pairs(&mesh, vertices, vertex_count, triangles, triangle_count, leaves, scratch);
    const struct tree first = build();
    const uint32_t own = cost(&first);
    printf("%" PRIu32 " %" PRIu32 " %" PRIu32 "\n", first.mesh.leaves, first.mesh.records, first.mesh.depth);
    for (size_t i = 0; i < 16 * (size_t)first.mesh.leaves; i += 4)
        printf("%" PRId32 " ", (int32_t)(first.words[i] | (uint32_t)first.words[i + 1] << 8 |
                                         (uint32_t)first.words[i + 2] << 16 | (uint32_t)first.words[i + 3] << 24));
    for (size_t i = 0; i < 8 * (size_t)first.mesh.records; ++i) printf("%" PRIu32 " ", first.records[i]);
    printf("%" PRIu32 "\n", own);
    for (uint32_t pose = 1; pose < poses; ++pose) {
        read_pose(vertex_count);
        const struct tree other = build();
        printf("%" PRIu32 " %" PRIu32 "\n", cost(&first), cost(&other));
        free(other.words);
        free(other.records);
    }
    free(first.words);
    free(first.records);
    free(triangles);
    free(vertices);
    free(leaves);
    free(scratch);
    return 0;
}
