/* The driver against shell.c: every error that it can name, and no access that the shell refuses.
 * Prints nothing and returns 0, or the line that failed. Run it under the address sanitizer.
 *
 * usage: stub TEST */
#include "check.h"
#include "shell.h"

static const struct colonnade_design design = {
    .format_hash = {1, 2, 3, 4, 5, 6, 7, 0xFFFFFFFF},
    .device_end = 0x8030,
    .frame_registers = 0x8020,
    .errors = 0x8004,
    .error_count = 3,
    .counters = 0x8010,
    .counter_count = 2,
    .tile_size = 16,
    .posted_writes = 5, /* less than a device has, for short tests */
    .map_count = 2,
    .maps = {{1, 4}, {3, 8}},
};

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

static const struct colonnade_bus *bus_of(struct shell *shell) {
    static struct colonnade_bus bus;
    bus = (struct colonnade_bus){shell_read, shell_write, NULL, shell};
    return &bus;
}

/* A probe that fails leaves `device` alone. */
static void test_probe(struct shell *shell, struct colonnade *device) {
    const struct colonnade before = *device;
    shell->registers[AT(identity)] = 0;
    CHECK(colonnade_probe(device, bus_of(shell), &design) == COLONNADE_NO_DEVICE);
    shell->registers[AT(identity)] = 0x434C4E44;
    shell->registers[AT(version)] = 0x00020000;
    CHECK(colonnade_probe(device, bus_of(shell), &design) == COLONNADE_UNKNOWN_VERSION);
    shell->registers[AT(version)] = 0x00010007;
    shell->registers[AT(formatHash_7)] = 0;
    CHECK(colonnade_probe(device, bus_of(shell), &design) == COLONNADE_OTHER_FORMAT);
    CHECK(device->max_width == before.max_width && device->design == before.design && device->bus == before.bus);
    shell->registers[AT(formatHash_7)] = design.format_hash[7];
    shell->registers[AT(frameSize)] = 240u << 16 | 320u;
    CHECK(colonnade_probe(device, bus_of(shell), &design) == COLONNADE_OK && shell->writes == 0);
    CHECK(device->max_width == 320 && device->max_height == 240);
}

static void test_images(struct shell *shell, struct colonnade *device) {
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
    shell->registers[AT(status)] = 4;
    CHECK(colonnade_load(device, &image, 3) == COLONNADE_BUSY && shell->writes == 0);
    shell->registers[AT(status)] = 0;
    shell->outcome = 0;
    CHECK(colonnade_load(device, &image, 3) == COLONNADE_TIMEOUT);
    shell->outcome = COLONNADE_IMAGE_DONE | COLONNADE_ERROR;
    static const enum colonnade_error errors[] = {
        COLONNADE_TOO_LARGE,    COLONNADE_BUS_RESPONSE, COLONNADE_MISALIGNED, COLONNADE_NOT_AN_IMAGE,
        COLONNADE_OTHER_FORMAT, COLONNADE_BAD_SECTION,  COLONNADE_BAD_LENGTH,
    };
    for (size_t bit = 0; bit < 7; ++bit) {
        shell->registers[AT(image_errors)] = 1u << bit;
        CHECK(colonnade_load(device, &image, 3) == errors[bit]);
    }
    shell->registers[AT(image_errors)] = 0;
    CHECK(colonnade_load(device, &image, 3) == COLONNADE_OK && shell->registers[AT(interrupt_status)] == 0);
    CHECK(shell->registers[AT(image_base_low)] == 4096 && shell->registers[AT(image_bytes)] == 256);
    free(file);
}

/* An image of maps with a section for each memory, in a file of `bytes` bytes; 384 are right. */
enum { FIRST = 32, SECOND = FIRST + 4 + 4 * 1, MAPS_END = SECOND + 4 + 8 * 3 };

