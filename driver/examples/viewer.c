/* A viewer under Linux, without DRM: renders into the device's memory, which is the display's (docs/soc.md), while
 * keys orbit the object.
 *
 * usage: viewer /dev/uio0 IMAGE VIEW [SCENE]               keys of the terminal: a d w s or arrows orbit, + and -
 *                                                          come nearer, r goes back, q ends
 *        viewer /dev/uio0 IMAGE VIEW --keys KEYS [SCENE]   a frame for the view and one after each key
 *        viewer /dev/uio0 IMAGE VIEW --turn N [SCENE]      N frames around the object
 *        viewer /dev/uio0 IMAGE VIEW --play N CLIP [SCENE] N frames of a mesh that bends, or of objects that move
 *
 * SCENE has the records of a scene in DRAM, whose meshes may bend: by the unit of the shell, if it has one. It prints
 * frames a second. IMAGE, VIEW, CLIP and SCENE come from `colonnade pack`; colonnade_design.h from
 * `colonnade registers`. */
#define _POSIX_C_SOURCE 200809L

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#include "colonnade_motion.h"
#include "colonnade_shell.h"
#include "colonnade_view.h"
#include "target.h"

enum { STEP = 5, STEEPEST = 85, FILE_BYTES = 1 << 20, WRITES = 4096, PAGE = 4096, RECORD_BYTES = 32, LINE_BYTES = 64 };

static const double RADIAN = 3.14159265358979323846 / 180, METRE = 4294967296.0, ONE = 1073741824.0;

/* The camera from the view file's: degrees around the middle of the picture, and a factor of its distance. */
struct orbit {
    double azimuth, elevation, distance;
};

static volatile sig_atomic_t is_ended;
static struct termios terminal;

static void end(int signal) { is_ended = signal; }

static void restore_terminal(void) { tcsetattr(STDIN_FILENO, TCSANOW, &terminal); }

/* Keys without Enter and without an echo; as before at the end. */
static void open_terminal(void) {
    if (tcgetattr(STDIN_FILENO, &terminal) != 0) return; /* no terminal: keys come from a file or a pipe */
    struct termios raw = terminal;
    raw.c_lflag &= ~(tcflag_t)(ICANON | ECHO);
    raw.c_cc[VMIN] = 1;
    raw.c_cc[VTIME] = 0;
    tcsetattr(STDIN_FILENO, TCSANOW, &raw);
    atexit(restore_terminal);
}

/* The next key; q at the end of the input. An arrow is ESC [ A to D. */
static char next_key(void) {
    static const char arrows[] = "wsda";
    char key;
    if (is_ended || read(STDIN_FILENO, &key, 1) != 1) return 'q';
    if (key != '\033') return key;
    char rest[2];
    if (read(STDIN_FILENO, rest, 2) != 2 || rest[1] < 'A' || rest[1] > 'D') return 'q';
    return arrows[rest[1] - 'A'];
}

/* Whether a key moves the camera. */
static bool move(struct orbit *orbit, char key) {
    switch (key) {
    case 'a': orbit->azimuth -= STEP; return true;
    case 'd': orbit->azimuth += STEP; return true;
    case 'w': orbit->elevation = fmin(STEEPEST, orbit->elevation + STEP); return true;
    case 's': orbit->elevation = fmax(-STEEPEST, orbit->elevation - STEP); return true;
    case '+': orbit->distance = fmax(0.2, orbit->distance / 1.1); return true;
    case '-': orbit->distance = fmin(5, orbit->distance * 1.1); return true;
    case 'r': *orbit = (struct orbit){0, 0, 1}; return true;
    default: return false;
    }
}

/* A vector after a rotation around a unit axis. */
static void rotate(double vector[3], const double axis[3], double degrees) {
    const double c = cos(degrees * RADIAN), s = sin(degrees * RADIAN);
    const double along = axis[0] * vector[0] + axis[1] * vector[1] + axis[2] * vector[2];
    double turned[3];
    for (int i = 0; i < 3; ++i) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        turned[i] = c * vector[i] + s * (axis[j] * vector[k] - axis[k] * vector[j]) + (1 - c) * along * axis[i];
    }
    memcpy(vector, turned, sizeof turned);
}

