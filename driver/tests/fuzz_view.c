/* Fuzzer of registers from poses (tools/driver-fuzz): an input chooses the numbers of a view file, each legal, from
 * usual ones to all of them extreme at once; in some files it then changes words or the length. The file ends where its
 * memory ends. A legal file opens; what a refused call would fill stays as it was; a frame writes frame registers of
 * the design alone, each at most once; and the device has all registers of the frame, though only words that differ are
 * written. */
#include <math.h>

#include "colonnade_view.h"
#include "fuzz.h"

enum {
    FRAME = 40,
    CAMERA = 80,
    LIGHTS = 120,
    ENVIRONMENT = 220,
    WINDOW = 260,
    GATHER = 270,
    CONSTANTS = 280,
    END = 284
};
enum { MOST_WORDS = 400, CALLS = 10 };

static const int64_t one = (int64_t)1 << 32, most_place = ((int64_t)1 << 60) - 1;

static const struct colonnade_design design = {
    .format_hash = {1, 2, 3, 4, 5, 6, 7, 0xFFFFFFFF},
    .device_end = 0x8000 + 4 * END,
    .frame_registers = 0x8000 + 4 * FRAME,
};

static uint32_t extremes; /* of 256 numbers */

/* From `low` to `high`: any, an end, or a power of two from an end. */
static int64_t pick(int64_t low, int64_t high) {
    const uint64_t span = (uint64_t)high - (uint64_t)low;
    const uint32_t kind = take();
    uint64_t distance = kind < 64 ? 0 : kind < 128 ? (uint64_t)1 << take() % 64 : take64();
    if (distance > span) distance %= span + 1;
    return (int64_t)((kind & 1) != 0 ? (uint64_t)low + distance : (uint64_t)high - distance);
}

static int64_t number(int64_t usual, int64_t low, int64_t high) { return take() < extremes ? pick(low, high) : usual; }

static int64_t coordinate(int64_t metres) { return number(pick(-metres * one, metres * one), -most_place, most_place); }

static struct file {
    uint32_t words[MOST_WORDS];
    size_t count;
} file;

static void add(int64_t word) { file.words[file.count++] = (uint32_t)word; }

static void add_wide(int64_t value) {
    add(value);
    add(value >> 32);
}

static void add_all(const uint32_t *words, size_t count) {
    for (size_t i = 0; i < count; ++i) add(words[i]);
}

static void add_factor(int64_t exponent) {
    add_wide((int64_t)(take64() | (uint64_t)1 << 63));
    add(number(exponent + take() % 8 - 4, -255, 255));
}

/* Any rotation, or one around an axis; one that is off by less than what is refused. */
static struct colonnade_pose take_pose(void) {
    struct colonnade_pose pose;
    double parts[4], square = 0;
    int32_t quaternion[4];
    for (int i = 0; i < 4; ++i) {
        parts[i] = take() < 64 ? 0 : (int)take() - 128;
        square += parts[i] * parts[i];
    }
    for (int i = 0; i < 4; ++i)
        quaternion[i] = (int32_t)((square > 0 ? parts[i] / sqrt(square) : i == 3) * (double)(1 << 30));
    CHECK(colonnade_rotation(pose.rotation, quaternion) == COLONNADE_OK);
    if (take() < extremes) pose.rotation[take() % 3][take() % 3] += (int32_t)pick(-200, 200);
    for (int axis = 0; axis < 3; ++axis) pose.position[axis] = coordinate(8);
    return pose;
}

static void add_pose(void) {
    const struct colonnade_pose pose = take_pose();
    for (int axis = 0; axis < 3; ++axis) add_wide(pose.position[axis]);
    for (int i = 0; i < 9; ++i) add(pose.rotation[i / 3][i % 3]);
}

/* fx, fy, cx, cy. */
static int64_t lens_number(int i) {
    if (i < 2) return number(pick(100, 1000) * one, one / 16, one << 24);
    return number(pick(0, 640) * one, -(one << 24), one << 24);
}

