/* Meshes of a motion that bend, against a device that reads records through a cache and keeps them until it is
 * invalidated. Prints nothing and returns 0, or the line that failed. Run it under the address sanitizer.
 *
 * usage: bend CLIP SCENE INSTANCES INVALIDATE COUNT    files of `colonnade pack`, word addresses of the first
 *                                                      instance's registers, control.invalidate and scene.recordCount
 */
#include "check.h"
#include "colonnade_motion.h"
#include "colonnade_shell.h"

enum {
    DEVICE_BASE = 0x8000,
    FRAMES = 9,
    RECORD_WORDS = 8,
    OBJECT_WORDS = 11,
    REGISTERS = 1 << 10,
    RUNNING = 1,
    QUEUED = 2,
    MOST = 1 << 20
};

/* The device: its registers, and the records that its cache holds. */
static struct {
    uint32_t registers[REGISTERS], status;
    uint32_t *scene, *cached;
    uint8_t *is_cached;
    uint32_t records;
} device;

static struct colonnade_motion motion;
static struct colonnade_motion_memory memory;
static uint32_t *rest, *expected[2]; /* the mesh's records in the scene; by copy: in the pose of a frame */
static uint32_t instances, invalidate, record_count;

static void *allocate(size_t count, size_t size) {
    void *found = calloc(count, size);
    CHECK(found != NULL);
    return found;
}

static uint8_t *read_file(const char *name, size_t *bytes) {
    FILE *file = fopen(name, "rb");
    CHECK(file != NULL);
    uint8_t *data = allocate(MOST, 1);
    *bytes = fread(data, 1, MOST, file);
    fclose(file);
    uint8_t *exact = allocate(*bytes, 1);
    memcpy(exact, data, *bytes);
    free(data);
    return exact;
}

static uint32_t read_register(void *context, uint32_t address) {
    (void)context;
    CHECK(address == offsetof(colonnade_shell_t, status));
    return device.status;
}

/* A frame reads records of the mesh, from `first` up to `end`: they are its pose's. */
static void read_records(uint32_t root, uint32_t first, uint32_t end) {
    const uint32_t *wanted = expected[root != motion.roots[0][0]];
    CHECK(root + end <= device.registers[record_count]);
    for (uint32_t i = first; i < end; ++i) {
        uint32_t *cached = device.cached + (size_t)RECORD_WORDS * (root + i);
        const size_t bytes = 4 * (size_t)RECORD_WORDS;
        if (!device.is_cached[root + i]) memcpy(cached, device.scene + (size_t)RECORD_WORDS * (root + i), bytes);
        device.is_cached[root + i] = 1;
        CHECK(memcmp(cached, wanted + (size_t)RECORD_WORDS * i, bytes) == 0);
    }
}

/* The records of a pose, at both roots. */
static void expect_pose(uint32_t time) {
    const struct colonnade_mesh *mesh = &motion.meshes[0];
    struct colonnade_refit result;
    colonnade_mesh_pose(mesh, time < mesh->duration ? time : mesh->duration, memory.pose);
    CHECK(colonnade_mesh_skin(mesh, memory.pose, memory.vertices) == COLONNADE_OK);
    for (int copy = 0; copy < 2; ++copy) {
        const uint32_t root = motion.roots[0][copy];
        CHECK(colonnade_mesh_copy(mesh, rest, motion.roots[0][0], expected[copy], root, memory.path) == COLONNADE_OK);
        CHECK(colonnade_mesh_refit(mesh, memory.vertices, expected[copy], root, memory.path, &result) == COLONNADE_OK);
    }
}

static void play(uint32_t object) {
    static struct colonnade_instance found[2][COLONNADE_INSTANCES];
    static uint8_t writes[8 * COLONNADE_MOTION_WRITES];
    const struct colonnade_bus bus = {.read = read_register};
    const struct colonnade shell = {.bus = &bus};
    const uint32_t records = motion.meshes[0].records, word = colonnade_instance_root(&motion.world);
    uint32_t root = 0;
    for (uint32_t frame = 0; frame < FRAMES; ++frame) {
        const uint32_t time = (uint32_t)((uint64_t)motion.duration * frame / (FRAMES - 2)); /* also behind the end */
        struct colonnade_transform transforms[COLONNADE_INSTANCES];
        struct colonnade_instance *now = found[frame % 2], *last = frame == 0 ? NULL : found[1 - frame % 2];
        colonnade_motion_transforms(&motion, time, transforms);
        CHECK(colonnade_motion_find(&motion, transforms, now) == COLONNADE_OK);
        device.status = RUNNING | QUEUED;
        CHECK(colonnade_motion_bend(&motion, &shell, &memory, time, last, now) == COLONNADE_BUSY);
        device.status = RUNNING;
        CHECK(colonnade_motion_bend(&motion, &shell, &memory, time, last, now) == COLONNADE_OK);
        if (frame > 0) read_records(root, records / 2, records); /* the frame before ends */
        device.registers[invalidate] = 0;
        const uint32_t count = colonnade_motion_writes(&motion, now, last, writes);
        for (uint32_t i = 0; i < count; ++i) {
            uint32_t pair[2];
            memcpy(pair, writes + 8 * i, 8);
            CHECK(pair[0] < REGISTERS);
            device.registers[pair[0]] = pair[1];
        }
        if (device.registers[invalidate] != 0) memset(device.is_cached, 0, device.records);
        root = device.registers[instances + motion.instance_words * object + word];
        expect_pose(time > motion.duration ? time - motion.duration : time);
        read_records(root, 0, records / 2);
    }
}

