/* Poses of the clip in mesh_table.h: prints a hash of all records. */
#include "colonnade_mesh.h"
#include "bare.h"
#include "mesh_table.h"

static int32_t pose[POSE_WORDS];
static struct colonnade_vertex vertices[VERTICES];
static struct colonnade_mesh_node path[DEPTH];

static void check(enum colonnade_error error) { add((uint32_t)error); }

static uint32_t result(void) {
    struct colonnade_design design = {.tile_size = 0};
    struct colonnade_mesh mesh;
    struct colonnade_refit refit = {{0}, {0}, 0, 0};
    for (size_t i = 0; i < 32; ++i) design.format_hash[i / 4] |= (uint32_t)clip_table[16 + i] << (8 * (i % 4));
    check(colonnade_mesh_open(&mesh, &design, clip_table, sizeof clip_table));
    for (uint32_t frame = 0; frame < FRAMES; ++frame) {
        colonnade_mesh_pose(&mesh, 4000 * frame, pose);
        check(colonnade_mesh_skin(&mesh, pose, vertices));
        check(colonnade_mesh_refit(&mesh, vertices, records, ROOT, path, &refit));
        add(refit.flat_pairs);
        for (size_t i = 0; i < sizeof records / sizeof *records; ++i) add(records[i]);
    }
    return hash;
}
