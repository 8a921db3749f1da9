/* Device images and frame files: what they have to be. Words are read byte by byte, so that files may lie anywhere. */
#include "colonnade.h"

enum { HEADER_BYTES = 128, FRAME_HEADER_BYTES = 64, IMAGE_ALIGNMENT = 128, VERSION = 1, DEVICE_BASE = 0x8000 };

static uint32_t word(const uint8_t *bytes, size_t index) {
    const uint8_t *at = bytes + 4 * index;
    return (uint32_t)at[0] | (uint32_t)at[1] << 8 | (uint32_t)at[2] << 16 | (uint32_t)at[3] << 24;
}

static bool is_magic(const uint8_t *bytes, const char *magic) {
    for (int i = 0; i < 8; ++i)
        if (bytes[i] != (uint8_t)magic[i]) return false;
    return true;
}

/* What both files begin with: a name, a version, the size, and the format hash. */
static enum colonnade_error check_header(const struct colonnade_design *design, const uint8_t *bytes, size_t size,
                                         size_t least, const char *magic, enum colonnade_error other) {
    if (size < 8) return COLONNADE_TRUNCATED;
    if (!is_magic(bytes, magic)) return other;
    if (size < least) return COLONNADE_TRUNCATED;
    if (word(bytes, 2) != VERSION) return other;
    if (word(bytes, 3) != size) return COLONNADE_TRUNCATED;
    for (size_t i = 0; i < 8; ++i)
        if (word(bytes, 4 + i) != design->format_hash[i]) return COLONNADE_OTHER_FORMAT;
    return COLONNADE_OK;
}

enum colonnade_error colonnade_check_image(const struct colonnade_design *design, const void *data, size_t bytes) {
    enum colonnade_error error = check_header(design, data, bytes, HEADER_BYTES, "CLNDLOAD", COLONNADE_NOT_AN_IMAGE);
    if (error != COLONNADE_OK) return error;
    return bytes % IMAGE_ALIGNMENT == 0 ? COLONNADE_OK : COLONNADE_MISALIGNED;
}

enum colonnade_error colonnade_open_frame(const struct colonnade_design *design, const void *data, size_t bytes,
                                          struct colonnade_frame *frame) {
    const uint8_t *at = data;
    enum colonnade_error error = check_header(design, at, bytes, FRAME_HEADER_BYTES, "CLNDFRAM", COLONNADE_NOT_A_FRAME);
    if (error != COLONNADE_OK) return error;
    const uint8_t *writes = at + FRAME_HEADER_BYTES;
    const uint32_t count = word(at, 14);
    const uint32_t first = (design->frame_registers - DEVICE_BASE) / 4, end = (design->device_end - DEVICE_BASE) / 4;
    if (count != (bytes - FRAME_HEADER_BYTES) / 8 || bytes % 8 != 0) return COLONNADE_TRUNCATED;
    if (count > end - first) return COLONNADE_BAD_REGISTER;
    for (size_t i = 0; i < count; ++i) {
        uint32_t index = word(writes, 2 * i);
        if (index < first || index >= end) return COLONNADE_BAD_REGISTER;
    }
    *frame = (struct colonnade_frame){writes, count, word(at, 12), word(at, 13)};
    return COLONNADE_OK;
}
