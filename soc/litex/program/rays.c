/* Hands batches of rays to the device by the driver, with interrupts, and ends the simulation. Up to three batches are in the
 * ring, where those that wait follow the one that runs. The build puts the files of examples/rays/batches.py into memory, and
 * their addresses into layout.h. */
#include <libbase/crc.h>
#include <stdio.h>
#include <string.h>
#include <system.h>

#include "colonnade_batches.h"
#include "layout.h"
#include "soc.h"

/* Addresses of rays count from the file, those of hits and tags from the results. */
struct file {
    int32_t bounds_low[3], bounds_high[3];
    uint32_t scale_mantissa;
    int32_t scale_exponent;
    int64_t base[3];
    uint32_t record_count, batch_count, result_bytes, unwritten, reserved[14];
    struct colonnade_rays_batch batches[];
};
_Static_assert(sizeof(struct file) == 128, "the header is that of examples/rays/batches.py");

static const struct file *const file = (const struct file *)BATCHES;
static struct colonnade device;
static struct colonnade_ring ring;
static uint32_t submitted, ended;
static uint32_t starts[BATCH_COUNT], ends[BATCH_COUNT];

static uint32_t tag_of(uint32_t batch) { return *(const volatile uint32_t *)(uintptr_t)(RESULTS + (uint32_t)file->batches[batch].done); }

/* Acknowledges the event, and takes the time of batches whose tags have come. */
static void take_ends(void) {
    colonnade_acknowledge(&device, COLONNADE_BATCH_DONE | COLONNADE_ERROR);
    /* The processor's cache does not see what the device writes */
    flush_cpu_dcache();
    for (; ended < submitted && tag_of(ended) != file->unwritten; ++ended) ends[ended] = soc_now();
}

static void wait_for_batch(void) { soc_check("wait", colonnade_wait(&device, COLONNADE_BATCH_DONE, ATTEMPTS)); }

static void submit(struct colonnade_rays_batch batch) {
    uint64_t slot;
    enum colonnade_error error;
    while (take_ends(), error = colonnade_next_batch(&ring, &slot), error == COLONNADE_BUSY) wait_for_batch();
    soc_check("next batch", error);
    batch.rays += BATCHES;
    batch.hits += RESULTS;
    batch.done += RESULTS;
    memcpy((void *)(uintptr_t)slot, &batch, sizeof batch);
    starts[submitted++] = soc_now();
    soc_check("submit", colonnade_submit(&ring));
}

int main(void) {
    soc_begin(&device);
    printf("colonnade: found, capabilities %03x\n", (unsigned)device.capabilities);
    soc_check("set scene", colonnade_set_scene(&device, SCENE));
    struct colonnade_rays_image image = {.record_count = file->record_count, .scale_mantissa = file->scale_mantissa, .scale_exponent = file->scale_exponent};
    memcpy(image.bounds_low, file->bounds_low, sizeof image.bounds_low);
    memcpy(image.bounds_high, file->bounds_high, sizeof image.bounds_high);
    memcpy(image.base, file->base, sizeof image.base);
    soc_check("set rays", colonnade_set_rays(&device, &image));
    const struct colonnade_window window = {BATCHES, RESULTS + RESULTS_BYTES};
    soc_check("open ring", colonnade_open_ring(&ring, &device, RING, RING_LOG, &window));

    for (uint32_t i = 0; i < BATCH_COUNT; ++i) submit(file->batches[i]);
    while (take_ends(), ended < BATCH_COUNT) wait_for_batch();
    soc_check("wait for all", colonnade_wait_batches(&ring, ATTEMPTS));
    for (uint32_t i = 0; i < BATCH_COUNT; ++i) {
        /* A batch that was queued begins at the end of the one before */
        const bool is_queued = i > 0 && (int32_t)(ends[i - 1] - starts[i]) > 0;
        printf("colonnade: batch %u: %u rays, mode %08x, tag %08x, %u cycles%s\n", (unsigned)i, (unsigned)file->batches[i].count, (unsigned)file->batches[i].mode,
               (unsigned)tag_of(i), (unsigned)(ends[i] - (is_queued ? ends[i - 1] : starts[i])), is_queued ? ", queued" : "");
    }
    printf("colonnade: results: crc32 %08x\n", (unsigned)crc32((const unsigned char *)RESULTS, RESULTS_BYTES));
    soc_end("end", COLONNADE_OK);
}
