/* A file of batches of rays, as examples/rays/batches.py writes it. Addresses of rays count from the beginning of the
 * file, addresses of hits and tags from the beginning of the results. */
#ifndef BATCHES_FILE_H
#define BATCHES_FILE_H

#include <string.h>

#include "colonnade_batches.h"

struct batches_file {
    int32_t bounds_low[3], bounds_high[3];
    uint32_t scale_mantissa;
    int32_t scale_exponent;
    int64_t base[3];
    uint32_t record_count, batch_count, result_bytes, unwritten,
        reserved[14]; /* unwritten: a word of the results before */
    struct colonnade_rays_batch batches[];
};
_Static_assert(sizeof(struct batches_file) == 128, "the header is as in examples/rays/batches.py");

/* Writes where its scene lies among the rays. */
static inline enum colonnade_error batches_set_rays(struct colonnade *device, const struct batches_file *file) {
    struct colonnade_rays_image image = {.record_count = file->record_count,
                                         .scale_mantissa = file->scale_mantissa,
                                         .scale_exponent = file->scale_exponent};
    memcpy(image.bounds_low, file->bounds_low, sizeof image.bounds_low);
    memcpy(image.bounds_high, file->bounds_high, sizeof image.bounds_high);
    memcpy(image.base, file->base, sizeof image.base);
    return colonnade_set_rays(device, &image);
}

/* A batch with addresses on the bus, where file and results begin at those. */
static inline struct colonnade_rays_batch batches_at(const struct batches_file *file, uint32_t number, uint64_t begin,
                                                     uint64_t results) {
    struct colonnade_rays_batch batch = file->batches[number];
    batch.rays += begin;
    batch.hits += results;
    batch.done += results;
    return batch;
}

#endif
