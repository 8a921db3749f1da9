/* Fuzzer of objects that move (tools/driver-fuzz): an input chooses the numbers of a clip file of instances, each
 * legal, from usual ones to all of them extreme at once; in some files it then changes words or the length. The file
 * ends where its memory ends. A legal file opens; words fit their registers, boxes and bounds are in the cube and in
 * order, changed words with those before are the words of a whole frame. */
#include "colonnade_motion.h"
#include "fuzz.h"

enum { MOST_WORDS = 4000, FIRST = 100, END = 900, BOUNDS = 880, OFFSET = 890 };

static const struct colonnade_design design = {.format_hash = {1, 2, 3, 4, 5, 6, 7, 0xFFFFFFFF},
                                               .frame_registers = 0x8000 + 4 * FIRST,
                                               .device_end = 0x8000 + 4 * END};

static uint32_t extremes; /* of 256 numbers */

static struct file {
    uint32_t words[MOST_WORDS];
    size_t count;
} file;

static void add(int64_t word) { file.words[file.count++] = (uint32_t)word; }

static uint32_t below(uint32_t count) { return take32() % count; }

/* Up to 2^bits in magnitude. */
static int32_t number(int bits) {
    const int32_t value = (int32_t)below((uint32_t)1 << bits);
    return take() % 2 != 0 ? value : -value;
}

static void add_motion(void) {
    static const int32_t worlds[][3] = {{16, 5, 32}, {16, 13, 40}, {16, -3, 24}, {24, 37, 72}, {10, 51, 72}};
    const uint32_t head[] = {0x444E4C43, 0x45564F4D, 1, 0, 1, 2, 3, 4, 5, 6, 7, 0xFFFFFFFF};
    const int32_t *world = worlds[below(5)];
    const struct colonnade_world numbers = {world[0], world[1], world[2]};
    const uint32_t objects = 1 + below(COLONNADE_INSTANCES), keys = 1 + below(4), most = ((uint32_t)1 << world[0]) - 1;
    const int32_t shift = (int32_t)below(take() < extremes ? 21 : 8);
    uint32_t time = 0;
    file.count = 0;
    for (int i = 0; i < 12; ++i) add(head[i]);
    for (int i = 0; i < 3; ++i) add(world[i]);
    add(FIRST), add(BOUNDS), add(OFFSET), add(colonnade_instance_words(&numbers)), add(below(3)), add(objects),
        add(keys);
    const size_t duration = file.count;
    add(0), add(shift), add(0);
    for (uint32_t i = 0; i < objects; ++i) {
        const uint32_t half = take() < extremes ? most / 2 : most / 8;
        for (int axis = 0; axis < 3; ++axis) add(most / 2 - below(half + 1));
        for (int axis = 0; axis < 3; ++axis) add(most / 2 + below(half + 1));
        add(take() < extremes ? take32() : below(4096));
        add(take() < extremes ? take32() : 0);
        add(take32()), add(below(256));
        add(take() < extremes ? (int32_t)take32() : -31 - (int32_t)below(4));
    }
    for (uint32_t key = 0; key < keys; ++key) {
        add(time);
        file.words[duration] = time;
        time += take() < 64 ? 0 : take() < extremes ? take32() >> 3 : below(100000);
        for (uint32_t i = 0; i < 12 * objects; ++i)
            add(take() < extremes ? number(30)
                : i % 4 == 3      ? (int64_t)(most / 2) << (world[0] + shift < 29 ? shift : 0)
                                  : number(29));
    }
    file.words[3] = 4 * (uint32_t)file.count;
}

static bool damage(void) {
    if (take() >= 96) return false;
    for (uint32_t i = 1 + take() % 3; i > 0; --i)
        file.words[below((uint32_t)file.count)] = take() < 128 ? take32() : take();
    return true;
}

static uint32_t word_at(const uint8_t *bytes) {
    return bytes[0] | (uint32_t)bytes[1] << 8 | (uint32_t)bytes[2] << 16 | (uint32_t)bytes[3] << 24;
}

