/* A viewer under Linux, without DRM: renders into the device's memory, which is the display's (docs/soc.md), while
 * keys orbit the object.
 *
 * usage: viewer /dev/uio0 IMAGE VIEW             keys of the terminal: a d w s or arrows orbit, + - come nearer, r goes back,
 *                                                q ends
 *        viewer /dev/uio0 IMAGE VIEW --keys KEYS a frame for the view and one after each key
 *        viewer /dev/uio0 IMAGE VIEW --turn N    N frames around the object
 *        viewer /dev/uio0 IMAGE VIEW --play N CLIP [SCENE]    N frames of objects that move; SCENE has the records of a scene
 *                                                in DRAM, whose meshes may bend
 *
 * It prints frames a second. IMAGE, VIEW, CLIP and SCENE come from `colonnade pack`; colonnade_design.h from `colonnade
 * registers`. */
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
#include "colonnade_view.h"
#include "target.h"

enum { STEP = 5, STEEPEST = 85, FILE_BYTES = 1 << 20, WRITES = 4096, PAGE = 4096 };

static const double RADIAN = 3.14159265358979323846 / 180, METRE = 4294967296.0, ONE = 1073741824.0;

/* The camera from that of the view file: degrees around the middle of the picture, and a factor of its distance. */
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
    for (int i = 0; i < 3; ++i) depth += axes[2][i] * (double)(view->object.position[i] - from->pose.position[i]) / METRE;
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

/* Objects that move, and the instances of a frame and of the one before. */
struct play {
    struct colonnade_motion motion;
    struct colonnade_motion_memory memory;
    struct colonnade_instance instances[2][COLONNADE_INSTANCES];
};

static void *allocate(size_t count, size_t size) {
    void *found = calloc(count, size);
    if (found == NULL) target_fail("memory", strerror(errno));
    return found;
}

/* Puts the records of a scene behind a frame of so many bytes. */
static void put_scene(struct target *target, struct colonnade *device, struct play *play, const char *name, uint64_t frame) {
    struct colonnade_motion *motion = &play->motion;
    const uint64_t at = (frame + PAGE - 1) / PAGE * PAGE;
    if (at + motion->copy_bytes > target->size) target_fail(name, "has no space behind the frame");
    const size_t bytes = target_read(name, target->memory + at, target->size - motion->copy_bytes - at);
    play->memory = (struct colonnade_motion_memory){
        (uint32_t *)(target->memory + at), allocate(motion->vertices + 1, sizeof *play->memory.vertices),
        allocate(motion->depth + 1, sizeof *play->memory.path), allocate(motion->pose_words + 1, sizeof *play->memory.pose)};
    target_check(name, colonnade_motion_copy(motion, &play->memory, (uint32_t)bytes));
    target_check(name, colonnade_set_scene(device, target->base + at));
}

/* Finds the registers of a frame: those of the view, then those of instances; bends meshes. */
static void find_frames(const struct colonnade *device, struct colonnade_view *view, struct play *play, uint32_t number,
                        uint32_t count, struct colonnade_frame frames[2]) {
    static uint8_t writes[8 * WRITES], moves[8 * COLONNADE_MOTION_WRITES];
    const struct colonnade_motion *motion = &play->motion;
    struct colonnade_transform transforms[COLONNADE_INSTANCES];
    struct colonnade_instance *now = play->instances[number % 2];
    const struct colonnade_instance *before = number == 0 ? NULL : play->instances[(number + 1) % 2];
    const uint32_t time = (uint32_t)((uint64_t)motion->duration * number / count);
    colonnade_motion_transforms(motion, time, transforms);
    target_check("motion", colonnade_motion_find(motion, transforms, now));
    target_check("mesh", colonnade_motion_bend(motion, device, &play->memory, time, before, now));
    const struct colonnade_shared shared = colonnade_find_shared(now, motion->objects);
    target_check("view", colonnade_view_set_bounds(view, shared.low, shared.high));
    target_check("view", colonnade_view_frame(view, writes, WRITES, &frames[0]));
    frames[1] = frames[0];
    frames[1].writes = moves;
    frames[1].count = colonnade_motion_writes(motion, now, before, moves);
}

/* Renders frames of a motion: meshes are bent, and registers found and written, while the last frame runs. */
static void play_all(struct target *target, struct colonnade *device, struct colonnade_view *view, struct play *play,
                     uint32_t count, struct speed *speed) {
    const double begin = seconds();
    bool is_running = false;
    for (uint32_t number = 0; number < count && !is_ended; ++number) {
        struct colonnade_frame frames[2];
        find_frames(device, view, play, number, count, frames);
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
    static uint8_t file[FILE_BYTES], clip[FILE_BYTES];
    static struct play play;
    static struct colonnade_view view;
    const bool has_keys = argc == 6 && strcmp(argv[4], "--keys") == 0, turns = argc == 6 && strcmp(argv[4], "--turn") == 0;
    const bool plays = (argc == 7 || argc == 8) && strcmp(argv[4], "--play") == 0;
    if (argc != 4 && !has_keys && !turns && !plays)
        target_fail("usage", "viewer /dev/uio0 IMAGE VIEW [--keys KEYS | --turn FRAMES | --play FRAMES CLIP [SCENE]]");
    const long count = turns || plays ? strtol(argv[5], NULL, 10) : 0;
    if ((turns || plays) && (count < 1 || count > 1000000)) target_fail(argv[4], "has a number of frames, 1 to 1000000");
    if (plays)
        target_check(argv[6],
                     colonnade_motion_open(&play.motion, &colonnade_design, clip, target_read(argv[6], clip, sizeof clip)));
    if (argc == 7 && play.motion.clips != 0) target_fail(argv[6], "has meshes that bend: give the records of the scene");
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
    if (argc == 8) put_scene(&target, &device, &play, argv[7], (uint64_t)target_stride(start.width) * start.height);

    struct orbit orbit = {0, 0, 1};
    struct speed speed = {0, 0, 0};
    if (argc == 4) open_terminal();
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
        if (argc == 4) fprintf(stderr, "\r%.1f frames/s ", speed.frames / speed.seconds);
    }
    fprintf(stderr, "%" PRIu32 " frames of %" PRIu32 "x%" PRIu32 ", %.2f frames/s, %" PRIu64 " cycles a frame\n", speed.frames,
            start.width, start.height, speed.frames / speed.seconds, speed.cycles / speed.frames);
    return 0;
}
