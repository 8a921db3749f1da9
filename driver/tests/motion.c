/* Frames of the motion in motion_table.h, with a mesh that bends in two copies: prints a hash of all records, roots and
 * writes of registers; 0 if a call has another result than it should. */
#include "colonnade_motion.h"
#include "bare.h"
#include "colonnade_shell.h"
#include "motion_table.h"

enum { RUNNING = COLONNADE_SHELL__STATUS__ISRUNNING_bm, QUEUED = COLONNADE_SHELL__STATUS__ISQUEUED_bm };

static struct colonnade_motion motion;
static struct colonnade_vertex vertices[VERTICES];
static struct colonnade_mesh_node path[DEPTH];
static int32_t pose[POSE_WORDS];
static uint32_t status;

static uint32_t read_status(void *context, uint32_t address) {
    (void)context;
    add(address);
    return status;
}

static bool is_wrong;

static void expect(enum colonnade_error error, enum colonnade_error expected) { is_wrong |= error != expected; }

/* Bends the meshes of a frame, also while frames are queued; then has a program of the unit's ask for the roots. */
static void bend(const struct colonnade *device, uint32_t time, const struct colonnade_instance *last,
                 struct colonnade_instance *now) {
    const struct colonnade_motion_memory memory = {scene, vertices, path, pose};
    uint32_t roots[COLONNADE_INSTANCES] = {0};
    struct colonnade_instance again[COLONNADE_INSTANCES];
    for (uint32_t i = 0; i < motion.objects; ++i) again[i] = now[i];
    status = RUNNING | QUEUED;
    expect(colonnade_motion_bend(&motion, device, &memory, time, last, now), COLONNADE_BUSY);
    expect(colonnade_motion_swap(&motion, device, last, again, roots), COLONNADE_BUSY);
    status = last == NULL ? 0 : RUNNING;
    expect(colonnade_motion_bend(&motion, device, &memory, time, last, now), COLONNADE_OK);
    expect(colonnade_motion_swap(&motion, device, last, again, roots), COLONNADE_OK);
    for (uint32_t i = 0; i < motion.clips; ++i) add(roots[i]);
    for (uint32_t i = 0; i < motion.objects; ++i)
        for (uint32_t word = 0; word < motion.instance_words; ++word) add(again[i].words[word] ^ now[i].words[word]);
}

static uint32_t result(void) {
    static struct colonnade_instance instances[2][COLONNADE_INSTANCES];
    static uint8_t writes[8 * COLONNADE_MOTION_WRITES];
    const struct colonnade_bus bus = {.read = read_status};
    const struct colonnade device = {.bus = &bus};
    const struct colonnade_motion_memory memory = {scene, vertices, path, pose};
    struct colonnade_design design = {.frame_registers = FRAME_REGISTERS,
                                      .device_end = DEVICE_END,
                                      .invalidate = INVALIDATE,
                                      .scene = SCENE_REGISTERS};
    for (size_t i = 0; i < 32; ++i) design.format_hash[i / 4] |= (uint32_t)clip_table[16 + i] << (8 * (i % 4));
    expect(colonnade_motion_open(&motion, &design, clip_table, sizeof clip_table), COLONNADE_OK);
    expect(colonnade_motion_copy(&motion, &memory, SCENE_BYTES), COLONNADE_OK);
    for (uint32_t frame = 0; frame < FRAMES; ++frame) {
        const uint32_t time = (uint32_t)((uint64_t)motion.duration * frame / 7); /* also behind the end */
        struct colonnade_instance *now = instances[frame % 2], *last = frame == 0 ? NULL : instances[1 - frame % 2];
        struct colonnade_transform transforms[COLONNADE_INSTANCES];
        colonnade_motion_transforms(&motion, time, transforms);
        expect(colonnade_motion_find(&motion, transforms, now), COLONNADE_OK);
        bend(&device, time, last, now);
        const uint32_t count = colonnade_motion_writes(&motion, now, last, writes);
        add(count);
        for (uint32_t i = 0; i < 8 * count; i += 4)
            add((uint32_t)writes[i] | (uint32_t)writes[i + 1] << 8 | (uint32_t)writes[i + 2] << 16 |
                (uint32_t)writes[i + 3] << 24);
        for (size_t i = 0; i < sizeof scene / sizeof *scene; ++i) add(scene[i]);
    }
    return is_wrong ? 0 : hash;
}
