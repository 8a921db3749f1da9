/* SPDX-License-Identifier: Apache-2.0 */
#include "colonnade.h"

#include "colonnade_access.h"

enum { IDENTITY = 0x434C4E44, DEVICE_BASE = 0x8000, IMAGE_ALIGNMENT = 128, PAGE_LOG = 12 };
enum { EVENTS = COLONNADE_FRAME_DONE | COLONNADE_IMAGE_DONE | COLONNADE_ERROR };

enum colonnade_error colonnade_probe(struct colonnade *device, const struct colonnade_bus *bus,
                                     const struct colonnade_design *design) {
    /* No space: what another program has written during a frame that runs is not known */
    struct colonnade found = {.bus = bus, .design = design};
    if (get(&found, REGISTER(identity)) != IDENTITY) return COLONNADE_NO_DEVICE;
    if (get(&found, REGISTER(version)) >> COLONNADE_SHELL__VERSION__MAJOR_bp != 1) return COLONNADE_UNKNOWN_VERSION;
    for (uint32_t i = 0; i < 8; ++i)
        if (get(&found, REGISTER(formatHash_0) + 4 * i) != design->format_hash[i]) return COLONNADE_OTHER_FORMAT;
    found.capabilities = get(&found, REGISTER(capabilities));
    found.events = EVENTS;
    /* Shells before 1.4 lack it */
    const bool has_refit = (found.capabilities & COLONNADE_SHELL__CAPABILITIES__REFIT_bm) != 0;
    if (has_refit && (get(&found, REGISTER(version)) & COLONNADE_SHELL__VERSION__MINOR_bm) >= 4)
        found.events |= COLONNADE_REFIT_DONE;
    uint32_t size = get(&found, REGISTER(frameSize));
    found.max_width = size & COLONNADE_SHELL__FRAMESIZE__WIDTH_bm;
    found.max_height = size >> COLONNADE_SHELL__FRAMESIZE__HEIGHT_bp;
    *device = found;
    return COLONNADE_OK;
}

static enum colonnade_error image_error(uint32_t bits) {
    if (bits & COLONNADE_SHELL__IMAGE_ERRORS__WINDOW_bm) return COLONNADE_TOO_LARGE;
    if (bits & COLONNADE_SHELL__IMAGE_ERRORS__RESPONSE_bm) return COLONNADE_BUS_RESPONSE;
    if (bits & COLONNADE_SHELL__IMAGE_ERRORS__ALIGNMENT_bm) return COLONNADE_MISALIGNED;
    if (bits & COLONNADE_SHELL__IMAGE_ERRORS__MAGIC_bm) return COLONNADE_NOT_AN_IMAGE;
    if (bits & COLONNADE_SHELL__IMAGE_ERRORS__FORMATHASH_bm) return COLONNADE_OTHER_FORMAT;
    if (bits & COLONNADE_SHELL__IMAGE_ERRORS__SECTION_bm) return COLONNADE_BAD_SECTION;
    if (bits & COLONNADE_SHELL__IMAGE_ERRORS__LENGTH_bm) return COLONNADE_BAD_LENGTH;
    return COLONNADE_OK;
}

typedef enum colonnade_error image_check(const struct colonnade_design *design, const void *data, size_t bytes);

static enum colonnade_error load(struct colonnade *device, const struct colonnade_image *image, uint32_t attempts,
                                 image_check *check) {
    if (image->address % IMAGE_ALIGNMENT != 0 || image->bytes % IMAGE_ALIGNMENT != 0) return COLONNADE_MISALIGNED;
    if (!contains(&image->window, image->address, image->bytes)) return COLONNADE_TOO_LARGE;
    if (image->data != NULL) {
        enum colonnade_error error = check(device->design, image->data, image->bytes);
        if (error != COLONNADE_OK) return error;
    }
    if (get(device, REGISTER(status)) != 0) return COLONNADE_BUSY;
    set_wide(device, REGISTER(image_base_low), image->address);
    set_wide(device, REGISTER(image_windowBase_low), image->window.base);
    set_wide(device, REGISTER(image_windowEnd_low), image->window.end);
    set(device, REGISTER(image_bytes), image->bytes);
    colonnade_acknowledge(device, COLONNADE_IMAGE_DONE | COLONNADE_ERROR);
    __sync_synchronize();
    set(device, REGISTER(control), COLONNADE_SHELL__CONTROL__LOAD_bm);
    enum colonnade_error error = colonnade_wait(device, COLONNADE_IMAGE_DONE, attempts);
    if (error != COLONNADE_OK) return error;
    colonnade_acknowledge(device, COLONNADE_IMAGE_DONE | COLONNADE_ERROR);
    return image_error(get(device, REGISTER(image_errors)));
}