/* The camera of an orbit around the point in the middle of the picture, as far away as the object. */
static struct colonnade_camera orbiting(const struct colonnade_view *view, const struct colonnade_camera *from,
                                        const struct orbit *orbit) {
    static const double up[3] = {0, 1, 0};
    struct colonnade_camera camera = *from;
    double axes[3][3], away[3], depth = 0;
    for (int axis = 0; axis < 3; ++axis)
        for (int i = 0; i < 3; ++i) axes[axis][i] = from->pose.rotation[i][axis] / ONE;
    for (int i = 0; i < 3; ++i)
        depth += axes[2][i] * (double)(view->object.position[i] - from->pose.position[i]) / METRE;
    for (int i = 0; i < 3; ++i) away[i] = -orbit->distance * depth * axes[2][i];
    const double right[3] = {axes[0][0], axes[0][1], axes[0][2]};
    double *const vectors[4] = {axes[0], axes[1], axes[2], away};
    for (int i = 0; i < 4; ++i) {
        rotate(vectors[i], right, -orbit->elevation);
        rotate(vectors[i], up, orbit->azimuth);
    }
    for (int i = 0; i < 3; ++i) {
        const double middle = (double)from->pose.position[i] / METRE + depth * from->pose.rotation[i][2] / ONE;
        camera.pose.position[i] = llround((middle + away[i]) * METRE);
        for (int axis = 0; axis < 3; ++axis) camera.pose.rotation[i][axis] = (int32_t)lround(axes[axis][i] * ONE);
    }
    return camera;
}

