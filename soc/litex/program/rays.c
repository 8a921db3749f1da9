/* Hands batches of rays to the device by the driver, with interrupts, and ends the simulation. Up to three batches are
 * in the ring, where others wait behind the running one. The build puts the files of examples/rays/batches.py into
 * memory, and their addresses into layout.h. */
#include <libbase/crc.h>
#include <stdio.h>
#include <string.h>
#include <system.h>

#include "batches_file.h"
#include "layout.h"
#include "soc.h"

static const struct batches_file *const file = (const struct batches_file *)BATCHES;
static struct colonnade device;
static struct colonnade_ring ring;
static uint32_t submitted, ended;
static uint32_t starts[BATCH_COUNT], ends[BATCH_COUNT];

static uint32_t tag_of(uint32_t batch) {
    return *(const volatile uint32_t *)(uintptr_t)(RESULTS + (uint32_t)file->batches[batch].done);
}

/* Acknowledges the event, and takes the time of batches whose tags have come. */
static void take_ends(void) {
    colonnade_acknowledge(&device, COLONNADE_BATCH_DONE | COLONNADE_ERROR);
    /* The processor's cache does not see what the device writes */
    flush_cpu_dcache();
    for (; ended < submitted && tag_of(ended) != file->unwritten; ++ended) ends[ended] = soc_now();
}

static void wait_for_batch(void) { soc_check("wait", colonnade_wait(&device, COLONNADE_BATCH_DONE, ATTEMPTS)); }

static void submit(uint32_t number) {
    const struct colonnade_rays_batch batch = batches_at(file, number, BATCHES, RESULTS);
    uint64_t slot;
    enum colonnade_error error;
    while (take_ends(), error = colonnade_next_batch(&ring, &slot), error == COLONNADE_BUSY) wait_for_batch();
    soc_check("next batch", error);
    memcpy((void *)(uintptr_t)slot, &batch, sizeof batch);
    starts[submitted++] = soc_now();
    soc_check("submit", colonnade_submit(&ring));
}

int main(void) {
    soc_begin(&device);
    printf("colonnade: found, capabilities %03x\n", (unsigned)device.capabilities);
    soc_check("set scene", colonnade_set_scene(&device, SCENE));
    soc_check("set rays", batches_set_rays(&device, file));
    const struct colonnade_window window = {BATCHES, RESULTS + RESULTS_BYTES};
    soc_check("open ring", colonnade_open_ring(&ring, &device, RING, RING_LOG, &window));

    for (uint32_t i = 0; i < BATCH_COUNT; ++i) submit(i);
    while (take_ends(), ended < BATCH_COUNT) wait_for_batch();
    soc_check("wait for all", colonnade_wait_batches(&ring, ATTEMPTS));
    for (uint32_t i = 0; i < BATCH_COUNT; ++i) {
        /* A batch that was queued begins at the end of the one before */
        const bool is_queued = i > 0 && (int32_t)(ends[i - 1] - starts[i]) > 0;
        printf("colonnade: batch %u: %u rays, mode %08x, tag %08x, %u cycles%s\n", (unsigned)i,
               (unsigned)file->batches[i].count, (unsigned)file->batches[i].mode, (unsigned)tag_of(i),
               (unsigned)(ends[i] - (is_queued ? ends[i - 1] : starts[i])), is_queued ? ", queued" : "");
    }
    printf("colonnade: results: crc32 %08x\n", (unsigned)crc32((const unsigned char *)RESULTS, RESULTS_BYTES));
    soc_end("end", COLONNADE_OK);
}
