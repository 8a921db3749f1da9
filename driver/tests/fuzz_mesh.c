/* Fuzzer of meshes that bend (tools/driver-fuzz): an input chooses the numbers of a clip file, each legal, from usual
 * ones to all of them extreme at once, and a tree over its leaves; in some files it then changes words or the length,
 * and in some trees records. File and records end where their memory ends. A legal file opens; a vertex is on the grid,
 * and the same if the file begins in the middle of a word; a refit of the tree succeeds, twice with the same records,
 * and changes nothing behind them. In a motion, a frame's copy of the mesh stays as it is while the next frame's bends.
 */
#include "colonnade_motion.h"
#include "fuzz.h"

enum { MOST_WORDS = 8000, MOST_VERTICES = 24, MOST_NODES = 40, MOST_RECORDS = 1024, POSE_WORDS = 12 * 4 + 4 };
enum { FIELDS = 85, RECORD_WORDS = 8, ADDRESS_BITS = 22 };

static const struct colonnade_design design = {.format_hash = {1, 2, 3, 4, 5, 6, 7, 0xFFFFFFFF}};

static uint32_t extremes; /* of 256 numbers */

static uint32_t below(uint32_t count) { return take32() % count; }

/* Up to 2^bits in magnitude; an extreme one reaches it. */
static int32_t number(int usual, int most) {
    const bool is_extreme = take() < extremes;
    const int64_t limit = (int64_t)1 << (is_extreme ? most : usual);
    const int64_t value = is_extreme && take() < 128 ? limit - 1 : (int64_t)(take32() % (uint32_t)limit);
    return (int32_t)(take() % 2 != 0 ? value : -value);
}

static struct file {
    uint32_t words[MOST_WORDS];
    size_t count;
} file;

static uint32_t records[MOST_RECORDS][RECORD_WORDS];
static uint32_t record_count, leaf_count, depth, root, step;
static int vertex_bits, delta_bits, box_bits;

static void add(int64_t word) { file.words[file.count++] = (uint32_t)word; }

static void put(uint32_t *record, uint32_t low, uint32_t width, uint32_t value) {
    for (uint32_t i = 0; i < width; ++i) record[(low + i) / 32] |= (value >> i & 1) << ((low + i) % 32);
}

/* A node with one to four children, at random nodes or leaves, and all that are below it. */
static void build(uint32_t address, uint32_t level) {
    const uint32_t count = 1 + below(4), nodes = record_count < MOST_NODES && level < 12 ? below(count + 1) : 0;
    const uint32_t leaves = count - nodes, first = record_count;
    if (level > depth) depth = level;
    const uint32_t head = (uint32_t)(24 * box_bits + 3 * (vertex_bits + 1));
    put(records[address], head, ADDRESS_BITS, root + first);
    put(records[address], head + ADDRESS_BITS, 3, leaves);
    put(records[address], head + ADDRESS_BITS + 3, 3, nodes);
    record_count += nodes + leaves * step;
    leaf_count += leaves;
    for (uint32_t i = 0; i < nodes; ++i) build(first + i, level + 1);
}

static uint8_t *add_vectors(uint8_t *to, int vectors, int size, int width, int low) {
    for (int i = 0; i < vectors; ++i)
        for (int k = size; k-- > 0;) *to++ = (uint8_t)(low + width * (size * i + k));
    return to;
}

