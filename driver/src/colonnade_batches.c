/* SPDX-License-Identifier: Apache-2.0 */
#include "colonnade_batches.h"

#include "colonnade_access.h"
#include "colonnade_words.h"

enum { BATCH_BYTES = 64, MAX_SIZE_LOG = 15, COUNT_MASK = 0xFFFF };

enum colonnade_error colonnade_set_rays(struct colonnade *device, const struct colonnade_rays_image *image) {
    const struct colonnade_design *design = device->design;
    if (design->rays_tail == 0) return COLONNADE_NO_RAYS;
    if (get(device, REGISTER(status)) != 0) return COLONNADE_BUSY;
    for (uint32_t axis = 0; axis < 3; ++axis) {
        set(device, design->bounds + 4 * axis, (uint32_t)image->bounds_low[axis]);
        set(device, design->bounds + 4 * (axis + 3), (uint32_t)image->bounds_high[axis]);
        set_wide(device, design->placement + 8 * (axis + 1), (uint64_t)image->base[axis]);
    }
    set(device, design->scene, (uint32_t)image->record_count);
    set(device, design->scene + 4, 0); /* the root */
    set(device, design->placement, image->scale_mantissa);
    set(device, design->placement + 4, (uint32_t)image->scale_exponent);
    set(device, COLONNADE_DEVICE_BASE, 1); /* control.start */
    return COLONNADE_OK;
}

enum colonnade_error colonnade_open_ring(struct colonnade_ring *ring, struct colonnade *device, uint64_t address,
                                         uint32_t size_log, const struct colonnade_window *window) {
    const struct colonnade_design *design = device->design;
    if (design->rays_tail == 0) return COLONNADE_NO_RAYS;
    if (address % BATCH_BYTES != 0 || window->base % BATCH_BYTES != 0 || window->end % BATCH_BYTES != 0)
        return COLONNADE_MISALIGNED;
    if (size_log == 0 || size_log > MAX_SIZE_LOG || !contains(window, address, (uint64_t)BATCH_BYTES << size_log))
        return COLONNADE_TOO_LARGE;
    if (get(device, REGISTER(status)) != 0) return COLONNADE_BUSY;
    set_wide(device, REGISTER(rays_windowBase_low), window->base);
    set_wide(device, REGISTER(rays_windowEnd_low), window->end);
    set_wide(device, design->ring, address);
    set(device, design->ring + 8, size_log);
    *ring = (struct colonnade_ring){device, address, size_log, get(device, design->rays_head)};
    return COLONNADE_OK;
}

/* Batches that have not ended. */
static uint32_t waiting(const struct colonnade_ring *ring) {
    return (ring->tail - get(ring->device, ring->device->design->rays_head)) & COUNT_MASK;
}

enum colonnade_error colonnade_next_batch(const struct colonnade_ring *ring, uint64_t *slot) {
    const uint32_t mask = (1u << ring->size_log) - 1;
    if (waiting(ring) >= mask) return COLONNADE_BUSY;
    *slot = ring->address + (uint64_t)BATCH_BYTES * (ring->tail & mask);
    return COLONNADE_OK;
}

enum colonnade_error colonnade_submit(struct colonnade_ring *ring) {
    struct colonnade *device = ring->device;
    if (device->design->scene_page != 0 && !device->has_scene) return COLONNADE_NO_SCENE;
    if (waiting(ring) >= (1u << ring->size_log) - 1) return COLONNADE_BUSY;
    ring->tail = (ring->tail + 1) & COUNT_MASK;
    __sync_synchronize();
    set(device, device->design->rays_tail, ring->tail);
    return COLONNADE_OK;
}

enum colonnade_error colonnade_wait_batches(struct colonnade_ring *ring, uint32_t attempts) {
    enum colonnade_error error = COLONNADE_OK;
    while (error == COLONNADE_OK) {
        colonnade_acknowledge(ring->device, COLONNADE_BATCH_DONE | COLONNADE_ERROR);
        if (waiting(ring) == 0) break; /* one that ends after this raises its event */
        error = colonnade_wait(ring->device, COLONNADE_BATCH_DONE, attempts);
    }
    __sync_synchronize();
    return error;
}