static void add_scene(bool has_room, bool gathers) {
    const uint32_t head[] = {0x444E4C43, 0x57454956, 3, 0, 1, 2, 3, 4, 5, 6, 7, 0xFFFFFFFF};
    const uint32_t environment = has_room ? ENVIRONMENT : 0, window = has_room ? WINDOW : 0,
                   gather = gathers ? GATHER : 0;
    const uint32_t addresses[] = {FRAME, CAMERA, LIGHTS, environment, window, gather};
    const int64_t scene_bits = number(take() % 2 != 0 ? 30 : 43, 16, 72), vertex_bits = number(16, 8, 24);
    const int64_t width = number(640, 1, 4096), height = number(480, 1, 4096);
    file.count = 0;
    add_all(head, 12);
    add(number(take() % 2 != 0 ? 25 : 32, 16, 64));
    add(scene_bits);
    add(number(4, -12, 19) + (scene_bits > 40 ? scene_bits - 40 : 0));
    add(number(11, 4, 13));
    add(number(4, 0, 24));
    add(number(12, 8, 32));
    add(vertex_bits);
    add(width);
    add(height);
    add(number(1 << 16, 0, UINT32_MAX));
    add_all(addresses, 6);
    const uint32_t lights = take() % (COLONNADE_VIEW_LIGHTS + 1), constants = take() % (END - CONSTANTS + 1);
    add(lights);
    add(constants);
    add_factor(-44); /* 2^19 grid steps in a metre */
    for (int axis = 0; axis < 3; ++axis) add_wide(number(0, -most_place, most_place));
    int64_t low[3];
    for (int axis = 0; axis < 3; ++axis) add(low[axis] = pick(0, ((int64_t)1 << vertex_bits) - 1));
    for (int axis = 0; axis < 3; ++axis) add(pick(low[axis], ((int64_t)1 << vertex_bits) - 1));
    add_pose();
    add_pose();
    for (int i = 0; i < 4; ++i) add_wide(lens_number(i));
    add(number(width, 1, width));
    add(number(height, 1, height));
    for (uint32_t i = 0; i < lights; ++i) {
        for (int axis = 0; axis < 3; ++axis) add_wide(coordinate(16));
        for (int channel = 0; channel < 3; ++channel) add(take32());
        add_wide(number(i % 2 != 0 ? one : 0, INT64_MIN, INT64_MAX));
    }
    if (has_room) {
        add(take() % 2);
        add_factor(-82);
        add_factor(-92);
        for (int i = 0; i < 4; ++i) add_wide(lens_number(i));
        add_pose();
        for (int side = 0; side < 6; ++side) add_wide(number((side < 3 ? -5 : 5) * one, -most_place, most_place));
        add(number(take() % 6, 0, UINT32_MAX));
        add(take() % 4);
        add(number(1 << 19, 0, UINT32_MAX));
        add(number(0xFFFF, 0, UINT32_MAX));
        add(pick(1, 4096));
        const uint32_t columns = take() % 6, rows = take() % 6;
        add(columns);
        add(rows);
        for (uint32_t i = 0; i < 2 * columns * rows; ++i) add(take32());
    }
    for (uint32_t i = 0; i < constants; ++i) {
        add(CONSTANTS + i);
        add(take32());
    }
    file.words[3] = (uint32_t)(4 * file.count);
}

/* Whether words differ from a right file's. */
static bool damage(void) {
    const uint32_t changes = take();
    if (changes < 192) return false;
    for (uint32_t i = 0; i < changes % 6; ++i) {
        const uint32_t how = take();
        uint32_t *word = &file.words[(take() << 8 | take()) % file.count];
        *word = how < 64 ? *word ^ 1u << how % 32 : how < 128 ? take() : (uint32_t)pick(INT64_MIN, INT64_MAX);
    }
    return true;
}

/* What the device has. */
static struct registers {
    uint32_t values[END];
    bool known[END];
} device;

static uint32_t word_at(const uint8_t *bytes) {
    return bytes[0] | (uint32_t)bytes[1] << 8 | (uint32_t)bytes[2] << 16 | (uint32_t)bytes[3] << 24;
}

static void write_all(struct registers *to, const struct colonnade_frame *frame, bool is_damaged) {
    bool seen[END] = {false};
    for (size_t i = 0; i < frame->count; ++i) {
        const uint32_t address = word_at(frame->writes + 8 * i);
        CHECK(address >= FRAME && address < END);
        CHECK(is_damaged || !seen[address]);
        seen[address] = to->known[address] = true;
        to->values[address] = word_at(frame->writes + 8 * i + 4);
    }
}