enum colonnade_error colonnade_load(struct colonnade *device, const struct colonnade_image *image, uint32_t attempts) {
    return load(device, image, attempts, colonnade_check_image);
}

enum colonnade_error colonnade_load_maps(struct colonnade *device, const struct colonnade_image *image,
                                         uint32_t attempts) {
    return load(device, image, attempts, colonnade_check_maps);
}

static uint32_t word(const uint8_t *at) {
    return (uint32_t)at[0] | (uint32_t)at[1] << 8 | (uint32_t)at[2] << 16 | (uint32_t)at[3] << 24;
}

/* Whether registers and framebuffer may change now, and the next frame may be started. If so, makes sure of `writes`
 * writes to the device: while a frame runs they wait in a queue, which is empty when a frame begins. */
static bool takes_a_frame(struct colonnade *device, uint32_t writes) {
    uint32_t status = get(device, REGISTER(status));
    if (status == 0) return true;
    if (status != COLONNADE_SHELL__STATUS__ISRUNNING_bm || writes > device->space) return false;
    device->space -= writes;
    return true;
}

enum colonnade_error colonnade_set_scene(struct colonnade *device, uint64_t address) {
    const struct colonnade_design *design = device->design;
    if (design->scene_page == 0) return COLONNADE_NO_SCENE;
    if (address % (1u << PAGE_LOG) != 0) return COLONNADE_MISALIGNED;
    if (address >> 40 != 0) return COLONNADE_TOO_LARGE;
    if (!takes_a_frame(device, 2)) return COLONNADE_BUSY;
    device->scene = address;
    device->has_scene = true;
    set(device, design->scene_page, (uint32_t)(address >> PAGE_LOG));
    set(device, design->invalidate, 1);
    return COLONNADE_OK;
}

enum colonnade_error colonnade_set_frame(struct colonnade *device, const struct colonnade_frame *frame) {
    const struct colonnade_design *design = device->design;
    if (frame->width > device->max_width || frame->height > device->max_height) return COLONNADE_TOO_LARGE;
    if (frame->count > (design->device_end - design->frame_registers) / 4) return COLONNADE_BAD_REGISTER;
    if (!takes_a_frame(device, frame->count + device->has_scene)) return COLONNADE_BUSY;
    for (size_t i = 0; i < frame->count; ++i)
        set(device, DEVICE_BASE + 4 * word(frame->writes + 8 * i), word(frame->writes + 8 * i + 4));
    /* The file has page 0 */
    if (device->has_scene) set(device, design->scene_page, (uint32_t)(device->scene >> PAGE_LOG));
    device->width = frame->width;
    device->height = frame->height;
    return COLONNADE_OK;
}

/* Bytes from the first pixel of a frame to the end of its last tile row. Lines that overlap are not valid. */
static bool frame_bytes(const struct colonnade *device, uint32_t stride, uint32_t pixel_bytes, uint64_t *bytes) {
    uint32_t tile = device->design->tile_size, line = (device->width + tile - 1) / tile * tile * pixel_bytes;
    *bytes = (uint64_t)stride * (device->height - 1) + line;
    return stride >= line && stride >> 24 == 0;
}

