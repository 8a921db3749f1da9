/* libFuzzer on the driver (tools/driver-fuzz): calls in any order with files that end where their memory ends, against
 * shell.c, which ends the program at an access that the shell refuses. An input chooses the calls, how they go wrong,
 * and how fast the device is. */
#include "fuzz.h"
#include "shell.h"

enum { FIRST = 40, END = 60, FRAME_WORDS = END - FIRST, CALLS = 64, MAX_ACCESSES = 1000 };

static struct shell shell;
static uint32_t pace;

/* How far the device gets between two accesses. */
static void step(void) {
    const uint32_t any = next_noise(), events = any >> 24 < pace ? any >> 8 : 0;
    shell_step(&shell, (any & 1u << 23) != 0 ? events : events & 0xFF);
}

static uint32_t bus_read(void *context, uint32_t address) {
    step();
    return shell_read(context, address);
}

static void bus_write(void *context, uint32_t address, uint32_t value) {
    step();
    shell_write(context, address, value);
}

static void bus_wait(void *context) {
    (void)context;
    step();
    if ((next_noise() & 1) != 0) shell.registers[AT(interrupt_enable)] = 0; /* by a handler */
}

static void put(uint8_t *file, size_t size, size_t word, uint32_t value) {
    for (size_t i = 0; i < 4; ++i)
        if (4 * word + i < size) file[4 * word + i] = (uint8_t)(value >> (8 * i));
}

/* A file of `words` words in memory of its size: right, but for as many bytes as the input says, and for its length. */
static uint8_t *make_file(const char *magic, size_t words, size_t *size) {
    const uint32_t wrong = take() % 8, cut = take();
    *size = cut < 192 ? 4 * words : take32() % (4 * words + 8);
    uint8_t *file = calloc(*size == 0 ? 1 : *size, 1);
    CHECK(file != NULL);
    memcpy(file, magic, *size < 8 ? *size : 8);
    put(file, *size, 2, 1);
    put(file, *size, 3, (uint32_t)(4 * words));
    for (size_t i = 0; i < 8; ++i) put(file, *size, 4 + i, shell.design->format_hash[i]);
    if (magic[4] == 'F') {
        const uint32_t seed = take();
        put(file, *size, 12, take() % 80);
        put(file, *size, 13, take() % 80);
        put(file, *size, 14, (uint32_t)(words - 16) / 2);
        for (size_t i = 0; 16 + 2 * i < words; ++i) {
            put(file, *size, 16 + 2 * i, FIRST + (seed + (uint32_t)i) % FRAME_WORDS);
            put(file, *size, 17 + 2 * i, seed << 8 | (uint32_t)i);
        }
    } else {
        const uint32_t sections = take() % 4;
        put(file, *size, 12, sections);
        for (size_t i = 0, at = 32; i < sections && at + 1 < words; ++i) {
            const uint32_t target = take() % 4, records = take() % 10;
            put(file, *size, at, target);
            put(file, *size, at + 1, records);
            at += 4 + (size_t)records * (target == 0 || target > 2 ? 1 : shell.design->maps[target - 1].words);
        }
    }
    for (uint32_t i = wrong < 4 ? 0 : wrong - 3; i > 0 && *size > 0; --i) {
        const size_t at = (take() << 8 | take()) % *size;
        file[at] = (uint8_t)take();
    }
    return file;
}

/* An address near one of the borders that matter, or anywhere. */
static uint64_t take_address(void) {
    static const uint64_t places[] = {0, 4096, 1u << 20, 1ull << 32, 1ull << 40, UINT64_MAX};
    const uint32_t place = take() % 8, offset = take();
    const uint64_t distance = offset < 128 ? offset % 4 * 4096u : take32() % 65536;
    if (place >= 6) return take64();
    return (offset & 1) != 0 ? places[place] - distance : places[place] + distance;
}

static struct colonnade_window take_window(uint64_t from, uint64_t bytes) {
    const uint64_t base = take() < 192 ? from : take_address();
    return (struct colonnade_window){base, take() < 192 ? from + bytes : take_address()};
}

/* A stride that fits, or any. */
static uint32_t take_stride(const struct colonnade *device, uint32_t pixel_bytes) {
    const uint32_t tile = device->design->tile_size;
    return take() < 192 ? (device->width + tile - 1) / tile * tile * pixel_bytes : take32();
}

static void load(struct colonnade *device) {
    const uint32_t writes = shell.writes;
    size_t bytes;
    uint8_t *file = make_file("CLNDLOAD", 32 * (1 + take() % 4), &bytes);
    const uint64_t address = take_address();
    const struct colonnade_image image = {take() < 192 ? file : NULL, (uint32_t)bytes, address,
                                          take_window(address, bytes)};
    const bool maps = take() % 2 != 0;
    const bool is_right =
        (maps ? colonnade_check_maps : colonnade_check_image)(device->design, file, bytes) == COLONNADE_OK;
    const enum colonnade_error error = (maps ? colonnade_load_maps : colonnade_load)(device, &image, take() % 16);
    CHECK(error != COLONNADE_BUSY || shell.writes == writes);
    CHECK(error != COLONNADE_OK || is_right || image.data == NULL);
    free(file);
}

static void open_frame(const struct colonnade *device, uint8_t **file, struct colonnade_frame *frame) {
    const uint32_t kind = take();
    const size_t count = kind < 160 ? FRAME_WORDS : kind < 208 ? kind % FRAME_WORDS : take() << 2;
    size_t bytes;
    uint8_t *read = make_file("CLNDFRAM", 16 + 2 * count, &bytes);
    struct colonnade_frame before;
    memcpy(&before, frame, sizeof before);
    if (colonnade_open_frame(device->design, read, bytes, frame) == COLONNADE_OK) {
        CHECK(bytes == 64 + 8u * frame->count && frame->count <= FRAME_WORDS && frame->writes == read + 64);
        free(*file);
        *file = read;
    } else {
        CHECK(memcmp(&before, frame, sizeof before) == 0);
        free(read);
    }
}