static void check_frame(struct colonnade_view *view, bool is_damaged) {
    const uint32_t most = colonnade_view_most_writes(view), capacity = take() < 16 ? take() : most;
    if (most > 2 * END) return; /* constants of any number */
    uint8_t *writes = malloc(capacity == 0 ? 1 : 8 * (size_t)capacity);
    CHECK(writes != NULL);
    const struct colonnade_frame nothing = {NULL, 0, 0, 0};
    struct colonnade_frame frame = nothing;
    const enum colonnade_error error = colonnade_view_frame(view, writes, capacity, &frame);
    CHECK(frame.count <= capacity);
    if (error != COLONNADE_OK) CHECK(memcmp(&frame, &nothing, sizeof frame) == 0);
    else if (take() < 192) {
        CHECK(frame.writes == writes);
        write_all(&device, &frame, is_damaged);
        colonnade_view_accept(view);
        if (!is_damaged && capacity == most && take() < 128) {
            CHECK(colonnade_view_frame(view, writes, capacity, &frame) == COLONNADE_OK && frame.count == 0);
            struct colonnade_view forgetful = *view;
            struct registers whole = device;
            colonnade_view_forget(&forgetful);
            CHECK(colonnade_view_frame(&forgetful, writes, capacity, &frame) == COLONNADE_OK && frame.count == most);
            write_all(&whole, &frame, false);
            CHECK(memcmp(&whole, &device, sizeof whole) == 0);
        }
    }
    free(writes);
}

static void change(struct colonnade_view *view) {
    struct colonnade_view before;
    memcpy(&before, view, sizeof before);
    enum colonnade_error error = COLONNADE_OK;
    switch (take() % 6) {
    case 0: {
        struct colonnade_pose pose = take_pose();
        if (take() < 16) pose.rotation[take() % 3][take() % 3] = (int32_t)take32();
        error = colonnade_view_set_object(view, &pose);
        break;
    }
    case 1: {
        const bool is_wrong = take() < 16;
        struct colonnade_camera camera = {take_pose(),    lens_number(0),     lens_number(1),     lens_number(2),
                                          lens_number(3), view->camera.width, view->camera.height};
        if (take() < 128) camera.width = (uint32_t)pick(1, view->scene.max_width);
        if (take() < 128) camera.height = (uint32_t)pick(1, view->scene.max_height);
        int64_t *const numbers[] = {&camera.fx, &camera.fy, &camera.cx, &camera.cy, &camera.pose.position[0]};
        if (is_wrong) *numbers[take() % 5] = (int64_t)take64();
        error = colonnade_view_set_camera(view, &camera);
        break;
    }
    case 2: {
        struct colonnade_light light = {{0}, {take32(), take32(), take32()}, take64() >> take() % 64};
        for (int axis = 0; axis < 3; ++axis) light.position[axis] = take() < 8 ? (int64_t)take64() : coordinate(16);
        error = colonnade_view_set_light(view, take() % 9, &light);
        break;
    }
    case 3: {
        const uint32_t count = take() < 16 ? take32() : 1u << take() % 8;
        error = colonnade_view_set_sample(view, count == 0 ? take() : take() % count, count);
        break;
    }
    case 4: colonnade_view_forget(view); break;
    default: break;
    }
    if (error != COLONNADE_OK) CHECK(memcmp(view, &before, sizeof before) == 0);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static const uint32_t shares[] = {0, 2, 16, 256};
    open_input(data, size);
    const uint32_t kind = take();
    extremes = shares[kind >> 2 & 3];
    add_scene((kind & 1) != 0, (kind & 2) != 0);
    const bool is_damaged = damage();
    const size_t bytes = (kind & 0xF0) != 0 ? 4 * file.count : take32() % (4 * file.count + 1);
    uint8_t *exact = malloc(bytes == 0 ? 1 : bytes);
    CHECK(exact != NULL);
    for (size_t i = 0; i < bytes; ++i) exact[i] = (uint8_t)(file.words[i / 4] >> (8 * (i % 4)));
    device = (struct registers){0};
    struct colonnade_view view, before;
    memset(&view, 0x5A, sizeof view);
    memcpy(&before, &view, sizeof view);
    const enum colonnade_error error = colonnade_view_open(&view, &design, exact, bytes);
    CHECK((error == COLONNADE_OK) <= (bytes == 4 * file.count));
    CHECK(error == COLONNADE_OK || is_damaged || bytes != 4 * file.count);
    if (error != COLONNADE_OK) CHECK(memcmp(&view, &before, sizeof view) == 0);
    for (int i = 0; i < CALLS && error == COLONNADE_OK; ++i) {
        check_frame(&view, is_damaged);
        change(&view);
    }
    free(exact);
    return 0;
}
