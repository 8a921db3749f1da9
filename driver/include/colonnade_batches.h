/* SPDX-License-Identifier: Apache-2.0 */
/* Batches of a device for rays (docs/rays.md) in its AXI4 shell. As colonnade.h, which probes, loads and resets it:
 * nothing is allocated, and no floating point is used. */
#ifndef COLONNADE_BATCHES_H
#define COLONNADE_BATCHES_H

#include "colonnade.h"
#include "colonnade_rays.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The ring of batches, 64 bytes each, a power of two of them. */
struct colonnade_ring {
    struct colonnade *device;
    uint64_t address; /* on the bus, a multiple of 64 */
    uint32_t size_log;
    uint32_t tail; /* batches that were submitted, modulo 2^16 */
};

/* Writes where a scene lies among the rays, and clears errors and counters. Its records were loaded: by colonnade_load,
 * or by colonnade_set_scene. COLONNADE_BUSY: batches run. */
enum colonnade_error colonnade_set_rays(struct colonnade *device, const struct colonnade_rays_image *image);

/* Opens a ring of 2^`size_log` slots, 1 to 15, of which all but one take batches. Batches, rays, hits and tags lie in
 * `window`, whose ends are multiples of 64: an access beyond it fails. Again after a reset. */
enum colonnade_error colonnade_open_ring(struct colonnade_ring *ring, struct colonnade *device, uint64_t address,
                                         uint32_t size_log, const struct colonnade_window *window);

/* The bus address of the slot for the next batch; COLONNADE_BUSY: all are taken. */
enum colonnade_error colonnade_next_batch(const struct colonnade_ring *ring, uint64_t *slot);

/* Hands over the batch at that slot, also while others run. What the processor has written to memory before is there.
 */
enum colonnade_error colonnade_submit(struct colonnade_ring *ring);

/* Waits until all batches have ended, `attempts` polls or waits at most for each. Their tags tell which of them failed.
 */
enum colonnade_error colonnade_wait_batches(struct colonnade_ring *ring, uint32_t attempts);

#ifdef __cplusplus
}
#endif

#endif
