/* The driver's bus to a simulated device: commands of the shell's test bench go to the standard output, its answers
 * come from the standard input. */
#ifndef SIMULATOR_H
#define SIMULATOR_H

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "colonnade.h"
#include "colonnade_design.h"

enum { PAGE = 4096, ATTEMPTS = 1000000 };

static bool waits_for_interrupt;
static uint64_t waited; /* cycles */

static void fail(const char *what) {
    fprintf(stderr, "failed: %s\n", what);
    exit(1);
}

static uint32_t bus_read(void *context, uint32_t address) {
    (void)context;
    uint32_t value;
    printf("read x %" PRIu32 " 1\n", address);
    fflush(stdout);
    if (scanf(" value x %" SCNu32, &value) != 1) fail("the simulator does not answer a read");
    return value;
}

static void bus_write(void *context, uint32_t address, uint32_t value) {
    (void)context;
    printf("write %" PRIu32 " %" PRIu32 "\n", address, value);
}

static void bus_wait(void *context) {
    (void)context;
    uint64_t cycles;
    puts(waits_for_interrupt ? "wait 50000000" : "run 1000");
    fflush(stdout);
    if (scanf(" %*s %" SCNu64, &cycles) != 1) fail("the simulator does not answer a wait");
    waited += cycles;
}

static inline void *read_file(const char *name, size_t *bytes) {
    FILE *file = fopen(name, "rb");
    if (file == NULL || fseek(file, 0, SEEK_END) != 0) fail(name);
    *bytes = (size_t)ftell(file);
    rewind(file);
    void *data = malloc(*bytes);
    if (data == NULL || fread(data, 1, *bytes, file) != *bytes) fail(name);
    fclose(file);
    return data;
}

static inline void expect(enum colonnade_error error, enum colonnade_error expected, const char *what) {
    if (error != expected) {
        fprintf(stderr, "%s: %s, expected %s\n", what, colonnade_error_name(error), colonnade_error_name(expected));
        exit(1);
    }
}

static inline uint64_t pages(uint64_t bytes) { return (bytes + PAGE - 1) / PAGE * PAGE; }

#endif
