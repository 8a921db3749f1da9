/* The driver against an array of registers: every error that it can name, and that it makes no access beyond it.
 * Prints nothing and returns 0, or the line that failed. Run it under the address sanitizer. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "colonnade.h"
#include "colonnade_shell.h"

#define CHECK(condition) \
    do { \
        if (!(condition)) { \
            fprintf(stderr, "stub.c:%d: %s\n", __LINE__, #condition); \
            exit(1); \
        } \
    } while (0)
#define AT(name) (offsetof(colonnade_shell_t, name) / 4)

static const struct colonnade_design design = {
    .format_hash = {1, 2, 3, 4, 5, 6, 7, 0xFFFFFFFF},
    .device_end = 0x8030,
    .frame_registers = 0x8020,
    .errors = 0x8004,
    .error_count = 3,
    .counters = 0x8010,
    .counter_count = 2,
    .tile_size = 16,
};

/* The shell's registers, and those of the device behind them; a command is answered by `outcome`. */
struct stub {
    uint32_t shell[sizeof(colonnade_shell_t) / 4];
    uint32_t device[12];
    uint32_t outcome, writes;
};

static uint32_t *place(struct stub *stub, uint32_t address) {
    if (address >= 0x8000) {
        CHECK(address < design.device_end);
        return &stub->device[(address - 0x8000) / 4];
    }
    CHECK(address % 4 == 0 && address < sizeof stub->shell);
    return &stub->shell[address / 4];
}

static uint32_t stub_read(void *context, uint32_t address) { return *place(context, address); }

static void stub_write(void *context, uint32_t address, uint32_t value) {
    struct stub *stub = context;
    ++stub->writes;
    if (address == 4 * AT(control)) stub->shell[AT(interrupt_status)] |= stub->outcome;
    else if (address == 4 * AT(interrupt_status)) stub->shell[AT(interrupt_status)] &= ~value;
    else *place(stub, address) = value;
}

static void put(uint8_t *bytes, size_t word, uint32_t value) {
    for (size_t i = 0; i < 4; ++i) bytes[4 * word + i] = (uint8_t)(value >> (8 * i));
}

/* A file whose memory ends where the file ends. */
static uint8_t *make_file(const char *magic, size_t bytes) {
    uint8_t *file = calloc(bytes, 1);
    CHECK(file != NULL);
    memcpy(file, magic, 8);
    put(file, 2, 1);
    put(file, 3, (uint32_t)bytes);
    for (size_t i = 0; i < 8; ++i) put(file, 4 + i, design.format_hash[i]);
    return file;
}

/* A copy of the beginning of a file; the sanitizer sees a read behind it. */
static uint8_t *cut(const uint8_t *file, size_t bytes) {
    uint8_t *copy = malloc(bytes);
    CHECK(copy != NULL);
    memcpy(copy, file, bytes);
    return copy;
}

static void test_probe(struct stub *stub, const struct colonnade_bus *bus) {
    struct colonnade device;
    CHECK(colonnade_probe(&device, bus, &design) == COLONNADE_NO_DEVICE);
    stub->shell[AT(identity)] = 0x434C4E44;
    stub->shell[AT(version)] = 0x00020000;
    CHECK(colonnade_probe(&device, bus, &design) == COLONNADE_UNKNOWN_VERSION);
    stub->shell[AT(version)] = 0x00010007;
    for (size_t i = 0; i < 7; ++i) stub->shell[AT(formatHash_0) + i] = design.format_hash[i];
    CHECK(colonnade_probe(&device, bus, &design) == COLONNADE_OTHER_FORMAT);
    stub->shell[AT(formatHash_7)] = design.format_hash[7];
    stub->shell[AT(frameSize)] = 480u << 16 | 640u;
    CHECK(colonnade_probe(&device, bus, &design) == COLONNADE_OK && stub->writes == 0);
    CHECK(device.max_width == 640 && device.max_height == 480);
}

