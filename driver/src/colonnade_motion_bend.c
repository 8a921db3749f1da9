/* SPDX-License-Identifier: Apache-2.0 */
/* Meshes of a motion that bend, in two copies of their records: docs/driver.md. */
#include "colonnade_access.h"
#include "colonnade_mesh_parts.h"
#include "colonnade_motion.h"

static uint32_t *records_at(const struct colonnade_motion_memory *memory, uint32_t root) {
    return memory->scene + (size_t)RECORD_WORDS * root;
}

enum colonnade_error colonnade_motion_copy(struct colonnade_motion *motion,
                                           const struct colonnade_motion_memory *memory, uint32_t bytes) {
    const uint32_t records = bytes / (4 * RECORD_WORDS);
    uint32_t roots[COLONNADE_INSTANCES], end = records;
    if (motion->invalidate_address == 0) return COLONNADE_NO_SCENE;
    for (uint32_t i = 0; i < motion->clips; ++i) {
        const struct colonnade_mesh *mesh = &motion->meshes[i];
        const uint32_t from = motion->roots[i][0];
        if (from > records || mesh->records > records - from) return COLONNADE_OTHER_RECORDS;
        if (end + mesh->records > (uint32_t)1 << mesh->address_bits) return COLONNADE_TOO_LARGE;
        const enum colonnade_error error =
            colonnade_mesh_copy(mesh, records_at(memory, from), from, records_at(memory, end), end, memory->path);
        if (error != COLONNADE_OK) return error;
        roots[i] = end;
        end += mesh->records;
    }
    for (uint32_t i = 0; i < motion->clips; ++i) motion->roots[i][1] = roots[i];
    motion->records = end;
    return COLONNADE_OK;
}

enum colonnade_error colonnade_motion_swap(const struct colonnade_motion *motion, const struct colonnade *device,
                                           const struct colonnade_instance *last, struct colonnade_instance *instances,
                                           uint32_t roots[COLONNADE_INSTANCES]) {
    const uint32_t both = COLONNADE_SHELL__STATUS__ISRUNNING_bm | COLONNADE_SHELL__STATUS__ISQUEUED_bm;
    const uint32_t word = colonnade_instance_root(&motion->world);
    if (motion->clips != 0 && motion->records == 0) return COLONNADE_NO_SCENE;
    if (motion->clips != 0 && (get(device, REGISTER(status)) & both) == both) return COLONNADE_BUSY;
    for (uint32_t i = 0; i < motion->clips; ++i) {
        const uint32_t *pair = motion->roots[i];
        roots[i] = pair[0];
        for (uint32_t object = 0; last != NULL && object < motion->objects; ++object)
            if (last[object].words[word] == pair[0]) roots[i] = pair[1];
        for (uint32_t object = 0; object < motion->objects; ++object)
            if (instances[object].words[word] == pair[0]) instances[object].words[word] = roots[i];
    }
    return COLONNADE_OK;
}

enum colonnade_error colonnade_motion_bend(const struct colonnade_motion *motion, const struct colonnade *device,
                                           const struct colonnade_motion_memory *memory, uint32_t time,
                                           const struct colonnade_instance *last,
                                           struct colonnade_instance *instances) {
    uint32_t roots[COLONNADE_INSTANCES];
    enum colonnade_error error = colonnade_motion_swap(motion, device, last, instances, roots);
    time = colonnade_repeated(time, motion->duration);
    for (uint32_t i = 0; i < motion->clips && error == COLONNADE_OK; ++i) {
        const struct colonnade_mesh *mesh = &motion->meshes[i];
        struct colonnade_refit result;
        colonnade_mesh_pose(mesh, time < mesh->duration ? time : mesh->duration, memory->pose);
        error = colonnade_mesh_skin(mesh, memory->pose, memory->vertices);
        if (error == COLONNADE_OK)
            error = colonnade_mesh_refit(mesh, memory->vertices, records_at(memory, roots[i]), roots[i], memory->path,
                                         &result);
    }
    return error;
}