static uint8_t *make_maps(size_t bytes) {
    uint8_t *file = make_file("CLNDLOAD", bytes);
    put(file, 12, 2);
    put(file, FIRST, 1);
    put(file, FIRST + 1, 4);
    put(file, SECOND, 2);
    put(file, SECOND + 1, 8);
    return file;
}

/* No section is for another memory, too long or cut; what is refused reaches no register. */
static void test_maps(struct shell *shell, struct colonnade *device) {
    for (uint32_t bytes = 256; bytes <= 512; bytes += 128) {
        uint8_t *file = make_maps(bytes);
        const bool is_right = MAPS_END <= bytes / 4 && bytes / 4 < MAPS_END + 32;
        CHECK(colonnade_check_image(&design, file, bytes) == COLONNADE_OK);
        CHECK(colonnade_check_maps(&design, file, bytes) == (is_right ? COLONNADE_OK : COLONNADE_BAD_LENGTH));
        free(file);
    }
    static const struct {
        uint32_t word, value;
        enum colonnade_error error;
    } wrong[] = {
        {0, 0, COLONNADE_NOT_AN_IMAGE},
        {11, 8, COLONNADE_OTHER_FORMAT},
        {FIRST, 0, COLONNADE_BAD_SECTION},
        {FIRST, 3, COLONNADE_BAD_SECTION},
        {FIRST, UINT32_MAX, COLONNADE_BAD_SECTION},
        {SECOND + 1, 9, COLONNADE_BAD_SECTION},
        {SECOND + 1, UINT32_MAX, COLONNADE_BAD_SECTION},
        {12, 3, COLONNADE_BAD_SECTION},
        {12, UINT32_MAX, COLONNADE_BAD_SECTION},
    };
    struct colonnade_image image = {NULL, 384, 4096, {4096, 4096 + 384}};
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; ++i) {
        uint8_t *file = make_maps(384);
        put(file, wrong[i].word, wrong[i].value);
        image.data = file;
        CHECK(colonnade_load_maps(device, &image, 3) == wrong[i].error);
        free(file);
    }
    uint8_t *file = make_maps(384);
    image.data = file;
    image.window.end -= 1;
    CHECK(colonnade_load_maps(device, &image, 3) == COLONNADE_TOO_LARGE);
    image.window.end += 1;
    shell->registers[AT(status)] = 1;
    CHECK(colonnade_load_maps(device, &image, 3) == COLONNADE_BUSY && shell->writes == 0);
    shell->registers[AT(status)] = 0;
    shell->outcome = COLONNADE_IMAGE_DONE;
    device->width = 10;
    CHECK(colonnade_load_maps(device, &image, 3) == COLONNADE_OK && device->width == 10);
    CHECK(shell->registers[AT(image_base_low)] == 4096 && shell->registers[AT(image_bytes)] == 384);
    image.data = NULL;
    CHECK(colonnade_load_maps(device, &image, 3) == COLONNADE_OK);
    free(file);
}