static void add_fields(void) {
    const int deltas = 3 * vertex_bits, normals = deltas + 9 * delta_bits, head = 24 * box_bits + 3 * (vertex_bits + 1);
    uint8_t lows[FIELDS + 3] = {0}, *to = add_vectors(lows, 8, 3, box_bits, 0);
    to = add_vectors(to, 1, 3, vertex_bits + 1, 24 * box_bits);
    for (int i = 0; i < 3; ++i) *to++ = (uint8_t)(head + (i == 0 ? 0 : ADDRESS_BITS + 3 * (i - 1)));
    to = add_vectors(to, 4, 3, vertex_bits, 0);
    to = add_vectors(to, 3, 3, delta_bits, deltas);
    to = add_vectors(to, 3, 3, 1, normals + 80);
    to = add_vectors(to, 3, 2, 11, 9 * vertex_bits);
    to = add_vectors(to, 4, 2, 10, normals);
    to = add_vectors(to, 4, 2, 1, normals + 80);
    *to++ = 254, *to++ = 245, *to++ = 253;
    CHECK(to == lows + FIELDS);
    for (size_t i = 0; i < sizeof lows; i += 4)
        add(lows[i] | lows[i + 1] << 8 | lows[i + 2] << 16 | (int64_t)lows[i + 3] << 24);
}

static void add_clip(void) {
    const uint32_t head[] = {0x444E4C43, 0x50494C43, 1, 0, 1, 2, 3, 4, 5, 6, 7, 0xFFFFFFFF};
    const uint32_t vertices = 1 + below(MOST_VERTICES), bones = 1 + below(4), targets = below(5), keys = 1 + below(4);
    const uint32_t changes = targets == 0 ? 0 : below(3 * vertices);
    uint32_t time = 0, last = 0;
    file.count = 0;
    for (int i = 0; i < 12; ++i) add(head[i]);
    const int bits[] = {vertex_bits, delta_bits, box_bits, ADDRESS_BITS};
    for (int i = 0; i < 4; ++i) add(bits[i]);
    const uint32_t numbers[] = {step,    record_count, depth, vertices, leaf_count, bones,
                                targets, changes,      keys,  0,        15,         10};
    for (int i = 0; i < 12; ++i) add(numbers[i]);
    const size_t duration = file.count - 3;
    add_fields();
    for (uint32_t i = 0; i < vertices; ++i) {
        uint32_t weights[3], sum = 0;
        for (int axis = 0; axis < 3; ++axis) add(number(20, 25));
        for (int k = 0; k < 3; ++k) weights[k] = take() < 128 ? 0 : below(0x8001 - sum), sum += weights[k];
        add((number(14, 15) & 0xFFFF) | (int64_t)(number(14, 15) & 0xFFFF) << 16);
        add((number(14, 15) & 0xFFFF) | (int64_t)below(bones) << 16);
        add(below(bones) | (int64_t)below(bones) << 16);
        add(below(bones) | (int64_t)weights[0] << 16);
        add(weights[1] | (int64_t)weights[2] << 16);
    }
    for (uint32_t i = 0; i < leaf_count; ++i) {
        for (int k = 0; k < 3; ++k) add(below(vertices));
        add(take() % 4 == 0 ? 0xFFFFFFFF : below(vertices));
    }
    for (uint32_t i = 0; i < changes; ++i) {
        last += take() < 128 && last + 1 < vertices;
        add(last);
        for (int axis = 0; axis < 3; ++axis) add(number(18, 25));
        add((number(14, 15) & 0xFFFF) | (int64_t)(number(14, 15) & 0xFFFF) << 16);
        add((number(14, 15) & 0xFFFF) | (int64_t)below(targets) << 16);
    }
    for (uint32_t key = 0; key < keys; ++key) {
        add(time);
        file.words[duration] = time;
        time += take() < 64 ? 0 : take() < extremes ? take32() >> 2 : take32() % 100000;
        for (uint32_t i = 0; i < 12 * bones; ++i) { /* translations about the middle of the grid */
            const int64_t middle = ((int64_t)1 << (vertex_bits + 9)) + number(vertex_bits + 2, vertex_bits + 2);
            add(take() < extremes ? number(30, 30) : i % 4 == 3 ? middle : number(vertex_bits + 3, vertex_bits + 3));
        }
        for (uint32_t i = 0; i < targets; ++i) add(number(16, 24));
    }
    file.words[3] = 4 * (uint32_t)file.count;
}

