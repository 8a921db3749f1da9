/* libFuzzer on registers from poses (tools/driver-fuzz): an input changes words of a right view file, its length, and the
 * poses of the frames after it. The file ends where its memory ends. What a refused call would fill stays as it was, and
 * a frame writes frame registers of the design alone, each at most once. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "colonnade_view.h"

enum { LIGHTS = 2, COLUMNS = 4, ROWS = 3, CONSTANTS = 2, FIRST = 40, END = 600, MOST_WORDS = 400, CALLS = 12 };

#define REQUIRE(condition) \
    do { \
        if (!(condition)) { \
            fprintf(stderr, "fuzz_view.c:%d: broken: %s\n", __LINE__, #condition); \
            abort(); \
        } \
    } while (0)

static const struct colonnade_design design = {
    .format_hash = {1, 2, 3, 4, 5, 6, 7, 0xFFFFFFFF},
    .device_end = 0x8000 + 4 * END,
    .frame_registers = 0x8000 + 4 * FIRST,
};

static const uint8_t *input;
static size_t left;

static uint32_t take(void) {
    if (left == 0) return 0;
    --left;
    return *input++;
}

static uint32_t take32(void) {
    uint32_t value = take() << 24;
    value |= take() << 16;
    value |= take() << 8;
    return value | take();
}

/* A number near a power of two, or any. */
static uint64_t take_number(void) {
    const uint32_t kind = take(), bits = kind % 64;
    if (kind >= 192) return (uint64_t)take32() << 32 | take32();
    const uint64_t size = ((uint64_t)1 << bits) + (kind & 64 ? take() - 128 : 0);
    return kind & 128 ? 0 - size : size;
}

/* A right file, with a room or without one. */
struct file {
    uint32_t words[MOST_WORDS];
    size_t count;
};

static void add(struct file *file, uint32_t word) { file->words[file->count++] = word; }

static void add_wide(struct file *file, uint64_t value) {
    add(file, (uint32_t)value);
    add(file, (uint32_t)(value >> 32));
}

static void add_all(struct file *file, const uint32_t *words, size_t count) {
    for (size_t i = 0; i < count; ++i) add(file, words[i]);
}

static void add_pose(struct file *file, int64_t x, int64_t y, int64_t z) {
    add_wide(file, (uint64_t)x);
    add_wide(file, (uint64_t)y);
    add_wide(file, (uint64_t)z);
    for (int i = 0; i < 9; ++i) add(file, i % 4 == 0 ? 1u << 30 : 0);
}

static void add_factor(struct file *file, int32_t exponent) {
    add_wide(file, (uint64_t)1 << 63);
    add(file, (uint32_t)exponent);
}

static void make_file(struct file *file, bool has_room, bool gathers) {
    static const int64_t one = (int64_t)1 << 32;
    const uint32_t head[] = {0x444E4C43, 0x57454956, 3, 0, 1, 2, 3, 4, 5, 6, 7, 0xFFFFFFFF};
    const uint32_t numbers[] = {32, 30, 4, 11, 4, 12, 16, 640, 480, 1 << 16};
    const uint32_t addresses[] = {FIRST, 100, 150, has_room ? 200 : 0, has_room ? 250 : 0, gathers ? 300 : 0};
    file->count = 0;
    add_all(file, head, 12);
    add_all(file, numbers, 10);
    add_all(file, addresses, 6);
    add(file, LIGHTS);
    add(file, CONSTANTS);
    add_factor(file, -44); /* 2^19 grid steps in a metre */
    for (int axis = 0; axis < 3; ++axis) add_wide(file, 0);
    for (int axis = 0; axis < 3; ++axis) add(file, 100);
    for (int axis = 0; axis < 3; ++axis) add(file, 60000);
    add_pose(file, 0, 0, 0);
    add_pose(file, one, one, -4 * one);
    for (int i = 0; i < 2; ++i) add_wide(file, 600 * (uint64_t)one);
    add_wide(file, 320 * (uint64_t)one);
    add_wide(file, 240 * (uint64_t)one);
    add(file, 640);
    add(file, 480);
    for (int i = 0; i < LIGHTS; ++i) {
        for (int axis = 0; axis < 3; ++axis) add_wide(file, (uint64_t)(axis + i) * (uint64_t)one);
        for (int channel = 0; channel < 3; ++channel) add(file, 1 << 16);
        add_wide(file, i == 0 ? 0 : (uint64_t)one);
    }
    if (has_room) {
        add(file, 1);
        add_factor(file, -82);
        add_factor(file, -92);
        for (int i = 0; i < 2; ++i) add_wide(file, 600 * (uint64_t)one);
        add_wide(file, 320 * (uint64_t)one);
        add_wide(file, 240 * (uint64_t)one);
        add_pose(file, one, one, -4 * one);
        for (int axis = 0; axis < 3; ++axis) add_wide(file, (uint64_t)(-5 * one));
        for (int axis = 0; axis < 3; ++axis) add_wide(file, 5 * (uint64_t)one);
        const uint32_t room[] = {1, 1, 1 << 19, 0xFFFF, 16, COLUMNS, ROWS};
        add_all(file, room, 7);
        for (int i = 0; i < COLUMNS * ROWS; ++i) {
            add(file, 3000u | 6000u << 16);
            add(file, 1000);
        }
    }
    for (uint32_t i = 0; i < CONSTANTS; ++i) {
        add(file, END - 1 - i);
        add(file, i);
    }
    file->words[3] = (uint32_t)(4 * file->count);
}