/* Clips that are not the scene's are refused, and nothing bends. */
static void refuse(uint32_t bytes) {
    static const uint32_t roots[] = {1, 0x7FFFFFFF, 0xFFFFFFFF};
    const struct colonnade_motion right = motion;
    const uint32_t end = right.roots[0][0] + right.meshes[0].records;
    struct colonnade_instance none[COLONNADE_INSTANCES];
    CHECK(colonnade_motion_bend(&motion, NULL, &memory, 0, NULL, none) == COLONNADE_NO_SCENE);
    for (size_t i = 0; i < sizeof roots / sizeof *roots; ++i) {
        motion.roots[0][0] = right.roots[0][0] + roots[i];
        CHECK(colonnade_motion_copy(&motion, &memory, bytes) == COLONNADE_OTHER_RECORDS && motion.records == 0);
    }
    motion = right;
    CHECK(colonnade_motion_copy(&motion, &memory, 32 * (end - 1)) == COLONNADE_OTHER_RECORDS);
    ++motion.meshes[0].leaves;
    CHECK(colonnade_motion_copy(&motion, &memory, bytes) == COLONNADE_OTHER_RECORDS && motion.records == 0);
    motion = right;
    motion.meshes[0].address_bits = 4;
    CHECK(colonnade_motion_copy(&motion, &memory, bytes) == COLONNADE_TOO_LARGE && motion.records == 0);
    motion = right;
    motion.invalidate_address = 0;
    CHECK(colonnade_motion_copy(&motion, &memory, bytes) == COLONNADE_NO_SCENE);
    motion = right;
}

int main(int argc, char **argv) {
    CHECK(argc == 6);
    size_t clip_bytes, scene_bytes;
    uint8_t *clip = read_file(argv[1], &clip_bytes), *scene = read_file(argv[2], &scene_bytes);
    instances = (uint32_t)atoi(argv[3]), invalidate = (uint32_t)atoi(argv[4]), record_count = (uint32_t)atoi(argv[5]);
    struct colonnade_design design = {.frame_registers = DEVICE_BASE,
                                      .device_end = DEVICE_BASE + 4 * REGISTERS,
                                      .invalidate = DEVICE_BASE + 4 * invalidate,
                                      .scene = DEVICE_BASE + 4 * record_count};
    memcpy(design.format_hash, clip + 16, sizeof design.format_hash);
    CHECK(colonnade_motion_open(&motion, &design, clip, clip_bytes) == COLONNADE_OK && motion.clips == 1);
    const size_t bytes = scene_bytes + motion.copy_bytes;
    device.records = (uint32_t)(bytes / 32);
    device.scene = allocate(bytes, 1);
    device.cached = allocate(bytes, 1);
    device.is_cached = allocate(device.records, 1);
    memcpy(device.scene, scene, scene_bytes);
    memory = (struct colonnade_motion_memory){device.scene, allocate(motion.vertices, sizeof(struct colonnade_vertex)),
                                              allocate(motion.depth, sizeof(struct colonnade_mesh_node)),
                                              allocate(motion.pose_words, 4)};
    refuse((uint32_t)scene_bytes);
    CHECK(colonnade_motion_copy(&motion, &memory, (uint32_t)scene_bytes) == COLONNADE_OK);
    const size_t mesh_bytes = 32 * (size_t)motion.meshes[0].records;
    const uint32_t root = motion.roots[0][0];
    rest = allocate(mesh_bytes, 1);
    memcpy(rest, device.scene + (size_t)RECORD_WORDS * root, mesh_bytes);
    for (int copy = 0; copy < 2; ++copy) expected[copy] = allocate(mesh_bytes, 1);
    uint32_t object = 0, of_object;
    for (uint32_t i = 0; i < motion.objects; ++i) {
        memcpy(&of_object, motion.object_words + 4 * (size_t)(OBJECT_WORDS * i + 8), 4);
        if (of_object == root) object = i;
    }
    play(object);
    free(scene);
    return 0;
}