static void test_images(struct stub *stub, struct colonnade *device) {
    uint8_t *file = make_file("CLNDLOAD", 256);
    struct colonnade_image image = {file, 256, 0x10000000080, {0x10000000080, 0x10000000180}};
    CHECK(colonnade_load(device, &image, 3) == COLONNADE_TOO_LARGE); /* beyond 40 bits */
    image = (struct colonnade_image){file, 256, 4096, {4096, 4096 + 256}};
    for (size_t bytes = 8; bytes < 256; bytes += 8) {
        uint8_t *part = cut(file, bytes);
        CHECK(colonnade_check_image(&design, part, bytes) == COLONNADE_TRUNCATED);
        free(part);
    }
    image.window.end -= 1;
    CHECK(colonnade_load(device, &image, 3) == COLONNADE_TOO_LARGE);
    image.window.end += 1;
    image.window.base += 1;
    CHECK(colonnade_load(device, &image, 3) == COLONNADE_TOO_LARGE);
    image.window = (struct colonnade_window){4096, 0};
    CHECK(colonnade_load(device, &image, 3) == COLONNADE_TOO_LARGE);
    image.window = (struct colonnade_window){0, 8192};
    image.address = 4097;
    CHECK(colonnade_load(device, &image, 3) == COLONNADE_MISALIGNED);
    image.address = 4096;
    file[0] = 'X';
    CHECK(colonnade_load(device, &image, 3) == COLONNADE_NOT_AN_IMAGE);
    file[0] = 'C';
    put(file, 2, 2);
    CHECK(colonnade_load(device, &image, 3) == COLONNADE_NOT_AN_IMAGE);
    put(file, 2, 1);
    put(file, 11, 0);
    CHECK(colonnade_load(device, &image, 3) == COLONNADE_OTHER_FORMAT);
    put(file, 11, design.format_hash[7]);
    stub->shell[AT(status)] = 4;
    CHECK(colonnade_load(device, &image, 3) == COLONNADE_BUSY && stub->writes == 0);
    stub->shell[AT(status)] = 0;
    stub->outcome = 0;
    CHECK(colonnade_load(device, &image, 3) == COLONNADE_TIMEOUT);
    stub->outcome = COLONNADE_IMAGE_DONE | COLONNADE_ERROR;
    static const enum colonnade_error errors[] = {
        COLONNADE_TOO_LARGE,    COLONNADE_BUS_RESPONSE, COLONNADE_MISALIGNED, COLONNADE_NOT_AN_IMAGE,
        COLONNADE_OTHER_FORMAT, COLONNADE_BAD_SECTION,  COLONNADE_BAD_LENGTH,
    };
    for (size_t bit = 0; bit < 7; ++bit) {
        stub->shell[AT(image_errors)] = 1u << bit;
        CHECK(colonnade_load(device, &image, 3) == errors[bit]);
    }
    stub->shell[AT(image_errors)] = 0;
    CHECK(colonnade_load(device, &image, 3) == COLONNADE_OK && stub->shell[AT(interrupt_status)] == 0);
    CHECK(stub->shell[AT(image_base_low)] == 4096 && stub->shell[AT(image_bytes)] == 256);
    free(file);
}