static void check_instance(const struct colonnade_world *world, const struct colonnade_instance *one) {
    const uint32_t *box = one->words + colonnade_instance_words(world) - 6;
    for (int i = 0; i < 9; ++i) CHECK(one->words[i] >> 25 == 0);
    CHECK(one->words[9] >= 1 && one->words[9] < 64);
    for (int i = 0; i < 9; ++i) CHECK(box[i - 11] >> 16 == 0);
    for (int axis = 0; axis < 3; ++axis) {
        CHECK(box[axis] <= box[3 + axis] && box[3 + axis] <= 255);
        CHECK(0 <= one->low[axis] && one->low[axis] <= one->high[axis] && one->high[axis] >> world->vertex_bits == 0);
    }
    CHECK(one->offset >= 1 && one->offset <= (uint64_t)1 << (world->vertex_bits + world->grid_fraction - 2));
}

/* What the device has. */
static void write_all(uint32_t *device, const uint8_t *writes, uint32_t count) {
    for (uint32_t i = 0; i < count; ++i) {
        const uint32_t address = word_at(writes + 8 * i);
        CHECK(address >= FIRST && address < END);
        device[address] = word_at(writes + 8 * i + 4);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static const uint32_t shares[] = {0, 2, 16, 256};
    open_input(data, size);
    extremes = shares[take() % 4];
    add_motion();
    const bool is_damaged = damage();
    const size_t bytes = take() < 240 ? 4 * file.count : below(4 * (uint32_t)file.count + 1);
    uint8_t *exact = malloc(bytes == 0 ? 1 : bytes);
    CHECK(exact != NULL);
    for (size_t i = 0; i < bytes; ++i) exact[i] = (uint8_t)(file.words[i / 4] >> (8 * (i % 4)));
    struct colonnade_motion motion, before;
    memset(&motion, 0x5A, sizeof motion);
    memcpy(&before, &motion, sizeof motion);
    const enum colonnade_error opened = colonnade_motion_open(&motion, &design, exact, bytes);
    CHECK(opened == COLONNADE_OK || is_damaged || bytes != 4 * file.count);
    if (opened != COLONNADE_OK) CHECK(memcmp(&motion, &before, sizeof motion) == 0);
    struct colonnade_instance instances[2][COLONNADE_INSTANCES];
    uint32_t device[END], whole[END];
    bool has_frame = false;
    for (int call = 0; call < 6 && opened == COLONNADE_OK; ++call) {
        struct colonnade_transform transforms[COLONNADE_INSTANCES];
        struct colonnade_instance *now = instances[call % 2], *last = instances[1 - call % 2];
        uint8_t *writes = malloc(8 * COLONNADE_MOTION_WRITES);
        CHECK(writes != NULL);
        colonnade_motion_transforms(&motion, take() < 16 ? take32() : below(200000), transforms);
        const enum colonnade_error error = colonnade_motion_find(&motion, transforms, now);
        CHECK(error == COLONNADE_OK || error == COLONNADE_FLAT || error == COLONNADE_TOO_SMALL ||
              error == COLONNADE_OUTSIDE);
        for (uint32_t i = 0; error == COLONNADE_OK && i < motion.objects; ++i) check_instance(&motion.world, &now[i]);
        if (error == COLONNADE_OK) {
            const uint32_t changed = colonnade_motion_writes(&motion, now, has_frame ? last : NULL, writes);
            CHECK(changed <= COLONNADE_MOTION_WRITES);
            write_all(device, writes, changed);
            const uint32_t all = colonnade_motion_writes(&motion, now, NULL, writes);
            CHECK(all == motion.objects * motion.instance_words + 6 + motion.offset_words && changed <= all);
            if (!has_frame) memcpy(whole, device, sizeof whole);
            write_all(whole, writes, all);
            if (!is_damaged) CHECK(memcmp(whole, device, sizeof whole) == 0);
        }
        has_frame = error == COLONNADE_OK;
        free(writes);
    }
    free(exact);
    return 0;
}