static void test_frames(struct shell *shell, struct colonnade *device) {
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
    frame.count = 5;
    CHECK(colonnade_set_frame(device, &frame) == COLONNADE_BAD_REGISTER);
    frame.count = 2;
    shell->registers[AT(status)] = 3;
    CHECK(colonnade_set_frame(device, &frame) == COLONNADE_BUSY);
    shell->registers[AT(status)] = 0;
    CHECK(colonnade_set_frame(device, &frame) == COLONNADE_OK && shell->device[8] == 99 && shell->device[11] == 77);

    shell->outcome = COLONNADE_FRAME_DONE;
    CHECK(colonnade_start(device, &framebuffer) == COLONNADE_OK);
    CHECK(shell->registers[AT(framebuffer_base_high)] == 1 && shell->registers[AT(framebuffer_stride)] == 64);
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
    shell->registers[AT(status)] = 3;
    CHECK(colonnade_start(device, &framebuffer) == COLONNADE_BUSY);
    shell->registers[AT(status)] = 0;

    static const enum colonnade_error errors[] = {COLONNADE_TOO_LARGE,  COLONNADE_BUS_RESPONSE, COLONNADE_MISALIGNED,
                                                  COLONNADE_BAD_FORMAT, COLONNADE_TOO_LARGE,    COLONNADE_BUS_RESPONSE};
    for (size_t bit = 0; bit < 6; ++bit) {
        shell->registers[AT(framebuffer_errors)] = 1u << bit;
        CHECK(colonnade_result(device) == errors[bit]);
    }
    shell->registers[AT(framebuffer_errors)] = 0;
    CHECK(colonnade_result(device) == COLONNADE_OK);
    shell->device[3] = 1;
    CHECK(colonnade_result(device) == COLONNADE_FRAME_INVALID && colonnade_device_errors(device) == 4);
    shell->device[6] = 5;
    shell->device[7] = 6;
    CHECK(colonnade_counter(device, 1) == 0x600000005 && colonnade_counter(device, 2) == 0);
    shell->registers[AT(status)] = 8;
    CHECK(colonnade_reset(device, 3) == COLONNADE_TIMEOUT);
    shell->registers[AT(status)] = 0;
    CHECK(colonnade_reset(device, 3) == COLONNADE_OK);
    CHECK(colonnade_start(device, &framebuffer) == COLONNADE_NO_FRAME);
    free(file);
}

/* A scene on chip; then one in DRAM, whose page every frame gets. */
static void test_scenes(struct shell *shell, struct colonnade *device) {
    static const uint8_t writes[8] = {8}; /* page 0 */
    const struct colonnade_frame frame = {writes, 1, 10, 2};
    const struct colonnade_framebuffer framebuffer = {4096, 64, COLONNADE_XRGB8888, {4096, 4096 + 128}};
    CHECK(colonnade_set_scene(device, 4096) == COLONNADE_NO_SCENE);
    struct colonnade_design in_dram = design;
    in_dram.scene_page = 0x8020;
    in_dram.invalidate = 0x8000;
    device->design = shell->design = &in_dram;
    CHECK(colonnade_set_frame(device, &frame) == COLONNADE_OK);
    CHECK(colonnade_start(device, &framebuffer) == COLONNADE_NO_SCENE);
    CHECK(colonnade_set_scene(device, 2048) == COLONNADE_MISALIGNED);
    CHECK(colonnade_set_scene(device, 1ull << 40) == COLONNADE_TOO_LARGE);
    shell->registers[AT(status)] = 2;
    CHECK(colonnade_set_scene(device, 4096) == COLONNADE_BUSY);
    shell->registers[AT(status)] = 0;
    CHECK(colonnade_start(device, &framebuffer) == COLONNADE_NO_SCENE);
    CHECK(colonnade_set_scene(device, (1ull << 40) - 4096) == COLONNADE_OK);
    CHECK(shell->device[8] == 0xFFFFFFF && shell->device[0] == 1);
    shell->device[8] = 0;
    CHECK(colonnade_set_frame(device, &frame) == COLONNADE_OK && shell->device[8] == 0xFFFFFFF);
    CHECK(colonnade_start(device, &framebuffer) == COLONNADE_OK);
}