static void test_frames(struct stub *stub, struct colonnade *device) {
    struct colonnade_frame frame;
    struct colonnade_framebuffer framebuffer = {0x100000000, 64, COLONNADE_XRGB8888, {0x100000000, 0x100000000 + 128}};
    CHECK(colonnade_start(device, &framebuffer) == COLONNADE_NO_FRAME);
    uint8_t *file = make_file("CLNDFRAM", 64 + 16);
    put(file, 12, 10);
    put(file, 13, 2);
    put(file, 14, 2);
    put(file, 16, 8);
    put(file, 17, 99);
    put(file, 18, 11);
    put(file, 19, 77);
    for (size_t bytes = 8; bytes < 80; bytes += 4) {
        uint8_t *part = cut(file, bytes);
        CHECK(colonnade_open_frame(&design, part, bytes, &frame) == COLONNADE_TRUNCATED);
        free(part);
    }
    CHECK(colonnade_open_frame(&design, file, 80, &frame) == COLONNADE_OK);
    put(file, 14, 0x20000002);
    CHECK(colonnade_open_frame(&design, file, 80, &frame) == COLONNADE_TRUNCATED);
    put(file, 14, 2);
    static const uint32_t wrong[] = {0, 7, 12, 0x40000008, 0xFFFFFFFF};
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; ++i) {
        put(file, 18, wrong[i]);
        CHECK(colonnade_open_frame(&design, file, 80, &frame) == COLONNADE_BAD_REGISTER);
    }
    put(file, 18, 11);
    file[7] = 'X';
    CHECK(colonnade_open_frame(&design, file, 80, &frame) == COLONNADE_NOT_A_FRAME);
    file[7] = 'M';
    put(file, 4, 0);
    CHECK(colonnade_open_frame(&design, file, 80, &frame) == COLONNADE_OTHER_FORMAT);
    put(file, 4, 1);
    CHECK(colonnade_open_frame(&design, file, 80, &frame) == COLONNADE_OK);
    frame.width = 641;
    CHECK(colonnade_set_frame(device, &frame) == COLONNADE_TOO_LARGE);
    frame.width = 10;
    stub->shell[AT(status)] = 3;
    CHECK(colonnade_set_frame(device, &frame) == COLONNADE_BUSY);
    stub->shell[AT(status)] = 1;
    CHECK(colonnade_set_frame(device, &frame) == COLONNADE_OK && stub->device[8] == 99 && stub->device[11] == 77);

    stub->outcome = COLONNADE_FRAME_DONE;
    CHECK(colonnade_start(device, &framebuffer) == COLONNADE_OK);
    CHECK(stub->shell[AT(framebuffer_base_high)] == 1 && stub->shell[AT(framebuffer_stride)] == 64);
    framebuffer.window.end -= 1;
    CHECK(colonnade_start(device, &framebuffer) == COLONNADE_TOO_LARGE);
    framebuffer.window = (struct colonnade_window){0, UINT64_MAX};
    CHECK(colonnade_start(device, &framebuffer) == COLONNADE_TOO_LARGE);
    framebuffer.window.end = 0xFFFFFFFFFF;
    framebuffer.base += 4;
    CHECK(colonnade_start(device, &framebuffer) == COLONNADE_MISALIGNED);
    framebuffer.base -= 4;
    framebuffer.stride = 0;
    CHECK(colonnade_start(device, &framebuffer) == COLONNADE_TOO_LARGE);
    framebuffer.stride = 1u << 24;
    CHECK(colonnade_start(device, &framebuffer) == COLONNADE_TOO_LARGE);
    framebuffer.stride = 64;
    framebuffer.format = (enum colonnade_format)3;
    CHECK(colonnade_start(device, &framebuffer) == COLONNADE_BAD_FORMAT);
    framebuffer.format = COLONNADE_XRGB8888;
    stub->shell[AT(status)] = 3;
    CHECK(colonnade_start(device, &framebuffer) == COLONNADE_BUSY);
    stub->shell[AT(status)] = 0;

    static const enum colonnade_error errors[] = {COLONNADE_TOO_LARGE,  COLONNADE_BUS_RESPONSE, COLONNADE_MISALIGNED,
                                                  COLONNADE_BAD_FORMAT, COLONNADE_TOO_LARGE,    COLONNADE_BUS_RESPONSE};
    for (size_t bit = 0; bit < 6; ++bit) {
        stub->shell[AT(framebuffer_errors)] = 1u << bit;
        CHECK(colonnade_result(device) == errors[bit]);
    }
    stub->shell[AT(framebuffer_errors)] = 0;
    CHECK(colonnade_result(device) == COLONNADE_OK);
    stub->device[3] = 1;
    CHECK(colonnade_result(device) == COLONNADE_FRAME_INVALID && colonnade_device_errors(device) == 4);
    stub->device[6] = 5;
    stub->device[7] = 6;
    CHECK(colonnade_counter(device, 1) == 0x600000005 && colonnade_counter(device, 2) == 0);
    stub->shell[AT(status)] = 8;
    CHECK(colonnade_reset(device, 3) == COLONNADE_TIMEOUT);
    stub->shell[AT(status)] = 0;
    CHECK(colonnade_reset(device, 3) == COLONNADE_OK);
    CHECK(colonnade_start(device, &framebuffer) == COLONNADE_NO_FRAME);
    free(file);
}