static void set_frame(struct colonnade *device, const struct colonnade_frame *frame) {
    if (colonnade_set_frame(device, frame) != COLONNADE_OK) return;
    uint32_t expected[DEVICE_WORDS];
    memcpy(expected, shell.device, sizeof expected);
    for (size_t i = 0; i < frame->count; ++i) {
        const uint8_t *at = frame->writes + 8 * i;
        const uint32_t value = at[4] | (uint32_t)at[5] << 8 | (uint32_t)at[6] << 16 | (uint32_t)at[7] << 24;
        expected[at[0]] = value;
    }
    if (device->has_scene) expected[(device->design->scene_page - DEVICE_BASE) / 4] = (uint32_t)(device->scene >> 12);
    CHECK(memcmp(expected, shell.device, sizeof expected) == 0);
}

static void start(struct colonnade *device) {
    static const uint32_t pixel_bytes[] = {4, 2, 8, 1};
    const uint32_t format = take() % 4;
    const uint64_t base = take_address();
    const uint32_t stride = take_stride(device, pixel_bytes[format]);
    const struct colonnade_framebuffer framebuffer = {base, stride, (enum colonnade_format)format,
                                                      take_window(base, (uint64_t)stride * device->height)};
    colonnade_start(device, &framebuffer);
}

static void set_photo(struct colonnade *device) {
    const uint64_t base = take_address();
    const uint32_t stride = take_stride(device, 4);
    const struct colonnade_window window = take_window(base, (uint64_t)stride * device->height);
    const struct colonnade_photo photo = {base, stride, window, take() % 2 != 0};
    colonnade_set_photo(device, take() < 224 ? &photo : NULL);
}

/* Another program takes the device over, in any state; or it is another device. */
static void probe(struct colonnade *device, const struct colonnade_bus *bus) {
    static const size_t words[] = {AT(identity), AT(version), AT(formatHash_0), AT(formatHash_7)};
    const size_t word = words[take() % 4];
    const uint32_t value = shell.registers[word];
    struct colonnade before;
    memcpy(&before, device, sizeof before);
    shell.registers[word] ^= take() < 128 ? 0 : 1u << take() % 32;
    if (colonnade_probe(device, bus, shell.design) != COLONNADE_OK) CHECK(memcmp(&before, device, sizeof before) == 0);
    shell.registers[word] = value;
}

static void call(struct colonnade *device, const struct colonnade_bus *bus, uint8_t **file,
                 struct colonnade_frame *frame) {
    const uint32_t which = take() % 16, enabled = shell.registers[AT(interrupt_enable)];
    pace = take();
    pace = pace < 64 ? 0 : pace < 128 ? 2 : pace;
    switch (which) {
    case 0: load(device); break;
    case 1: open_frame(device, file, frame); break;
    case 2:
    case 3: set_frame(device, frame); break;
    case 4:
    case 5: start(device); break;
    case 6: set_photo(device); break;
    case 7: colonnade_wait(device, take(), take() % 16); break;
    case 8: colonnade_result(device); break;
    case 9: colonnade_acknowledge(device, take32()); break;
    case 10: colonnade_enable_interrupts(device, take32()); break;
    case 11: colonnade_reset(device, take() % 16); break;
    case 12:
        colonnade_counter(device, take32());
        colonnade_device_errors(device);
        break;
    case 13: colonnade_set_scene(device, take_address()); break;
    case 14: probe(device, bus); break;
    default: colonnade_error_name((enum colonnade_error)take32()); break;
    }
    CHECK(which == 10 || shell.registers[AT(interrupt_enable)] == enabled);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static struct colonnade_design design = {
        .format_hash = {1, 2, 3, 4, 5, 6, 7, 0xFFFFFFFF},
        .device_end = DEVICE_BASE + 4 * END,
        .frame_registers = DEVICE_BASE + 4 * FIRST,
        .errors = DEVICE_BASE + 4 * 3,
        .error_count = 4,
        .counters = DEVICE_BASE + 4 * 8,
        .counter_count = 10,
        .tile_size = 16,
        .posted_writes = 64,
        .map_count = 2,
        .maps = {{1, 4}, {3, 8}},
    };
    open_input(data, size);
    const uint32_t kind = take();
    design.scene_page = (kind & 1) != 0 ? DEVICE_BASE + 4 * (FIRST + 5) : 0;
    design.invalidate = (kind & 1) != 0 ? DEVICE_BASE + 4 : 0;
    shell = shell_of(&design, (kind & 2) == 0 ? 0 : (kind & 16) == 0 ? 2 : 3);
    shell.registers[AT(capabilities)] = (kind & 6) == 6 ? COLONNADE_SHELL__CAPABILITIES__ENVIRONMENT_bm : 0;
    shell.registers[AT(frameSize)] = 64u << 16 | 64u;

    const struct colonnade_bus bus = {bus_read, bus_write, (kind & 8) != 0 ? bus_wait : NULL, &shell};
    struct colonnade device;
    CHECK(colonnade_probe(&device, &bus, &design) == COLONNADE_OK && shell.writes == 0);
    uint8_t *file = NULL;
    struct colonnade_frame frame = {NULL, 0, 16, 16};
    for (int i = 0; i < CALLS && left > 0; ++i) {
        const uint32_t accesses = shell.accesses;
        call(&device, &bus, &file, &frame);
        CHECK(shell.accesses - accesses <= MAX_ACCESSES);
    }
    free(file);
    return 0;
}