static bool damage(void) {
    if (take() >= 96) return false;
    for (uint32_t i = 1 + take() % 3; i > 0; --i)
        file.words[below((uint32_t)file.count)] = take() < 128 ? take32() : take();
    return true;
}

static void check_refit(const struct colonnade_mesh *mesh, const struct colonnade_vertex *vertices, bool is_legal) {
    const size_t words = (size_t)RECORD_WORDS * record_count;
    uint32_t *copy = malloc(4 * words), *again = malloc(4 * words);
    struct colonnade_mesh_node *path = malloc(sizeof *path * mesh->depth);
    struct colonnade_refit refit, same;
    CHECK(copy != NULL && again != NULL && path != NULL);
    memcpy(copy, records, 4 * words);
    const bool is_changed = take() < 32;
    if (is_changed) copy[below((uint32_t)words)] ^= 1u << take() % 32;
    const enum colonnade_error error = colonnade_mesh_refit(mesh, vertices, copy, root, path, &refit);
    CHECK(error == COLONNADE_OK || (error == COLONNADE_OTHER_RECORDS && (is_changed || !is_legal)));
    memcpy(again, copy, 4 * words);
    if (error == COLONNADE_OK && is_legal) {
        CHECK(colonnade_mesh_refit(mesh, vertices, again, root, path, &same) == COLONNADE_OK);
        CHECK(memcmp(copy, again, 4 * words) == 0 && memcmp(&refit, &same, sizeof refit) == 0);
    }
    free(path);
    free(again);
    free(copy);
}

static uint32_t status;

static uint32_t read_status(void *context, uint32_t address) {
    (void)context;
    (void)address;
    return status;
}