/* A scene on chip; then one in DRAM, whose page every frame gets. */
static void test_scenes(struct stub *stub, struct colonnade *device) {
    static const uint8_t writes[8] = {8}; /* page 0 */
    const struct colonnade_frame frame = {writes, 1, 10, 2};
    const struct colonnade_framebuffer framebuffer = {4096, 64, COLONNADE_XRGB8888, {4096, 4096 + 128}};
    CHECK(colonnade_set_scene(device, 4096) == COLONNADE_NO_SCENE);
    struct colonnade_design in_dram = design;
    in_dram.scene_page = 0x8020;
    in_dram.invalidate = 0x8000;
    device->design = &in_dram;
    stub->shell[AT(status)] = 1;
    CHECK(colonnade_set_frame(device, &frame) == COLONNADE_OK);
    CHECK(colonnade_start(device, &framebuffer) == COLONNADE_NO_SCENE);
    CHECK(colonnade_set_scene(device, 2048) == COLONNADE_MISALIGNED);
    CHECK(colonnade_set_scene(device, 1ull << 40) == COLONNADE_TOO_LARGE);
    stub->shell[AT(status)] = 2;
    CHECK(colonnade_set_scene(device, 4096) == COLONNADE_BUSY);
    stub->shell[AT(status)] = 1;
    CHECK(colonnade_start(device, &framebuffer) == COLONNADE_NO_SCENE);
    CHECK(colonnade_set_scene(device, (1ull << 40) - 4096) == COLONNADE_OK);
    CHECK(stub->device[8] == 0xFFFFFFF && stub->device[0] == 1);
    stub->device[8] = 0;
    CHECK(colonnade_set_frame(device, &frame) == COLONNADE_OK && stub->device[8] == 0xFFFFFFF);
    CHECK(colonnade_start(device, &framebuffer) == COLONNADE_OK);
    stub->shell[AT(status)] = 0;
    device->design = &design;
    device->has_scene = false;
}

static void test_photos(struct stub *stub, struct colonnade *device) {
    struct colonnade_photo photo = {4096, 64, {4096, 4096 + 2 * 64}};
    device->width = device->height = 0;
    stub->shell[AT(version)] = 0x00010000;
    CHECK(colonnade_set_photo(device, &photo) == COLONNADE_NO_PHOTO && colonnade_set_photo(device, NULL) == COLONNADE_OK);
    stub->shell[AT(version)] = 0x00010001;
    CHECK(colonnade_set_photo(device, &photo) == COLONNADE_NO_PHOTO && colonnade_set_photo(device, NULL) == COLONNADE_OK);
    device->capabilities = COLONNADE_SHELL__CAPABILITIES__ENVIRONMENT_bm;
    CHECK(colonnade_set_photo(device, &photo) == COLONNADE_NO_FRAME);
    device->width = 10;
    device->height = 2;
    photo.window.end -= 1;
    CHECK(colonnade_set_photo(device, &photo) == COLONNADE_TOO_LARGE);
    photo.window.end += 1;
    photo.base += 4;
    CHECK(colonnade_set_photo(device, &photo) == COLONNADE_MISALIGNED);
    photo.base -= 4;
    stub->shell[AT(status)] = 2;
    CHECK(colonnade_set_photo(device, &photo) == COLONNADE_BUSY && colonnade_set_photo(device, NULL) == COLONNADE_BUSY);
    stub->shell[AT(status)] = 1;
    CHECK(colonnade_set_photo(device, &photo) == COLONNADE_OK && stub->shell[AT(photo_enabled)] == 1);
    CHECK(stub->shell[AT(photo_base_low)] == 4096 && stub->shell[AT(photo_stride)] == 64);
    CHECK(colonnade_set_photo(device, NULL) == COLONNADE_OK && stub->shell[AT(photo_enabled)] == 0);
}

int main(void) {
    struct stub *stub = calloc(1, sizeof *stub);
    CHECK(stub != NULL);
    const struct colonnade_bus bus = {stub_read, stub_write, NULL, stub};
    struct colonnade device;
    test_probe(stub, &bus);
    CHECK(colonnade_probe(&device, &bus, &design) == COLONNADE_OK);
    test_images(stub, &device);
    test_frames(stub, &device);
    test_photos(stub, &device);
    test_scenes(stub, &device);
    for (int error = COLONNADE_OK; error <= COLONNADE_NO_SCENE; ++error)
        CHECK(strcmp(colonnade_error_name((enum colonnade_error)error), "unknown") != 0);
    CHECK(strcmp(colonnade_error_name((enum colonnade_error)(COLONNADE_NO_SCENE + 1)), "unknown") == 0);
    uint32_t word = 3;
    colonnade_mmio_write(&word, 0, 4);
    CHECK(colonnade_mmio_read(&word, 0) == 4);
    free(stub);
    return 0;
}