static double seconds(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* Frames, and the time and cycles that they took. */
struct speed {
    uint32_t frames;
    double seconds;
    uint64_t cycles;
};

static void render(struct target *target, struct colonnade *device, struct colonnade_view *view, struct speed *speed) {
    static uint8_t writes[8 * WRITES];
    struct colonnade_frame frame;
    const double begin = seconds();
    target_check("view", colonnade_view_frame(view, writes, WRITES, &frame));
    target_check("view", colonnade_set_frame(device, &frame));
    colonnade_view_accept(view);
    target_render(target, device, &frame);
    speed->frames += 1;
    speed->seconds += seconds() - begin;
    speed->cycles += colonnade_counter(device, COLONNADE_COUNTER_CYCLES);
}

/* A mesh that bends, or objects that move; the instances of a frame and of the one before. */
struct play {
    bool is_mesh;
    struct colonnade_mesh mesh;
    struct colonnade_motion motion;
    uint32_t roots[2], records; /* of a mesh that bends: of its two copies; of both */
    struct colonnade_motion_memory memory;
    struct colonnade_refit_job
        jobs[COLONNADE_INSTANCES]; /* of meshes, for the unit; without one they have no entries */
    struct colonnade_instance instances[2][COLONNADE_INSTANCES];
};

static void *allocate(size_t count, size_t size) {
    void *found = calloc(count, size);
    if (found == NULL) target_fail("memory", strerror(errno));
    return found;
}

static void open_clip(struct play *play, const char *name) {
    static _Alignas(4) uint8_t clip[FILE_BYTES];
    const size_t bytes = target_read(name, clip, sizeof clip);
    play->is_mesh = bytes >= 8 && memcmp(clip, "CLNDCLIP", 8) == 0;
    if (play->is_mesh) target_check(name, colonnade_mesh_open(&play->mesh, &colonnade_design, clip, bytes));
    else target_check(name, colonnade_motion_open(&play->motion, &colonnade_design, clip, bytes));
    if (colonnade_design.scene_page == 0 && (play->is_mesh || play->motion.clips != 0))
        target_fail(name, "has a mesh that bends, and this device holds its scene on chip: set columnBvhMemory.cache");
}

/* Makes the second copy of a mesh that is all of the scene. */
static enum colonnade_error copy_mesh(struct play *play, uint32_t bytes) {
    const struct colonnade_mesh *mesh = &play->mesh;
    play->roots[1] = bytes / RECORD_BYTES;
    play->records = play->roots[1] + mesh->records;
    if (mesh->records > play->roots[1]) return COLONNADE_OTHER_RECORDS;
    if (play->records > (uint32_t)1 << mesh->address_bits) return COLONNADE_TOO_LARGE;
    uint32_t *scene = play->memory.scene;
    return colonnade_mesh_copy(mesh, scene, 0, scene + RECORD_BYTES / 4 * (size_t)play->roots[1], play->roots[1],
                               play->memory.path);
}

/* Plans the refits of a mesh by the unit, which reads vertices and plan in the device's memory, from byte `at` on.
 * Answers the first byte behind them; `at` for a mesh that is too deep for the unit, or without space. */
static uint64_t plan_refits(const struct target *target, struct play *play, uint32_t clip, uint64_t at) {
    const struct colonnade_mesh *mesh = play->is_mesh ? &play->mesh : &play->motion.meshes[clip];
    const uint32_t root = play->is_mesh ? 0 : play->motion.roots[clip][0];
    const uint32_t *records = play->memory.scene + RECORD_BYTES / 4 * (size_t)root;
    uint32_t *lines = allocate(mesh->vertices / COLONNADE_LINE_VERTICES + 1, sizeof *lines), entries;
    const uint64_t vertices = (at + LINE_BYTES - 1) / LINE_BYTES * LINE_BYTES;
    const uint64_t plan =
        vertices + ((uint64_t)mesh->vertices + COLONNADE_LINE_VERTICES - 1) / COLONNADE_LINE_VERTICES * LINE_BYTES;
    uint64_t end = at;
    if (colonnade_mesh_plan(mesh, records, root, play->memory.path, lines, NULL, &entries) == COLONNADE_OK &&
        plan + (uint64_t)4 * COLONNADE_PLAN_WORDS * entries <= target->size) {
        end = plan + (uint64_t)4 * COLONNADE_PLAN_WORDS * entries;
        uint32_t *words = (uint32_t *)(target->memory + plan);
        target_check("mesh", colonnade_mesh_plan(mesh, records, root, play->memory.path, lines, words, &entries));
        play->jobs[clip] = (struct colonnade_refit_job){target->base + plan, target->base + vertices, 0, entries,
                                                        mesh->vertices,      mesh->records,           0};
    }
    free(lines);
    return end;
}

/* Puts the records of a scene behind a frame of so many bytes, and the second copies of meshes that bend behind them.
 */
static void put_scene(struct target *target, struct colonnade *device, struct play *play, const char *name,
                      uint64_t frame) {
    const struct colonnade_mesh *mesh = &play->mesh;
    const uint64_t at = (frame + PAGE - 1) / PAGE * PAGE;
    const uint64_t copy = play->is_mesh ? (uint64_t)RECORD_BYTES * mesh->records : play->motion.copy_bytes;
    if (at + copy > target->size) target_fail(name, "has no space behind the frame");
    const uint32_t bytes = (uint32_t)target_read(name, target->memory + at, target->size - copy - at);
    const uint32_t vertices = play->is_mesh ? mesh->vertices : play->motion.vertices;
    const uint32_t depth = play->is_mesh ? mesh->depth : play->motion.depth;
    const uint32_t words = play->is_mesh ? colonnade_mesh_pose_words(mesh) : play->motion.pose_words;
    play->memory = (struct colonnade_motion_memory){
        (uint32_t *)(target->memory + at), allocate(vertices + 1, sizeof *play->memory.vertices),
        allocate(depth + 1, sizeof *play->memory.path), allocate(words + 1, sizeof *play->memory.pose)};
    if (play->is_mesh) target_check(name, copy_mesh(play, bytes));
    else if (play->motion.clips != 0) target_check(name, colonnade_motion_copy(&play->motion, &play->memory, bytes));
    if (device->capabilities & COLONNADE_SHELL__CAPABILITIES__REFIT_bm)
        for (uint64_t clip = 0, end = at + bytes + copy; clip < (play->is_mesh ? 1 : play->motion.clips); ++clip)
            end = plan_refits(target, play, (uint32_t)clip, end);
    target_check(name, colonnade_set_scene(device, target->base + at));
}

/* Bends a mesh in the copy at `root`, which no frame reads: by the unit of the shell, if it has one. */
static void bend(const struct target *target, struct colonnade *device, const struct play *play, uint32_t clip,
                 uint32_t time, uint32_t root) {
    const struct colonnade_mesh *mesh = play->is_mesh ? &play->mesh : &play->motion.meshes[clip];
    const struct colonnade_motion_memory *memory = &play->memory;
    struct colonnade_refit_job job = play->jobs[clip];
    const bool has_unit = job.entries != 0;
    uint8_t *records = (uint8_t *)memory->scene + RECORD_BYTES * (size_t)root;
    struct colonnade_vertex *vertices =
        has_unit ? (struct colonnade_vertex *)(target->memory + (job.vertices - target->base)) : memory->vertices;
    struct colonnade_refit result;
    colonnade_mesh_pose(mesh, time < mesh->duration ? time : mesh->duration, memory->pose);
    target_check("mesh", colonnade_mesh_skin(mesh, memory->pose, vertices));
    if (has_unit) {
        job.records = target->base + (uint64_t)(records - target->memory);
        job.root = root;
        target_check("refit", colonnade_refit_start(device, &job));
        target_check("refit", colonnade_refit_wait(device, UINT32_MAX, &result));
    } else target_check("mesh", colonnade_mesh_refit(mesh, vertices, (uint32_t *)records, root, memory->path, &result));
}

/* Bends the mesh that is all of the scene. Answers the number of writes. */
static uint32_t bend_mesh(const struct target *target, struct colonnade *device, const struct play *play, uint32_t time,
                          uint32_t root, uint8_t *writes) {
    bend(target, device, play, 0, time, root);
    return colonnade_mesh_writes(&colonnade_design, root, play->records, writes);
}

/* Moves objects, and bends their meshes. Answers the number of writes. */
static uint32_t move_objects(const struct target *target, struct colonnade *device, struct colonnade_view *view,
                             struct play *play, uint32_t time, uint32_t number, uint8_t *writes) {
    const struct colonnade_motion *motion = &play->motion;
    struct colonnade_transform transforms[COLONNADE_INSTANCES];
    struct colonnade_instance *now = play->instances[number % 2];
    const struct colonnade_instance *before = number == 0 ? NULL : play->instances[(number + 1) % 2];
    colonnade_motion_transforms(motion, time, transforms);
    target_check("motion", colonnade_motion_find(motion, transforms, now));
    uint32_t roots[COLONNADE_INSTANCES];
    target_check("mesh", colonnade_motion_swap(motion, device, before, now, roots));
    for (uint32_t clip = 0; clip < motion->clips; ++clip) bend(target, device, play, clip, time, roots[clip]);
    const struct colonnade_shared shared = colonnade_find_shared(now, motion->objects);
    target_check("view", colonnade_view_set_bounds(view, shared.low, shared.high));
    return colonnade_motion_writes(motion, now, before, writes);
}

/* Finds the registers of a frame: the view's, then the moving objects'. */
static void find_frames(const struct target *target, struct colonnade *device, struct colonnade_view *view,
                        struct play *play, uint32_t number, uint32_t count, struct colonnade_frame frames[2]) {
    static uint8_t writes[8 * WRITES], moves[8 * COLONNADE_MOTION_WRITES];
    const uint32_t duration = play->is_mesh ? play->mesh.duration : play->motion.duration;
    const uint32_t time = (uint32_t)((uint64_t)duration * number / count);
    const uint32_t moved = play->is_mesh ? bend_mesh(target, device, play, time, play->roots[number % 2], moves)
                                         : move_objects(target, device, view, play, time, number, moves);
    target_check("view", colonnade_view_frame(view, writes, WRITES, &frames[0]));
    frames[1] = frames[0];
    frames[1].writes = moves;
    frames[1].count = moved;
}

/* Renders frames of a motion: meshes are bent, and registers found and written, while the last frame runs. */
static void play_all(struct target *target, struct colonnade *device, struct colonnade_view *view, struct play *play,
                     uint32_t count, struct speed *speed) {
    const double begin = seconds();
    bool is_running = false;
    for (uint32_t number = 0; number < count && !is_ended; ++number) {
        struct colonnade_frame frames[2];
        find_frames(target, device, view, play, number, count, frames);
        for (int part = 0; part < 2; ++part) {
            enum colonnade_error error = colonnade_set_frame(device, &frames[part]);
            if (error == COLONNADE_BUSY && is_running) { /* the shell has no space for so many writes */
                target_finish(device);
                is_running = false;
                error = colonnade_set_frame(device, &frames[part]);
            }
            target_check("frame", error);
        }
        colonnade_view_accept(view);
        if (is_running) target_finish(device);
        if (number > 0) speed->cycles += colonnade_counter(device, COLONNADE_COUNTER_CYCLES);
        target_start(target, device, &frames[0]);
        is_running = true;
        speed->frames += 1;
    }
    if (is_running) target_finish(device);
    speed->cycles += colonnade_counter(device, COLONNADE_COUNTER_CYCLES);
    speed->seconds = seconds() - begin;
}

int main(int argc, char **argv) {
    static uint8_t file[FILE_BYTES];
    static struct play play;
    static struct colonnade_view view;
    const char *option = argc > 4 && strncmp(argv[4], "--", 2) == 0 ? argv[4] : NULL;
    const bool has_keys = option != NULL && strcmp(option, "--keys") == 0;
    const bool turns = option != NULL && strcmp(option, "--turn") == 0;
    const bool plays = option != NULL && strcmp(option, "--play") == 0;
    const int last = option == NULL ? 4 : plays ? 7 : 6; /* arguments without SCENE */
    if ((option != NULL && !has_keys && !turns && !plays) || (argc != last && argc != last + 1))
        target_fail("usage", "viewer /dev/uio0 IMAGE VIEW [--keys KEYS | --turn FRAMES | --play FRAMES CLIP] [SCENE]");
    const char *scene = argc > last ? argv[last] : NULL;
    const long count = turns || plays ? strtol(argv[5], NULL, 10) : 0;
    if ((turns || plays) && (count < 1 || count > 1000000)) target_fail(option, "has a number of frames, 1 to 1000000");
    if (plays) open_clip(&play, argv[6]);
    if (colonnade_design.scene_page != 0 && scene == NULL)
        target_fail("SCENE",
                    "is missing: this device has its scene in DRAM; give the file of pack --dram-image at the end");
    if (colonnade_design.scene_page == 0 && scene != NULL)
        target_fail(scene, "is for a scene in DRAM, and this device holds its scene on chip: leave it out");
    target_check(argv[3], colonnade_view_open(&view, &colonnade_design, file, target_read(argv[3], file, sizeof file)));
    struct target target;
    struct colonnade device;
    target_open(&target, argv[1]);
    const struct sigaction action = {.sa_handler = end};
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
    sigaction(SIGHUP, &action, NULL);
    const struct colonnade_camera start = view.camera;
    if (target.line != 0 && target.line != target_stride(start.width))
        target_fail(argv[3], "frames are not as wide as the display: give pack its --size");
    target_load(&target, &device, argv[2]);
    if (scene != NULL) put_scene(&target, &device, &play, scene, (uint64_t)target_stride(start.width) * start.height);

    struct orbit orbit = {0, 0, 1};
    struct speed speed = {0, 0, 0};
    if (option == NULL) open_terminal();
    if (plays) play_all(&target, &device, &view, &play, (uint32_t)count, &speed);
    else render(&target, &device, &view, &speed);
    for (long number = 1; !is_ended && !plays; ++number) {
        if (turns && number >= count) break;
        const char key = turns ? 0 : has_keys ? argv[5][number - 1] : next_key();
        if (turns) orbit.azimuth = 360.0 * (double)number / (double)count;
        else if (key == 'q' || key == 0) break;
        else if (!move(&orbit, key)) continue;
        const struct colonnade_camera camera = orbiting(&view, &start, &orbit);
        target_check("camera", colonnade_view_set_camera(&view, &camera));
        render(&target, &device, &view, &speed);
        if (option == NULL) fprintf(stderr, "\r%.1f frames/s ", speed.frames / speed.seconds);
    }
    fprintf(stderr, "%" PRIu32 " frames of %" PRIu32 "x%" PRIu32 ", %.2f frames/s, %" PRIu64 " cycles a frame%s\n",
            speed.frames, start.width, start.height, speed.frames / speed.seconds, speed.cycles / speed.frames,
            play.jobs[0].entries != 0 ? ", bent by the shell's unit" : "");
    return 0;
}
