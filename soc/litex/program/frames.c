/* Renders an orbit around the object by the driver, with interrupts, and ends the simulation. The processor computes
 * the registers of each view while the frame before it runs. The build puts the files into memory and their places into
 * layout.h. */
#include <libbase/crc.h>
#include <stdio.h>
#include <system.h>

#include "colonnade.h"
#include "colonnade_design.h"
#include "colonnade_view.h"
#include "layout.h"
#include "soc.h"

/* What compare_frames.py reads of a frame: its poses, and the words that differ from the frame before. */
struct record {
    struct colonnade_camera camera;
    struct colonnade_light light;
    uint32_t count;
    uint8_t writes[RECORD_BYTES - 156];
};
_Static_assert(sizeof(struct record) == RECORD_BYTES, "records follow each other as compare_frames.py expects");

static struct colonnade device;
static struct colonnade_view view;

/* The product of a rotation's row with a vector. */
static int64_t turn(const int32_t row[3], const int64_t vector[3]) {
    int64_t high = 0, low = 0;
    for (int axis = 0; axis < 3; ++axis) {
        high += (int64_t)row[axis] * (int32_t)(vector[axis] >> 30);
        low += (int64_t)row[axis] * (int32_t)(vector[axis] & 0x3FFFFFFF);
    }
    return high + (low >> 30);
}

static void turn_position(const int32_t rotation[3][3], int64_t position[3]) {
    const int64_t *centre = view.object.position;
    int64_t from[3];
    for (int axis = 0; axis < 3; ++axis) from[axis] = position[axis] - centre[axis];
    for (int axis = 0; axis < 3; ++axis) position[axis] = centre[axis] + turn(rotation[axis], from);
}

/* Turns camera and light around the upright axis through the object's origin, by an eighth of a turn. */
static void orbit(struct colonnade_camera *camera, struct colonnade_light *light) {
    static const int32_t eighth[4] = {0, 410903207, 0, 992008094};
    int32_t rotation[3][3];
    soc_check("rotation", colonnade_rotation(rotation, eighth));
    turn_position(rotation, camera->pose.position);
    turn_position(rotation, light->position);
    for (int column = 0; column < 3; ++column) {
        int64_t axis[3];
        for (int row = 0; row < 3; ++row) axis[row] = camera->pose.rotation[row][column];
        for (int row = 0; row < 3; ++row) camera->pose.rotation[row][column] = (int32_t)turn(rotation[row], axis);
    }
}

/* Sets poses, and computes the words that change. Answers the cycles that this takes. */
static uint32_t compute_view(struct record *record, struct colonnade_frame *frame) {
    uint32_t start = soc_now();
    soc_check("camera", colonnade_view_set_camera(&view, &record->camera));
    soc_check("light", colonnade_view_set_light(&view, 0, &record->light));
    soc_check("view", colonnade_view_frame(&view, record->writes, sizeof record->writes / 8, frame));
    record->count = frame->count;
    return soc_now() - start;
}

static void load_image(void) {
    const uint8_t *data = (const uint8_t *)IMAGE;
    printf("colonnade: an image without its end: %s\n",
           colonnade_error_name(colonnade_check_image(&colonnade_design, data, IMAGE_BYTES - 128)));
    const struct colonnade_image image = {data, IMAGE_BYTES, IMAGE, {IMAGE, IMAGE + IMAGE_BYTES}};
    uint32_t start = soc_now();
    soc_check("load", colonnade_load(&device, &image, ATTEMPTS));
    printf("colonnade: loaded in %u cycles\n", (unsigned)(soc_now() - start));
#ifdef SCENE
    soc_check("set scene", colonnade_set_scene(&device, SCENE));
#endif
}

int main(void) {
    soc_begin(&device);
    printf("colonnade: found, frames of up to %ux%u, capabilities %03x\n", (unsigned)device.max_width,
           (unsigned)device.max_height, (unsigned)device.capabilities);
    load_image();

    struct record *records = (struct record *)RECORDS;
    struct colonnade_frame frame;
    soc_check("view file", colonnade_view_open(&view, &colonnade_design, (const void *)VIEW, VIEW_BYTES));
    records[0].camera = view.camera;
    records[0].light = view.lights[0];
    uint32_t computed = compute_view(&records[0], &frame);
    for (uint32_t i = 0; i < FRAMES; ++i) {
        const uint32_t base = FRAMEBUFFERS + i * FRAME_BYTES;
        const struct colonnade_framebuffer framebuffer = {base, STRIDE, COLONNADE_XRGB8888, {base, base + FRAME_BYTES}};
        uint32_t start = soc_now();
        soc_check("set frame", colonnade_set_frame(&device, &frame));
        colonnade_view_accept(&view);
        soc_check("start", colonnade_start(&device, &framebuffer));
        uint32_t started = soc_now();
        printf("colonnade: view %u: %u words in %u cycles, set and started in %u\n", (unsigned)i, (unsigned)frame.count,
               (unsigned)computed, (unsigned)(started - start));

        if (i + 1 < FRAMES) {
            records[i + 1].camera = records[i].camera;
            records[i + 1].light = records[i].light;
            orbit(&records[i + 1].camera, &records[i + 1].light);
            computed = compute_view(&records[i + 1], &frame);
        }
        soc_check("wait", colonnade_wait(&device, COLONNADE_FRAME_DONE, ATTEMPTS));
        colonnade_acknowledge(&device, COLONNADE_FRAME_DONE | COLONNADE_ERROR);
        soc_check("frame", colonnade_result(&device));
        /* The processor's own view of the frame */
        flush_cpu_dcache();
        printf("colonnade: frame %u: crc32 %08x, hits %u, %u cycles of the array\n", (unsigned)i,
               (unsigned)crc32((const unsigned char *)base, FRAME_BYTES),
               (unsigned)colonnade_counter(&device, COLONNADE_COUNTER_HITS),
               (unsigned)colonnade_counter(&device, COLONNADE_COUNTER_CYCLES));
    }
    soc_end("end", COLONNADE_OK);
}
