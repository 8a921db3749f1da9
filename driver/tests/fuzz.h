/* The input of a fuzzer, byte by byte: libFuzzer's, or with RUNS that many random ones, for compilers without it. */
#ifndef COLONNADE_TESTS_FUZZ_H
#define COLONNADE_TESTS_FUZZ_H

#include <stdint.h>

#include "check.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static const uint8_t *input;
static size_t left;
static uint64_t noise; /* behind the input's end, a sequence that depends on all of it */

static void open_input(const uint8_t *data, size_t size) {
    input = data;
    left = size;
    noise = size + 1;
    for (size_t i = 0; i < size; ++i) noise = (noise ^ data[i]) * 1099511628211u + 1;
}

static uint32_t next_noise(void) {
    noise = noise * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)(noise >> 32);
}

static uint32_t take(void) {
    if (left == 0) return next_noise() >> 24;
    --left;
    return *input++;
}

static uint32_t take32(void) {
    uint32_t value = 0;
    for (int i = 0; i < 4; ++i) value = value << 8 | take();
    return value;
}

static inline uint64_t take64(void) {
    const uint64_t high = take32();
    return high << 32 | take32();
}

#ifdef RUNS
int main(void) {
    static uint8_t data[256];
    uint64_t state = 1;
    for (int run = 0; run < RUNS; ++run) {
        for (size_t i = 0; i < sizeof data; ++i) {
            state = state * 6364136223846793005u + 1442695040888963407u;
            data[i] = (uint8_t)(state >> 56);
        }
        LLVMFuzzerTestOneInput(data, sizeof data - (state >> 32) % 200);
    }
    return 0;
}
#endif

#endif
