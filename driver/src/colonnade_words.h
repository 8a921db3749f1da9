/* SPDX-License-Identifier: Apache-2.0 */
/* Words of files, and the header that all files begin with. Words are read byte by byte, so that files may lie
 * anywhere. */
#ifndef COLONNADE_WORDS_H
#define COLONNADE_WORDS_H

#include "colonnade.h"

enum { COLONNADE_DEVICE_BASE = 0x8000 };

static inline uint32_t colonnade_word(const uint8_t *bytes, size_t index) {
    const uint8_t *at = bytes + 4 * index;
    return (uint32_t)at[0] | (uint32_t)at[1] << 8 | (uint32_t)at[2] << 16 | (uint32_t)at[3] << 24;
}

static inline void colonnade_write_word(uint8_t *bytes, uint32_t value) {
    bytes[0] = (uint8_t)value;
    bytes[1] = (uint8_t)(value >> 8);
    bytes[2] = (uint8_t)(value >> 16);
    bytes[3] = (uint8_t)(value >> 24);
}

/* A name of eight letters, the version, the size, and the format hash. `other` answers another name or version. */
enum colonnade_error colonnade_check_header(const struct colonnade_design *design, const uint8_t *bytes, size_t size,
                                            size_t least, const char *magic, uint32_t version,
                                            enum colonnade_error other);

/* Whether `count` words from a word address on are frame registers. */
bool colonnade_are_frame_registers(const struct colonnade_design *design, uint32_t address, uint32_t count);

#endif
