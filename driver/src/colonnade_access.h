/* SPDX-License-Identifier: Apache-2.0 */
/* Accesses to the registers of a device. */
#ifndef COLONNADE_ACCESS_H
#define COLONNADE_ACCESS_H

#include "colonnade.h"
#include "colonnade_shell.h"

#define REGISTER(name) ((uint32_t)offsetof(colonnade_shell_t, name))

static inline uint32_t get(const struct colonnade *device, uint32_t address) {
    return device->bus->read(device->bus->context, address);
}

static inline void set(const struct colonnade *device, uint32_t address, uint32_t value) {
    device->bus->write(device->bus->context, address, value);
}

/* Writes a number of two words. */
static inline void set_wide(const struct colonnade *device, uint32_t address, uint64_t value) {
    set(device, address, (uint32_t)value);
    set(device, address + 4, (uint32_t)(value >> 32));
}

/* Until a bit of `mask` in a register is set, or all are clear: colonnade_wait. `events` end its sleeps; without one it
 * polls. */
enum colonnade_error colonnade_wait_for(struct colonnade *device, uint32_t address, uint32_t mask, bool is_set,
                                        uint32_t events, uint32_t attempts);

/* Whether `bytes` bytes at `address` lie in a window of bus addresses. No sum overflows. */
static inline bool contains(const struct colonnade_window *window, uint64_t address, uint64_t bytes) {
    return window->end >> 40 == 0 && address >= window->base && address <= window->end &&
           bytes <= window->end - address;
}

#endif
