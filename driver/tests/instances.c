/* Objects at random places, some at extreme ones: prints a hash of all words. */
#include "bare.h"
#include "colonnade_instances.h"

static uint32_t state = 0x2545F491u;

static uint32_t next(void) {
    state ^= state << 13;
    state ^= state >> 17;
    state ^= state << 5;
    return state;
}

/* A number below 2^bits in magnitude. */
static int32_t number(int bits) {
    const int32_t value = (int32_t)(next() >> (32 - bits));
    return next() % 2 != 0 ? value : -value;
}

/* About the middle of the world, turned, stretched and mirrored anyhow; or a place of any bits. */
static struct colonnade_transform make_transform(const struct colonnade_world *world, bool is_extreme) {
    struct colonnade_transform transform = {{{0}}, -32 - (int32_t)(next() % 3), {0}};
    for (int i = 0; i < 9; ++i) transform.linear[i / 3][i % 3] = is_extreme ? (int32_t)next() : number(29);
    for (int axis = 0; axis < 3; ++axis)
        transform.position[axis] = ((int64_t)1 << (world->vertex_bits + 19)) + number(30);
    if (!is_extreme) return transform;
    for (int axis = 0; axis < 3; ++axis) {
        const uint64_t high = next(), low = next();
        transform.position[axis] = (int64_t)(high << 32 | low) >> next() % 64;
    }
    transform.exponent = (int32_t)next();
    transform.exponent >>= next() % 32;
    if (next() % 2 != 0) transform.exponent = -40 + (int32_t)(next() % 40);
    return transform;
}

static uint32_t result(void) {
    static const struct colonnade_world worlds[] = {
        {16, 5, 32}, {16, 13, 40}, {16, -3, 24}, {24, 37, 72}, {10, 51, 72}};
    struct colonnade_instance instances[COLONNADE_INSTANCES];
    for (uint32_t frame = 0; frame < FRAMES; ++frame) {
        const struct colonnade_world *world = &worlds[frame % 5];
        const uint32_t most = ((uint32_t)1 << world->vertex_bits) - 1;
        uint32_t count = 0;
        for (uint32_t i = 0; i < COLONNADE_INSTANCES; ++i) {
            const uint32_t offset = next() % 4096, root = next();
            struct colonnade_object object = {{0}, {0}, offset, root, next() % 256};
            const struct colonnade_transform transform = make_transform(world, i % 8 == 7);
            for (int axis = 0; axis < 3; ++axis) {
                object.low[axis] = (int32_t)(most / 2 - next() % (most / 8));
                object.high[axis] = (int32_t)(most / 2 + next() % (most / 8));
            }
            const enum colonnade_error error = colonnade_find_instance(world, &object, &transform, &instances[count]);
            add((uint32_t)error);
            if (error != COLONNADE_OK) continue;
            for (uint32_t word = 0; word < colonnade_instance_words(world); ++word) add(instances[count].words[word]);
            ++count;
        }
        if (count == 0) continue;
        const struct colonnade_shared shared = colonnade_find_shared(instances, count);
        for (int axis = 0; axis < 3; ++axis) add((uint32_t)shared.low[axis]), add((uint32_t)shared.high[axis]);
        add((uint32_t)shared.offset);
    }
    add(state);
    return hash;
}