static void test_photos(struct shell *shell, struct colonnade *device) {
    struct colonnade_photo photo = {4096, 64, {4096, 4096 + 2 * 64}, false};
    shell->registers[AT(version)] = 0x00010000;
    CHECK(colonnade_set_photo(device, &photo) == COLONNADE_NO_PHOTO &&
          colonnade_set_photo(device, NULL) == COLONNADE_OK);
    shell->registers[AT(version)] = 0x00010001;
    CHECK(colonnade_set_photo(device, &photo) == COLONNADE_NO_PHOTO &&
          colonnade_set_photo(device, NULL) == COLONNADE_OK);
    shell->registers[AT(capabilities)] = COLONNADE_SHELL__CAPABILITIES__ENVIRONMENT_bm;
    CHECK(colonnade_probe(device, bus_of(shell), &design) == COLONNADE_OK);
    CHECK(colonnade_set_photo(device, &photo) == COLONNADE_NO_FRAME);
    device->width = 10;
    device->height = 2;
    photo.window.end -= 1;
    CHECK(colonnade_set_photo(device, &photo) == COLONNADE_TOO_LARGE);
    photo.window.end += 1;
    photo.base += 4;
    CHECK(colonnade_set_photo(device, &photo) == COLONNADE_MISALIGNED);
    photo.base -= 4;
    shell->registers[AT(status)] = 2;
    CHECK(colonnade_set_photo(device, &photo) == COLONNADE_BUSY && colonnade_set_photo(device, NULL) == COLONNADE_BUSY);
    shell->registers[AT(status)] = 1;
    CHECK(colonnade_set_photo(device, &photo) == COLONNADE_OK && shell->registers[AT(photo_enabled)] == 1);
    CHECK(shell->registers[AT(photo_base_low)] == 4096 && shell->registers[AT(photo_stride)] == 64);
    photo.has_strengths = true;
    CHECK(colonnade_set_photo(device, &photo) == COLONNADE_NO_PHOTO && shell->registers[AT(photo_hasStrengths)] == 0);
    shell->registers[AT(version)] = 0x00010003;
    CHECK(colonnade_set_photo(device, &photo) == COLONNADE_OK && shell->registers[AT(photo_hasStrengths)] == 1);
    photo.has_strengths = false;
    CHECK(colonnade_set_photo(device, &photo) == COLONNADE_OK && shell->registers[AT(photo_hasStrengths)] == 0);
    CHECK(colonnade_set_photo(device, NULL) == COLONNADE_OK && shell->registers[AT(photo_enabled)] == 0);
}

/* While a frame runs the shell queues so many writes: `busy` comes before one of them is refused, and before half a
 * set. */
static void test_posted_writes(struct shell *shell, struct colonnade *device) {
    static const uint8_t writes[16] = {8, 0, 0, 0, 1, 0, 0, 0, 11, 0, 0, 0, 2};
    const struct colonnade_frame frame = {writes, 2, 10, 2};
    const struct colonnade_framebuffer framebuffer = {4096, 64, COLONNADE_XRGB8888, {4096, 4096 + 128}};
    const struct colonnade_bus *bus = device->bus;
    shell->is_scripted = false;
    CHECK(colonnade_set_frame(device, &frame) == COLONNADE_OK && colonnade_start(device, &framebuffer) == COLONNADE_OK);
    shell_step(shell, 0); /* the frame begins */
    CHECK(shell->registers[AT(status)] == 1);
    for (int set = 0; set < 2; ++set) CHECK(colonnade_set_frame(device, &frame) == COLONNADE_OK);
    uint32_t count = shell->writes;
    CHECK(colonnade_set_frame(device, &frame) == COLONNADE_BUSY && shell->writes == count);
    CHECK(shell->posted == 4);

    /* The queued frame begins with an empty queue */
    CHECK(colonnade_start(device, &framebuffer) == COLONNADE_OK);
    CHECK(colonnade_set_frame(device, &frame) == COLONNADE_BUSY);
    shell_step(shell, 1);
    CHECK(shell->registers[AT(status)] == 2 && colonnade_set_frame(device, &frame) == COLONNADE_BUSY);
    for (int word = 0; word < 4; ++word) shell_step(shell, 0);
    CHECK(shell->registers[AT(status)] == 1 && shell->posted == 0);
    for (int set = 0; set < 2; ++set) CHECK(colonnade_set_frame(device, &frame) == COLONNADE_OK);
    CHECK(colonnade_set_frame(device, &frame) == COLONNADE_BUSY);

    /* Another program cannot know what has been written since the start of the frame that runs */
    count = shell->writes;
    CHECK(colonnade_probe(device, bus, &design) == COLONNADE_OK);
    CHECK(colonnade_set_frame(device, &frame) == COLONNADE_BUSY && shell->writes == count);
    shell_step(shell, 1);
    CHECK(colonnade_set_frame(device, &frame) == COLONNADE_OK);
}

