/* Hands batches of rays to a device under Linux by UIO.
 *
 * usage: rays /dev/uio0 IMAGE BATCHES RESULTS [SCENE]
 *
 * IMAGE, BATCHES and SCENE, of a device with its scene in DRAM, come from examples/rays/batches.py. RESULTS receives
 * tags and hits. colonnade_design.h comes from `colonnade registers`, for the design in the chip. */
#include <inttypes.h>
#include <stdio.h>

#include "batches_file.h"
#include "target.h"

enum { PAGE = 4096, RING_LOG = 2, BATCH_BYTES = 64, ATTEMPTS = 6000 }; /* of a tenth of a second at most */

static uint64_t pages(uint64_t bytes) { return (bytes + PAGE - 1) / PAGE * PAGE; }

int main(int argc, char **argv) {
    if (argc != 5 && argc != 6) target_fail("usage", "rays /dev/uio0 IMAGE BATCHES RESULTS [SCENE]");
    struct target target;
    struct colonnade device;
    target_open(&target, argv[1]);
    target_load(&target, &device, argv[2]);

    /* The image leaves the memory to the scene, the file, the ring and the results */
    uint64_t at = 0;
    if (argc == 6) {
        at = pages(target_read(argv[5], target.memory, target.size));
        target_check(argv[5], colonnade_set_scene(&device, target.base));
    }
    const struct batches_file *const file = (const struct batches_file *)(target.memory + at);
    const uint64_t begin = target.base + at,
                   ring_begin = begin + pages(target_read(argv[3], target.memory + at, target.size - at));
    const uint64_t results = ring_begin + PAGE, end = results + file->result_bytes;
    if (end > target.base + target.size) target_fail(argv[3], "the memory is too small for the results");
    target_check(argv[3], batches_set_rays(&device, file));
    uint8_t *const found = target.memory + (results - target.base);
    for (uint32_t i = 0; i < file->result_bytes; ++i) found[i] = (uint8_t)file->unwritten;

    struct colonnade_ring ring;
    const struct colonnade_window window = {begin, (end + BATCH_BYTES - 1) / BATCH_BYTES * BATCH_BYTES};
    target_check("ring", colonnade_open_ring(&ring, &device, ring_begin, RING_LOG, &window));
    for (uint32_t i = 0; i < file->batch_count; ++i) {
        const struct colonnade_rays_batch batch = batches_at(file, i, begin, results);
        uint64_t slot;
        if (colonnade_next_batch(&ring, &slot) == COLONNADE_BUSY)
            target_check("wait", colonnade_wait_batches(&ring, ATTEMPTS));
        target_check("ring", colonnade_next_batch(&ring, &slot));
        memcpy(target.memory + (slot - target.base), &batch, sizeof batch);
        target_check("submit", colonnade_submit(&ring));
    }
    target_check("wait", colonnade_wait_batches(&ring, ATTEMPTS));
    printf("%" PRIu32 " batches, %" PRIu32 " bytes of results\n", file->batch_count, file->result_bytes);
    FILE *output = fopen(argv[4], "wb");
    if (output == NULL) target_fail(argv[4], "cannot be written");
    fwrite(found, 1, file->result_bytes, output);
    if (fclose(output) != 0) target_fail(argv[4], "cannot be written");
    return 0;
}