enum colonnade_error colonnade_set_photo(struct colonnade *device, const struct colonnade_photo *photo) {
    /* Shells of version 1.0 lack these registers, those before 1.3 photo.hasStrengths */
    const uint32_t minor = get(device, REGISTER(version)) & COLONNADE_SHELL__VERSION__MINOR_bm;
    bool composites = minor != 0 && (device->capabilities & COLONNADE_SHELL__CAPABILITIES__ENVIRONMENT_bm) != 0;
    if (!composites) return photo == NULL ? COLONNADE_OK : COLONNADE_NO_PHOTO;
    if (photo == NULL) {
        if (!takes_a_frame(device, 0)) return COLONNADE_BUSY;
        set(device, REGISTER(photo_enabled), 0);
        return COLONNADE_OK;
    }
    if (photo->has_strengths && minor < 3) return COLONNADE_NO_PHOTO;
    if (device->width == 0 || device->height == 0) return COLONNADE_NO_FRAME;
    uint32_t row = device->design->tile_size * 4;
    if (photo->base % row != 0 || photo->stride % row != 0) return COLONNADE_MISALIGNED;
    uint64_t bytes;
    if (!frame_bytes(device, photo->stride, 4, &bytes) || !contains(&photo->window, photo->base, bytes))
        return COLONNADE_TOO_LARGE;
    if (!takes_a_frame(device, 0)) return COLONNADE_BUSY;
    set_wide(device, REGISTER(photo_base_low), photo->base);
    set_wide(device, REGISTER(photo_windowBase_low), photo->window.base);
    set_wide(device, REGISTER(photo_windowEnd_low), photo->window.end);
    set(device, REGISTER(photo_stride), photo->stride);
    if (minor >= 3) set(device, REGISTER(photo_hasStrengths), photo->has_strengths);
    set(device, REGISTER(photo_enabled), 1);
    return COLONNADE_OK;
}

enum colonnade_error colonnade_start(struct colonnade *device, const struct colonnade_framebuffer *framebuffer) {
    static const uint32_t pixel_bytes[] = {4, 2, 8};
    if (device->width == 0 || device->height == 0) return COLONNADE_NO_FRAME;
    if (device->design->scene_page != 0 && !device->has_scene) return COLONNADE_NO_SCENE;
    if ((uint32_t)framebuffer->format > COLONNADE_LINEAR16) return COLONNADE_BAD_FORMAT;
    uint32_t row = device->design->tile_size * pixel_bytes[framebuffer->format];
    if (framebuffer->base % row != 0 || framebuffer->stride % row != 0) return COLONNADE_MISALIGNED;
    uint64_t bytes;
    if (!frame_bytes(device, framebuffer->stride, pixel_bytes[framebuffer->format], &bytes) ||
        !contains(&framebuffer->window, framebuffer->base, bytes))
        return COLONNADE_TOO_LARGE;
    if (!takes_a_frame(device, 0)) return COLONNADE_BUSY;
    set_wide(device, REGISTER(framebuffer_base_low), framebuffer->base);
    set_wide(device, REGISTER(framebuffer_windowBase_low), framebuffer->window.base);
    set_wide(device, REGISTER(framebuffer_windowEnd_low), framebuffer->window.end);
    set(device, REGISTER(framebuffer_stride), framebuffer->stride);
    set(device, REGISTER(framebuffer_format), (uint32_t)framebuffer->format);
    __sync_synchronize();
    set(device, REGISTER(control), COLONNADE_SHELL__CONTROL__START_bm);
    device->space = device->design->posted_writes;
    return COLONNADE_OK;
}

enum colonnade_error colonnade_wait_for(struct colonnade *device, uint32_t address, uint32_t mask, bool is_set,
                                        uint32_t events, uint32_t attempts) {
    const struct colonnade_bus *bus = device->bus;
    enum colonnade_error error = COLONNADE_OK;
    bool has_slept = false;
    uint32_t enabled = 0;
    while (error == COLONNADE_OK && ((get(device, address) & mask) != 0) != is_set) {
        if (attempts-- == 0) error = COLONNADE_TIMEOUT;
        else if (bus->wait != NULL && (events & device->events) != 0) {
            if (!has_slept) enabled = get(device, REGISTER(interrupt_enable));
            has_slept = true;
            /* Before each sleep, since a handler may have cleared it. Another event that stays would end all sleeps */
            colonnade_enable_interrupts(device, events);
            bus->wait(bus->context);
        }
    }
    if (has_slept) colonnade_enable_interrupts(device, enabled);
    __sync_synchronize();
    return error;
}