/* A frame file is bounded: as many writes as there are registers of a frame. */
static void test_long_frame_files(struct shell *shell, struct colonnade *device) {
    (void)shell, (void)device;
    struct colonnade_frame frame;
    for (uint32_t count = 4; count <= 1000; count += 996) {
        uint8_t *file = make_file("CLNDFRAM", 64 + 8 * count);
        put(file, 14, count);
        for (uint32_t i = 0; i < count; ++i) put(file, 16 + 2 * i, 8 + i % 4);
        CHECK(colonnade_open_frame(&design, file, 64 + 8 * count, &frame) ==
              (count == 4 ? COLONNADE_OK : COLONNADE_BAD_REGISTER));
        free(file);
    }
}

/* The caller's frame is filled on success only: it may be the last good one. */
static void test_refused_frame_files(struct shell *shell, struct colonnade *device) {
    (void)shell, (void)device;
    const uint8_t last = 0;
    struct colonnade_frame frame = {&last, 1, 2, 3};
    uint8_t *file = make_file("CLNDFRAM", 64 + 8);
    put(file, 12, 10);
    put(file, 13, 2);
    put(file, 14, 2);
    CHECK(colonnade_open_frame(&design, file, 72, &frame) == COLONNADE_TRUNCATED);
    put(file, 14, 1);
    put(file, 16, 0x3FFFFFFF);
    CHECK(colonnade_open_frame(&design, file, 72, &frame) == COLONNADE_BAD_REGISTER);
    CHECK(frame.writes == &last && frame.count == 1 && frame.width == 2 && frame.height == 3);
    free(file);
}

/* The shell refuses a value with other bits. */
static void test_events(struct shell *shell, struct colonnade *device) {
    shell->registers[AT(interrupt_status)] = 7;
    colonnade_enable_interrupts(device, UINT32_MAX);
    colonnade_acknowledge(device, 0xFFFFFFFD);
    CHECK(shell->registers[AT(interrupt_enable)] == 7 && shell->registers[AT(interrupt_status)] == 2);
}

static void test_names(struct shell *shell, struct colonnade *device) {
    (void)shell, (void)device;
    for (int error = COLONNADE_OK; error <= COLONNADE_TOO_SMALL; ++error)
        CHECK(strcmp(colonnade_error_name((enum colonnade_error)error), "unknown") != 0);
    CHECK(strcmp(colonnade_error_name((enum colonnade_error)(COLONNADE_TOO_SMALL + 1)), "unknown") == 0);
    uint32_t word = 3;
    colonnade_mmio_write(&word, 0, 4);
    CHECK(colonnade_mmio_read(&word, 0) == 4);
}

int main(int argc, char **argv) {
    static const struct {
        const char *name;
        void (*run)(struct shell *shell, struct colonnade *device);
    } tests[] = {
        {"probe", test_probe},   {"images", test_images},
        {"frames", test_frames}, {"photos", test_photos},
        {"scenes", test_scenes}, {"posted writes", test_posted_writes},
        {"events", test_events}, {"long frame files", test_long_frame_files},
        {"names", test_names},   {"refused frame files", test_refused_frame_files},
        {"maps", test_maps},
    };
    struct shell *shell = calloc(1, sizeof *shell);
    CHECK(argc == 2 && shell != NULL);
    *shell = shell_of(&design, 2);
    shell->is_scripted = true;
    struct colonnade device;
    CHECK(colonnade_probe(&device, bus_of(shell), &design) == COLONNADE_OK);
    size_t test = 0;
    while (test < sizeof tests / sizeof *tests && strcmp(tests[test].name, argv[1]) != 0) ++test;
    CHECK(test < sizeof tests / sizeof *tests);
    tests[test].run(shell, &device);
    free(shell);
    return 0;
}