static void take_pose(struct colonnade_pose *pose) {
    for (int axis = 0; axis < 3; ++axis) pose->position[axis] = (int64_t)take_number();
    int32_t quaternion[4] = {0};
    quaternion[take() % 4] = 1 << 30;
    if (take() < 128)
        for (int i = 0; i < 4; ++i) quaternion[i] = (int32_t)take32();
    colonnade_rotation(pose->rotation, quaternion);
    if (take() < 32) pose->rotation[take() % 3][take() % 3] = (int32_t)take32();
}

static void check_frame(struct colonnade_view *view) {
    const uint32_t most = colonnade_view_most_writes(view), capacity = take() < 16 ? take() : most;
    if (most > 2 * END) return; /* constants of any number */
    uint8_t *writes = malloc(capacity == 0 ? 1 : 8 * (size_t)capacity);
    REQUIRE(writes != NULL);
    const struct colonnade_frame nothing = {NULL, 0, 0, 0};
    struct colonnade_frame frame = nothing;
    const enum colonnade_error error = colonnade_view_frame(view, writes, capacity, &frame);
    REQUIRE((error == COLONNADE_OK) == (frame.writes == writes));
    if (error != COLONNADE_OK) REQUIRE(memcmp(&frame, &nothing, sizeof frame) == 0);
    REQUIRE(frame.count <= capacity);
    for (size_t i = 0; i < frame.count; ++i) {
        const uint32_t address = writes[8 * i] | (uint32_t)writes[8 * i + 1] << 8 | (uint32_t)writes[8 * i + 2] << 16;
        REQUIRE(writes[8 * i + 3] == 0 && address >= FIRST && address < END);
    }
    if (take() < 192) colonnade_view_accept(view);
    free(writes);
}

static void change(struct colonnade_view *view) {
    switch (take() % 6) {
    case 0: {
        struct colonnade_pose pose = view->object;
        take_pose(&pose);
        colonnade_view_set_object(view, &pose);
        break;
    }
    case 1: {
        struct colonnade_camera camera = view->camera;
        take_pose(&camera.pose);
        if (take() < 128) camera.fx = (int64_t)take_number();
        if (take() < 128) camera.fy = (int64_t)take_number();
        if (take() < 128) camera.cx = (int64_t)take_number();
        if (take() < 128) camera.cy = (int64_t)take_number();
        if (take() < 128) camera.width = 1 + take() % 8, camera.height = 1 + take() % 8;
        colonnade_view_set_camera(view, &camera);
        break;
    }
    case 2: {
        struct colonnade_light light = {{0}, {take32(), take32(), take32()}, take_number()};
        for (int axis = 0; axis < 3; ++axis) light.position[axis] = (int64_t)take_number();
        colonnade_view_set_light(view, take() % 4, &light);
        break;
    }
    case 3: colonnade_view_set_sample(view, take() % 20, take() % 20); break;
    case 4: colonnade_view_forget(view); break;
    default: break;
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static struct file file;
    input = data;
    left = size;
    const uint32_t kind = take();
    make_file(&file, (kind & 1) != 0, (kind & 2) != 0);
    for (uint32_t changes = take() % 6; changes > 0; --changes) {
        const size_t at = (take() << 8 | take()) % file.count;
        const uint32_t how = take();
        file.words[at] = how < 64 ? file.words[at] ^ 1u << how % 32 : how < 128 ? take() : (uint32_t)(take_number() >> how % 33);
    }
    const size_t bytes = (kind & 0xF0) != 0 ? 4 * file.count : take32() % (4 * file.count + 1);
    uint8_t *exact = malloc(bytes == 0 ? 1 : bytes);
    REQUIRE(exact != NULL);
    for (size_t i = 0; i < bytes; ++i) exact[i] = (uint8_t)(file.words[i / 4] >> (8 * (i % 4)));
    struct colonnade_view view, before;
    memset(&view, 0x5A, sizeof view);
    memcpy(&before, &view, sizeof view);
    if (colonnade_view_open(&view, &design, exact, bytes) == COLONNADE_OK) {
        REQUIRE(bytes == 4 * file.count);
        for (int i = 0; i < CALLS; ++i) {
            check_frame(&view);
            change(&view);
        }
    } else {
        REQUIRE(memcmp(&view, &before, sizeof view) == 0);
    }
    free(exact);
    return 0;
}
