/* Frames of random poses from the view file in view_table.h: prints a hash of all writes. */
#include "bare.h"
#include "colonnade_motion.h"
#include "view_table.h"

static uint32_t state = 0x2545F491u;

static uint32_t next(void) {
    state ^= state << 13;
    state ^= state >> 17;
    state ^= state << 5;
    return state;
}

static uint64_t root(uint64_t value) {
    uint64_t result = 0;
    for (uint64_t bit = (uint64_t)1 << 31; bit != 0; bit >>= 1)
        if ((result | bit) * (result | bit) <= value) result |= bit;
    return result;
}

/* A position up to 2^bits / 2^32 metres from the origin on each axis, and any rotation. */
static struct colonnade_pose make_pose(int bits) {
    struct colonnade_pose pose;
    for (int axis = 0; axis < 3; ++axis) pose.position[axis] = (int64_t)(next() % 2048) * ((int64_t)1 << (bits - 10));
    for (int axis = 0; axis < 3; ++axis) pose.position[axis] += (int64_t)next() % 4096 - ((int64_t)1 << bits);
    int32_t quaternion[4];
    int64_t parts[4], square = 0;
    for (int i = 0; i < 4; ++i) parts[i] = (int64_t)(next() % 65535) - 32767, square += parts[i] * parts[i];
    const int64_t length = (int64_t)root((uint64_t)square << 28);
    for (int i = 0; i < 4; ++i) {
        const int64_t part = length == 0 ? 0 : parts[i] * ((int64_t)1 << 44) / length;
        quaternion[i] = (int32_t)part;
    }
    add((uint32_t)colonnade_rotation(pose.rotation, quaternion));
    return pose;
}

static void check(enum colonnade_error error) { add((uint32_t)error); }

/* An object anywhere, moved anyhow. */
static void move(const struct colonnade_view *view) {
    const struct colonnade_pose pose = make_pose(34), pivot = make_pose(34);
    struct colonnade_transform transform = {{{0}}, -(int32_t)(next() % 64), {0}};
    for (int i = 0; i < 9; ++i) transform.linear[i / 3][i % 3] = (int32_t)next();
    for (int axis = 0; axis < 3; ++axis) {
        transform.position[axis] = (int64_t)next() << 18;
        if (next() % 2 != 0) transform.position[axis] *= -1;
    }
    check(colonnade_motion_move(view, &pose, pivot.position, &transform));
    for (int i = 0; i < 9; ++i) add((uint32_t)transform.linear[i / 3][i % 3]);
    for (int axis = 0; axis < 3; ++axis)
        add((uint32_t)transform.position[axis]), add((uint32_t)(transform.position[axis] >> 32));
    add((uint32_t)transform.exponent);
}

static uint8_t writes[8 * 4096];

static void run(struct colonnade_view *view) {
    struct colonnade_frame frame;
    for (int i = 0; i < FRAMES; ++i) {
        const struct colonnade_pose object = make_pose(31);
        struct colonnade_camera camera = {make_pose(36), 0, 0, 0, 0, 640, 480};
        camera.fx = (int64_t)(next() % 4000 + 20) << 32 | next();
        camera.fy = (int64_t)(next() % 4000 + 20) << 32 | next();
        camera.cx = (int64_t)(next() % 640) << 32 | next();
        camera.cy = (int64_t)(next() % 480) << 32 | next();
        check(colonnade_view_set_object(view, &object));
        check(colonnade_view_set_camera(view, &camera));
        if (i % 16 == 15) check(colonnade_view_set_sample(view, next() % 16, 16));
        if (i % 16 == 15) move(view);
        for (uint32_t light = 0; light < view->scene.lights; ++light) {
            struct colonnade_light value = {{0}, {next() >> 14, next() >> 14, next() >> 14}, next()};
            const struct colonnade_pose place = make_pose(34);
            for (int axis = 0; axis < 3; ++axis) value.position[axis] = place.position[axis];
            check(colonnade_view_set_light(view, light, &value));
        }
        const enum colonnade_error error = colonnade_view_frame(view, writes, sizeof writes / 8, &frame);
        check(error);
        if (error != COLONNADE_OK) continue;
        for (size_t byte = 0; byte < 8 * (size_t)frame.count; ++byte) hash = (hash ^ writes[byte]) * 16777619u;
        colonnade_view_accept(view);
    }
}

static struct colonnade_design make_design(void) {
    struct colonnade_design design = {.frame_registers = FRAME_REGISTERS, .device_end = DEVICE_END};
    for (size_t i = 0; i < 32; ++i) design.format_hash[i / 4] |= (uint32_t)view_table[16 + i] << (8 * (i % 4));
    return design;
}

static uint32_t result(void) {
    const struct colonnade_design design = make_design();
    struct colonnade_view view;
    check(colonnade_view_open(&view, &design, view_table, sizeof view_table));
    run(&view);
    return hash;
}