/* The mesh as the only one of a scene, whose root may be a wrong one. */
static void check_motion(const struct colonnade_mesh *mesh, bool is_legal) {
    const struct colonnade_bus bus = {.read = read_status};
    const struct colonnade device = {.bus = &bus};
    const size_t bytes = 4 * (size_t)RECORD_WORDS * record_count;
    const uint32_t from = take() < 16 ? take32() : take() < 16 ? below(record_count) : 0;
    struct colonnade_motion motion = {
        .world = {16, 5, 32}, .invalidate_address = 1, .objects = 1, .clips = 1, .duration = 100000, .meshes = {*mesh}};
    struct colonnade_motion_memory memory = {malloc(2 * bytes), malloc(sizeof *memory.vertices * mesh->vertices),
                                             malloc(sizeof *memory.path * mesh->depth),
                                             malloc(4 * (size_t)colonnade_mesh_pose_words(mesh))};
    uint32_t *before = malloc(2 * bytes);
    CHECK(memory.scene != NULL && memory.vertices != NULL && memory.path != NULL && memory.pose != NULL &&
          before != NULL);
    motion.roots[0][0] = from;
    memcpy(memory.scene, records, bytes);
    enum colonnade_error error = colonnade_motion_copy(&motion, &memory, (uint32_t)bytes);
    CHECK(error == COLONNADE_OK || !is_legal || from != 0);
    CHECK(error != COLONNADE_OK || (motion.records == 2 * record_count && motion.roots[0][1] == record_count));
    const uint32_t word = colonnade_instance_root(&motion.world);
    uint32_t seen = 0;
    for (int call = 0; call < 4 && error == COLONNADE_OK; ++call) {
        struct colonnade_instance now = {.words[0] = 0}, last = now;
        now.words[word] = 0;
        last.words[word] = seen;
        status = take() % 4;
        memcpy(before, memory.scene, 2 * bytes);
        error = colonnade_motion_bend(&motion, &device, &memory, take32(), call == 0 ? NULL : &last, &now);
        CHECK((error == COLONNADE_BUSY) == (status == 3));
        const size_t kept = call == 0 ? 1 : seen != 0; /* the copy that the last frame reads */
        const size_t first = kept * RECORD_WORDS * record_count;
        CHECK(memcmp(memory.scene + first, before + first, bytes) == 0);
        if (error == COLONNADE_BUSY) error = COLONNADE_OK;
        else if (error == COLONNADE_OK) {
            CHECK(call == 0 || now.words[word] != seen);
            seen = now.words[word];
        } else CHECK(error == COLONNADE_OUTSIDE || !is_legal);
    }
    free(before);
    free(memory.pose);
    free(memory.path);
    free(memory.vertices);
    free(memory.scene);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static const uint32_t shares[] = {0, 2, 16, 256};
    open_input(data, size);
    extremes = shares[take() % 4];
    step = 1 + take() % 2;
    root = take() < 128 ? 0 : below(1 << 21);
    vertex_bits = take() < 128 ? 16 : 10 + (int)below(10);
    delta_bits = (157 - 3 * vertex_bits) / 9;
    box_bits = take() < 128 ? 7 : 4 + (int)below(4);
    memset(records, 0, sizeof records);
    record_count = 1, leaf_count = 0, depth = 0;
    build(0, 1);
    add_clip();
    const bool is_damaged = damage();
    const size_t bytes = take() < 240 ? 4 * file.count : below(4 * (uint32_t)file.count + 1);
    uint8_t *exact = malloc(bytes == 0 ? 1 : bytes), *odd = malloc(bytes + 1);
    CHECK(exact != NULL && odd != NULL);
    for (size_t i = 0; i < bytes; ++i) exact[i] = (uint8_t)(file.words[i / 4] >> (8 * (i % 4)));
    memcpy(odd + 1, exact, bytes);
    struct colonnade_mesh mesh, before, same;
    memset(&mesh, 0x5A, sizeof mesh);
    memcpy(&before, &mesh, sizeof mesh);
    const enum colonnade_error opened = colonnade_mesh_open(&mesh, &design, exact, bytes);
    CHECK(opened == COLONNADE_OK || is_damaged || bytes != 4 * file.count);
    if (opened != COLONNADE_OK) CHECK(memcmp(&mesh, &before, sizeof mesh) == 0);
    CHECK(colonnade_mesh_open(&same, &design, odd + 1, bytes) == opened);
    for (int call = 0; call < 4 && opened == COLONNADE_OK; ++call) {
        int32_t *pose = malloc(4 * (size_t)colonnade_mesh_pose_words(&mesh));
        struct colonnade_vertex *vertices = malloc(sizeof *vertices * mesh.vertices);
        struct colonnade_vertex *others = malloc(sizeof *others * mesh.vertices);
        CHECK(pose != NULL && vertices != NULL && others != NULL);
        colonnade_mesh_pose(&mesh, take() < 16 ? take32() : below(200000), pose);
        const enum colonnade_error error = colonnade_mesh_skin(&mesh, pose, vertices);
        CHECK(error == COLONNADE_OK || error == COLONNADE_OUTSIDE);
        CHECK(colonnade_mesh_skin(&same, pose, others) == error);
        CHECK(error != COLONNADE_OK || memcmp(vertices, others, sizeof *vertices * mesh.vertices) == 0);
        for (uint32_t i = 0; error == COLONNADE_OK && i < mesh.vertices; ++i)
            for (int axis = 0; axis < 3; ++axis)
                CHECK(vertices[i].position[axis] >= 0 && vertices[i].position[axis] >> mesh.vertex_bits == 0);
        if (error == COLONNADE_OK && mesh.records == record_count && mesh.leaf_records == step)
            check_refit(call % 2 == 0 ? &mesh : &same, vertices, !is_damaged);
        free(others);
        free(vertices);
        free(pose);
    }
    if (opened == COLONNADE_OK && mesh.records == record_count && mesh.leaf_records == step && root == 0)
        check_motion(&mesh, !is_damaged);
    free(odd);
    free(exact);
    return 0;
}