enum colonnade_error colonnade_wait(struct colonnade *device, uint32_t events, uint32_t attempts) {
    return colonnade_wait_for(device, REGISTER(interrupt_status), events, true, events, attempts);
}

enum colonnade_error colonnade_result(struct colonnade *device) {
    uint32_t bits = get(device, REGISTER(framebuffer_errors));
    const uint32_t windows =
        COLONNADE_SHELL__FRAMEBUFFER_ERRORS__WINDOW_bm | COLONNADE_SHELL__FRAMEBUFFER_ERRORS__PHOTOWINDOW_bm;
    const uint32_t responses =
        COLONNADE_SHELL__FRAMEBUFFER_ERRORS__RESPONSE_bm | COLONNADE_SHELL__FRAMEBUFFER_ERRORS__PHOTORESPONSE_bm;
    if (bits & windows) return COLONNADE_TOO_LARGE;
    if (bits & responses) return COLONNADE_BUS_RESPONSE;
    if (bits & COLONNADE_SHELL__FRAMEBUFFER_ERRORS__ALIGNMENT_bm) return COLONNADE_MISALIGNED;
    if (bits & COLONNADE_SHELL__FRAMEBUFFER_ERRORS__FORMAT_bm) return COLONNADE_BAD_FORMAT;
    return colonnade_device_errors(device) == 0 ? COLONNADE_OK : COLONNADE_FRAME_INVALID;
}

void colonnade_acknowledge(struct colonnade *device, uint32_t events) {
    set(device, REGISTER(interrupt_status), events & device->events);
}

void colonnade_enable_interrupts(struct colonnade *device, uint32_t events) {
    set(device, REGISTER(interrupt_enable), events & device->events);
}

enum colonnade_error colonnade_reset(struct colonnade *device, uint32_t attempts) {
    set(device, REGISTER(control), COLONNADE_SHELL__CONTROL__RESET_bm);
    device->width = device->height = 0;
    while (get(device, REGISTER(status)) != 0)
        if (attempts-- == 0) return COLONNADE_TIMEOUT;
    return COLONNADE_OK;
}

uint32_t colonnade_device_errors(struct colonnade *device) {
    uint32_t bits = 0;
    for (uint32_t i = 0; i < device->design->error_count; ++i)
        bits |= (get(device, device->design->errors + 4 * i) & 1u) << i;
    return bits;
}

uint64_t colonnade_counter(struct colonnade *device, uint32_t index) {
    if (index >= device->design->counter_count) return 0;
    uint32_t address = device->design->counters + 8 * index;
    return get(device, address) | (uint64_t)get(device, address + 4) << 32;
}

const char *colonnade_error_name(enum colonnade_error error) {
    static const char *const names[] = {
        "ok",           "noDevice",   "unknownVersion", "otherFormat", "notAnImage",   "notAFrame", "truncated",
        "tooLarge",     "misaligned", "badRegister",    "badFormat",   "noFrame",      "busy",      "timeout",
        "busResponse",  "badSection", "badLength",      "noPhoto",     "frameInvalid", "noScene",   "notAView",
        "badPose",      "badLens",    "tooFar",         "noLight",     "noSample",     "notAClip",  "outside",
        "otherRecords", "tooDeep",    "noRays",         "noRefit",     "flat",         "tooSmall",
    };
    return (size_t)error < sizeof names / sizeof *names ? names[error] : "unknown";
}

uint32_t colonnade_mmio_read(void *context, uint32_t address) { return ((volatile uint32_t *)context)[address / 4]; }

void colonnade_mmio_write(void *context, uint32_t address, uint32_t value) {
    ((volatile uint32_t *)context)[address / 4] = value;
}
