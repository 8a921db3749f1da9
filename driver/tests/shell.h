/* The shell as docs/bus-shell.md describes it to a driver: the program ends by abort() at an access that the shell
 * refuses. */
#ifndef COLONNADE_TESTS_SHELL_H
#define COLONNADE_TESTS_SHELL_H

#include "colonnade.h"
#include "colonnade_shell.h"

/* The index of a register's word. */
#define AT(name) (offsetof(colonnade_shell_t, name) / 4)

enum { DEVICE_BASE = 0x8000, SHELL_WORDS = sizeof(colonnade_shell_t) / 4, DEVICE_WORDS = 64 };

struct shell {
    const struct colonnade_design *design;
    uint32_t registers[SHELL_WORDS];
    uint32_t device[DEVICE_WORDS]; /* with the writes that are posted */
    uint32_t posted;               /* writes that wait in the queue */
    uint32_t writes, accesses;     /* since the beginning */
    bool is_scripted;              /* a command leaves `status` alone and sets `outcome` in interrupt.status at once */
    uint32_t outcome;
};

/* One of version 1.`minor` that has done nothing, for frames of up to 640x480. */
struct shell shell_of(const struct colonnade_design *design, uint32_t minor);

/* The accesses of `struct colonnade_bus`, with the shell as context. */
uint32_t shell_read(void *context, uint32_t address);
void shell_write(void *context, uint32_t address, uint32_t value);

/* What may happen between two accesses, bit by bit of `events`: 0: a frame ends, 1: a load ends, 2: a reset ends, 3: a
 * refit ends; 8 to 14: with these errors. A word that waits arrives, unless a frame runs. */
void shell_step(struct shell *shell, uint32_t events);

#endif
