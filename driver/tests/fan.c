/* Counts the branches of colonnade_mesh_pairs, which is compiled with -fsanitize-coverage=trace-pc, over triangles
 * around a vertex or an edge: fan TRIANGLES vertex|edge. Output: leaves, branches. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "colonnade_mesh.h"

static uint64_t branches;

void __sanitizer_cov_trace_pc(void);
void __sanitizer_cov_trace_pc(void) { ++branches; }

static void *space(size_t items, size_t size) {
    void *found = calloc(items, size);
    if (found == NULL) exit(1);
    return found;
}

int main(int count, char **words) {
    if (count != 3) return 1;
    const uint32_t triangles = (uint32_t)strtoul(words[1], NULL, 10), vertices = triangles + 2;
    const bool is_edge = strcmp(words[2], "edge") == 0;
    const struct colonnade_mesh layout = {.delta_bits = 16};
    struct colonnade_vertex *places = space(vertices, sizeof *places);
    struct colonnade_triangle *faces = space(triangles, sizeof *faces);
    struct colonnade_leaf *leaves = space(triangles, sizeof *leaves);
    uint32_t *scratch = space(vertices + 4 * (size_t)triangles, 4);
    for (uint32_t i = 0; i < vertices; ++i) places[i].position[0] = (int32_t)i;
    for (uint32_t i = 0; i < triangles; ++i) {
        /* Around an edge, no two are of the same material: none is paired */
        const uint32_t around[3] = {i + 2, 0, (i + 1) % triangles + 2}, at_edge[3] = {i % 2, (i + 1) % 2, i + 2};
        memcpy(faces[i].vertices, is_edge ? at_edge : around, sizeof around);
        faces[i].material = is_edge ? i % 2 : 0;
    }
    const uint32_t found = colonnade_mesh_pairs(&layout, places, vertices, faces, triangles, leaves, scratch);
    printf("%" PRIu32 " %" PRIu64 "\n", found, branches);
    free(places);
    free(faces);
    free(leaves);
    free(scratch);
    return 0;
}
