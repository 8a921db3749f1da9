/* The clip that bends the packed mesh. */
#include "colonnade_clip.h"

#include <stdlib.h>
#include <string.h>

#include "colonnade_mesh.h"

static struct colonnade_mesh mesh;
static struct colonnade_vertex *vertices;
static struct colonnade_mesh_node *path;
static int32_t *pose;

int32_t colonnade_clip_open(const uint32_t format_hash[8], const uint8_t *file, uint32_t bytes) {
    struct colonnade_design design = {0};
    memcpy(design.format_hash, format_hash, sizeof design.format_hash);
    const enum colonnade_error error = colonnade_mesh_open(&mesh, &design, file, bytes);
    if (error != COLONNADE_OK) return error;
    free(vertices);
    free(path);
    free(pose);
    vertices = malloc(mesh.vertices * sizeof *vertices);
    path = malloc(mesh.depth * sizeof *path);
    pose = malloc(colonnade_mesh_pose_words(&mesh) * sizeof *pose);
    return vertices && path && pose ? COLONNADE_OK : COLONNADE_TOO_LARGE;
}

int32_t colonnade_clip_skin(const int32_t *words, int32_t (*positions)[3], int16_t (*normals)[2]) {
    const enum colonnade_error error = colonnade_mesh_skin(&mesh, words, vertices);
    for (uint32_t i = 0; error == COLONNADE_OK && i < mesh.vertices; ++i) {
        memcpy(positions[i], vertices[i].position, sizeof positions[i]);
        memcpy(normals[i], vertices[i].normal, sizeof normals[i]);
    }
    return error;
}

int32_t colonnade_clip_refit(uint32_t time, uint32_t *records, uint32_t *flat_pairs) {
    struct colonnade_refit found;
    colonnade_mesh_pose(&mesh, time, pose);
    enum colonnade_error error = colonnade_mesh_skin(&mesh, pose, vertices);
    if (error == COLONNADE_OK) error = colonnade_mesh_refit(&mesh, vertices, records, 0, path, &found);
    if (error == COLONNADE_OK) *flat_pairs = found.flat_pairs;
    return error;
}
