/* SPDX-License-Identifier: Apache-2.0 */
#include "colonnade_access.h"
#include "colonnade_mesh.h"

enum { LINE_BYTES = 64, RECORD_BYTES = 32, PLAN_BYTES = 4 * COLONNADE_PLAN_WORDS, ADDRESS_BITS = 40, COUNT_BITS = 24 };

/* Whether `count` items of so many bytes from an address on leave the space of addresses, where the unit would go on at
 * 0. */
static bool passes_end(uint64_t address, uint64_t bytes, uint32_t count) {
    return address >> ADDRESS_BITS != 0 || address + bytes * count > (uint64_t)1 << ADDRESS_BITS;
}

enum colonnade_error colonnade_refit_start(struct colonnade *device, const struct colonnade_refit_job *job) {
    if ((device->capabilities & COLONNADE_SHELL__CAPABILITIES__REFIT_bm) == 0) return COLONNADE_NO_REFIT;
    if ((job->plan | job->vertices) % LINE_BYTES != 0 || job->records % RECORD_BYTES != 0) return COLONNADE_MISALIGNED;
    const uint32_t lines =
        job->vertex_count / COLONNADE_LINE_VERTICES + (job->vertex_count % COLONNADE_LINE_VERTICES != 0);
    if ((job->entries | lines | job->count | job->root) >> COUNT_BITS != 0 ||
        passes_end(job->plan, PLAN_BYTES, job->entries) || passes_end(job->vertices, LINE_BYTES, lines) ||
        passes_end(job->records, RECORD_BYTES, job->count))
        return COLONNADE_TOO_LARGE;
    if (get(device, REGISTER(status)) & COLONNADE_SHELL__STATUS__ISRESETTING_bm ||
        get(device, REGISTER(refit_status)) != 0)
        return COLONNADE_BUSY;
    set_wide(device, REGISTER(refit_plan_low), job->plan);
    set_wide(device, REGISTER(refit_vertices_low), job->vertices);
    set_wide(device, REGISTER(refit_records_low), job->records);
    set(device, REGISTER(refit_entries), job->entries);
    set(device, REGISTER(refit_lines), lines);
    set(device, REGISTER(refit_count), job->count);
    set(device, REGISTER(refit_root), job->root);
    if (device->events & COLONNADE_REFIT_DONE) colonnade_acknowledge(device, COLONNADE_REFIT_DONE);
    __sync_synchronize();
    set(device, REGISTER(refit_control), COLONNADE_SHELL__REFIT_CONTROL__VALUE_bm);
    return COLONNADE_OK;
}

enum colonnade_error colonnade_refit_wait(struct colonnade *device, uint32_t attempts, struct colonnade_refit *result) {
    if ((device->capabilities & COLONNADE_SHELL__CAPABILITIES__REFIT_bm) == 0) return COLONNADE_NO_REFIT;
    const enum colonnade_error error = colonnade_wait_for(
        device, REGISTER(refit_status), COLONNADE_SHELL__REFIT_STATUS__VALUE_bm, false, COLONNADE_REFIT_DONE, attempts);
    if (error != COLONNADE_OK) return error;
    const uint32_t errors = get(device, REGISTER(refit_errors));
    if (errors & COLONNADE_SHELL__REFIT_ERRORS__RESPONSE_bm) return COLONNADE_BUS_RESPONSE;
    if (errors & COLONNADE_SHELL__REFIT_ERRORS__ALIGNMENT_bm) return COLONNADE_MISALIGNED;
    if (errors & COLONNADE_SHELL__REFIT_ERRORS__PLAN_bm) return COLONNADE_OTHER_RECORDS;
    for (uint32_t axis = 0; axis < 3; ++axis) {
        result->low[axis] = (int32_t)get(device, REGISTER(refit_bounds_0) + 4 * axis);
        result->high[axis] = (int32_t)get(device, REGISTER(refit_bounds_3) + 4 * axis);
    }
    result->flat_pairs = get(device, REGISTER(refit_flatPairs));
    result->cost = 0;
    return COLONNADE_OK;
}
