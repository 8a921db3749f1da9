/* SPDX-License-Identifier: Apache-2.0 */
/* Device images and frame files: what they have to be. */
#include "colonnade.h"

#include "colonnade_words.h"

enum { HEADER_BYTES = 128, SECTION_BYTES = 16, FRAME_HEADER_BYTES = 64, IMAGE_ALIGNMENT = 128, VERSION = 1 };

static bool is_magic(const uint8_t *bytes, const char *magic) {
    for (int i = 0; i < 8; ++i)
        if (bytes[i] != (uint8_t)magic[i]) return false;
    return true;
}

enum colonnade_error colonnade_check_header(const struct colonnade_design *design, const uint8_t *bytes, size_t size,
                                            size_t least, const char *magic, uint32_t version,
                                            enum colonnade_error other) {
    if (size < 8) return COLONNADE_TRUNCATED;
    if (!is_magic(bytes, magic)) return other;
    if (size < least) return COLONNADE_TRUNCATED;
    if (colonnade_word(bytes, 2) != version) return other;
    if (colonnade_word(bytes, 3) != size) return COLONNADE_TRUNCATED;
    for (size_t i = 0; i < 8; ++i)
        if (colonnade_word(bytes, 4 + i) != design->format_hash[i]) return COLONNADE_OTHER_FORMAT;
    return COLONNADE_OK;
}

bool colonnade_are_frame_registers(const struct colonnade_design *design, uint32_t address, uint32_t count) {
    const uint32_t first = (design->frame_registers - COLONNADE_DEVICE_BASE) / 4;
    const uint32_t end = (design->device_end - COLONNADE_DEVICE_BASE) / 4;
    return address >= first && address <= end && count <= end - address;
}

enum colonnade_error colonnade_check_image(const struct colonnade_design *design, const void *data, size_t bytes) {
    enum colonnade_error error =
        colonnade_check_header(design, data, bytes, HEADER_BYTES, "CLNDLOAD", VERSION, COLONNADE_NOT_AN_IMAGE);
    if (error != COLONNADE_OK) return error;
    return bytes % IMAGE_ALIGNMENT == 0 ? COLONNADE_OK : COLONNADE_MISALIGNED;
}

enum colonnade_error colonnade_check_maps(const struct colonnade_design *design, const void *data, size_t bytes) {
    const uint8_t *at = data;
    enum colonnade_error error = colonnade_check_image(design, data, bytes);
    if (error != COLONNADE_OK) return error;
    size_t place = HEADER_BYTES;
    for (uint32_t sections = colonnade_word(at, 12); sections > 0; --sections) {
        if (bytes - place < SECTION_BYTES) return COLONNADE_BAD_LENGTH;
        const uint32_t target = colonnade_word(at + place, 0), records = colonnade_word(at + place, 1);
        if (target == 0 || target > design->map_count) return COLONNADE_BAD_SECTION;
        const struct colonnade_memory *memory = &design->maps[target - 1];
        if (records > memory->records) return COLONNADE_BAD_SECTION;
        place += SECTION_BYTES;
        if (4 * (size_t)memory->words * records > bytes - place) return COLONNADE_BAD_LENGTH;
        place += 4 * (size_t)memory->words * records;
    }
    return bytes - place < IMAGE_ALIGNMENT ? COLONNADE_OK : COLONNADE_BAD_LENGTH;
}

enum colonnade_error colonnade_open_frame(const struct colonnade_design *design, const void *data, size_t bytes,
                                          struct colonnade_frame *frame) {
    const uint8_t *at = data;
    enum colonnade_error error =
        colonnade_check_header(design, at, bytes, FRAME_HEADER_BYTES, "CLNDFRAM", VERSION, COLONNADE_NOT_A_FRAME);
    if (error != COLONNADE_OK) return error;
    const uint8_t *writes = at + FRAME_HEADER_BYTES;
    const uint32_t count = colonnade_word(at, 14);
    if (count != (bytes - FRAME_HEADER_BYTES) / 8 || bytes % 8 != 0) return COLONNADE_TRUNCATED;
    if (count > (design->device_end - design->frame_registers) / 4) return COLONNADE_BAD_REGISTER;
    for (size_t i = 0; i < count; ++i)
        if (!colonnade_are_frame_registers(design, colonnade_word(writes, 2 * i), 1)) return COLONNADE_BAD_REGISTER;
    *frame = (struct colonnade_frame){writes, count, colonnade_word(at, 12), colonnade_word(at, 13)};
    return COLONNADE_OK;
}
