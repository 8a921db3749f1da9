/* Renders a frame under Linux by UIO: map 0 is the registers, map 1 a piece of memory that the device may use.
 *
 * usage: uio /dev/uio0 IMAGE FRAME OUTPUT
 *        uio /dev/uio0 IMAGE VIEW OUTPUT X Y Z     moves the object by whole millimetres
 *
 * IMAGE, FRAME and VIEW come from `colonnade pack`; OUTPUT receives lines of XRGB8888. colonnade_design.h comes from
 * `colonnade registers`, for the design in the chip. */
#define _POSIX_C_SOURCE 200809L

#include <fcntl.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include "colonnade.h"
#include "colonnade_design.h"
#include "colonnade_view.h"

enum { REGISTER_BYTES = 0x10000, ATTEMPTS = 100 };

struct uio {
    void *registers;
    int file;
};

static void fail(const char *what, const char *why) {
    fprintf(stderr, "%s: %s\n", what, why);
    exit(2);
}

static void check(const char *what, enum colonnade_error error) {
    if (error != COLONNADE_OK) fail(what, colonnade_error_name(error));
}

static uint32_t uio_read(void *context, uint32_t address) {
    return colonnade_mmio_read(((struct uio *)context)->registers, address);
}

static void uio_write(void *context, uint32_t address, uint32_t value) {
    colonnade_mmio_write(((struct uio *)context)->registers, address, value);
}

/* The kernel has disabled the interrupt when it came: enables it, and sleeps until the next one. */
static void uio_wait(void *context) {
    int file = ((struct uio *)context)->file;
    uint32_t value = 1;
    if (write(file, &value, sizeof value) != sizeof value || read(file, &value, sizeof value) != sizeof value)
        fail("interrupt", "no UIO interrupt");
}

/* A number of /sys/class/uio/NAME/maps/map1. */
static uint64_t memory_number(const char *device, const char *what) {
    const char *name = strrchr(device, '/');
    char path[256];
    uint64_t value;
    snprintf(path, sizeof path, "/sys/class/uio/%s/maps/map1/%s", name == NULL ? device : name + 1, what);
    FILE *file = fopen(path, "r");
    if (file == NULL || fscanf(file, "%" SCNx64, &value) != 1) fail(path, "cannot be read: the device needs a second map");
    fclose(file);
    return value;
}

static size_t read_file(const char *name, uint8_t *to, size_t most) {
    FILE *file = fopen(name, "rb");
    if (file == NULL) fail(name, "cannot be read");
    size_t bytes = fread(to, 1, most, file);
    if (fgetc(file) != EOF) fail(name, "larger than the memory of the device");
    fclose(file);
    return bytes;
}

/* The frame of a view file, with the object moved by whole millimetres; or a frame file. */
static struct colonnade_frame read_frame(char **argv, bool is_moved) {
    static uint8_t file[65536], writes[8 * 4096];
    static struct colonnade_view view;
    struct colonnade_frame frame;
    const size_t bytes = read_file(argv[3], file, sizeof file);
    if (!is_moved) {
        check(argv[3], colonnade_open_frame(&colonnade_design, file, bytes, &frame));
        return frame;
    }
    check(argv[3], colonnade_view_open(&view, &colonnade_design, file, bytes));
    struct colonnade_pose pose = view.object;
    for (int axis = 0; axis < 3; ++axis)
        pose.position[axis] += strtol(argv[5 + axis], NULL, 10) * (INT64_C(1) << 32) / 1000;
    check("pose", colonnade_view_set_object(&view, &pose));
    check("pose", colonnade_view_frame(&view, writes, sizeof writes / 8, &frame));
    return frame;
}

int main(int argc, char **argv) {
    if (argc != 5 && argc != 8) fail("usage", "uio /dev/uio0 IMAGE FRAME OUTPUT, or IMAGE VIEW OUTPUT X Y Z millimetres");
    struct uio uio = {NULL, open(argv[1], O_RDWR)};
    if (uio.file < 0) fail(argv[1], "cannot be opened");
    const uint64_t base = memory_number(argv[1], "addr"), size = memory_number(argv[1], "size");
    uio.registers = mmap(NULL, REGISTER_BYTES, PROT_READ | PROT_WRITE, MAP_SHARED, uio.file, 0);
    uint8_t *memory = mmap(NULL, size, PROT_READ | PROT_WRITE, MAP_SHARED, uio.file, sysconf(_SC_PAGESIZE));
    if (uio.registers == MAP_FAILED || memory == MAP_FAILED) fail(argv[1], "cannot be mapped");

    const struct colonnade_bus bus = {uio_read, uio_write, uio_wait, &uio};
    struct colonnade device;
    check("device", colonnade_probe(&device, &bus, &colonnade_design));
    colonnade_enable_interrupts(&device, COLONNADE_IMAGE_DONE);
    const uint32_t bytes = (uint32_t)read_file(argv[2], memory, size);
    const struct colonnade_image image = {memory, bytes, base, {base, base + size}};
    check(argv[2], colonnade_load(&device, &image, ATTEMPTS));

    const struct colonnade_frame frame = read_frame(argv, argc == 8);
    check(argv[3], colonnade_set_frame(&device, &frame));

    /* The image is not needed any more: the framebuffer takes its place */
    const uint32_t tile = colonnade_design.tile_size, stride = (frame.width + tile - 1) / tile * tile * 4;
    const struct colonnade_framebuffer framebuffer = {base, stride, COLONNADE_XRGB8888, {base, base + size}};
    colonnade_acknowledge(&device, COLONNADE_FRAME_DONE | COLONNADE_ERROR);
    colonnade_enable_interrupts(&device, COLONNADE_FRAME_DONE);
    check("start", colonnade_start(&device, &framebuffer));
    check("frame", colonnade_wait(&device, COLONNADE_FRAME_DONE, ATTEMPTS));
    check("frame", colonnade_result(&device));
    printf("%" PRIu32 "x%" PRIu32 ", %" PRIu64 " cycles\n", frame.width, frame.height,
           colonnade_counter(&device, COLONNADE_COUNTER_CYCLES));
    FILE *output = fopen(argv[4], "wb");
    if (output == NULL) fail(argv[4], "cannot be written");
    for (uint32_t line = 0; line < frame.height; ++line) fwrite(memory + (size_t)line * stride, 4, frame.width, output);
    if (fclose(output) != 0) fail(argv[4], "cannot be written");
    return 0;
}
