/* What the examples need of the machine that they run on: target_uio.c is Linux with UIO. */
#ifndef COLONNADE_TARGET_H
#define COLONNADE_TARGET_H

#include "colonnade.h"
#include "colonnade_design.h"

struct target {
    struct colonnade_bus bus;
    uint64_t base, size; /* memory that the device may use, bytes */
    uint8_t *memory;     /* the same; NULL where this program cannot see it */
    uint32_t line;       /* bytes of a line of the display that shows the memory; 0: none does */
};

/* Opens a device, or ends the program with one line. If a display shows the memory, no console draws there any more. */
void target_open(struct target *target, const char *device);

/* Puts a file at the start of the memory; its size in bytes. */
uint32_t target_put(struct target *target, const char *name);

/* Ends the program with one line and status 2. */
void target_fail(const char *what, const char *why);

/* Ends the program, unless a call of the driver was right. */
void target_check(const char *what, enum colonnade_error error);

/* Reads a whole file of at most so many bytes; its size. */
size_t target_read(const char *name, void *to, size_t most);

/* Loads the device's image from a file; returns when it is there. */
void target_load(struct target *target, struct colonnade *device, const char *name);

/* Bytes of a line of a frame: whole tile rows. */
uint32_t target_stride(uint32_t width);

/* Starts the frame that is set, of the same size as `frame`, as target_render does; the bytes of a line. */
uint32_t target_start(struct target *target, struct colonnade *device, const struct colonnade_frame *frame);

/* Waits until it is there. */
void target_finish(struct colonnade *device);

/* Renders the frame that is set to the start of the memory, which the image leaves to it; the bytes of a line. */
uint32_t target_render(struct target *target, struct colonnade *device, const struct colonnade_frame *frame);

#endif
