/* Renders an orbit around the object by the driver, with interrupts, and ends the simulation. The processor computes the
 * registers of each view while the frame before it runs. The build puts the files into memory and their places into
 * layout.h. */
#include <irq.h>
#include <libbase/crc.h>
#include <libbase/uart.h>
#include <stdio.h>
#include <system.h>

#include <generated/csr.h>
#include <generated/mem.h>
#include <generated/soc.h>

#include "colonnade.h"
#include "colonnade_design.h"
#include "colonnade_view.h"
#include "layout.h"

enum { ATTEMPTS = 1000, SPINS = 1000000 };

/* What compare.py reads of a frame: its poses, and the words that differ from those of the frame before. */
struct record {
    struct colonnade_camera camera;
    struct colonnade_light light;
    uint32_t count;
    uint8_t writes[RECORD_BYTES - 156];
};
_Static_assert(sizeof(struct record) == RECORD_BYTES, "records follow each other as compare.py expects");

static struct colonnade device;
static struct colonnade_view view;
static volatile bool interrupt_came;

/* The level goes with the device's own mask, which the driver sets before each wait; the event stays in interrupt.status. */
static void on_interrupt(void) {
    colonnade_enable_interrupts(&device, 0);
    interrupt_came = true;
}

static void wait_for_interrupt(void *context) {
    (void)context;
    for (uint32_t spin = 0; !interrupt_came && spin < SPINS; ++spin) {}
    interrupt_came = false;
}

static uint32_t now(void) {
    timer0_update_value_write(1);
    return 0xFFFFFFFFu - timer0_value_read();
}

static void end(const char *what, enum colonnade_error error) {
    printf("colonnade: %s: %s\n", what, colonnade_error_name(error));
    uart_sync();
    simulation_finish_write(1);
    for (;;) {}
}

static void check(const char *what, enum colonnade_error error) {
    if (error != COLONNADE_OK) end(what, error);
}

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
    check("rotation", colonnade_rotation(rotation, eighth));
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
    uint32_t start = now();
    check("camera", colonnade_view_set_camera(&view, &record->camera));
    check("light", colonnade_view_set_light(&view, 0, &record->light));
    check("view", colonnade_view_frame(&view, record->writes, sizeof record->writes / 8, frame));
    record->count = frame->count;
    return now() - start;
}

static void load_image(void) {
    const uint8_t *data = (const uint8_t *)IMAGE;
    printf("colonnade: an image without its end: %s\n", colonnade_error_name(colonnade_check_image(&colonnade_design, data, IMAGE_BYTES - 128)));
    const struct colonnade_image image = {data, IMAGE_BYTES, IMAGE, {IMAGE, IMAGE + IMAGE_BYTES}};
    uint32_t start = now();
    check("load", colonnade_load(&device, &image, ATTEMPTS));
    printf("colonnade: loaded in %u cycles\n", (unsigned)(now() - start));
#ifdef SCENE
    check("set scene", colonnade_set_scene(&device, SCENE));
#endif
}

int main(void) {
    irq_setmask(0);
    irq_setie(1);
    uart_init();
    timer0_en_write(0);
    timer0_load_write(0xFFFFFFFFu);
    timer0_en_write(1);
    irq_attach(COLONNADE_INTERRUPT, on_interrupt);
    irq_setmask(irq_getmask() | 1u << COLONNADE_INTERRUPT);

    const struct colonnade_bus bus = {colonnade_mmio_read, colonnade_mmio_write, wait_for_interrupt, (void *)COLONNADE_BASE};
    check("probe", colonnade_probe(&device, &bus, &colonnade_design));
    printf("colonnade: found, frames of up to %ux%u, capabilities %03x\n", (unsigned)device.max_width, (unsigned)device.max_height, (unsigned)device.capabilities);
    load_image();

    struct record *records = (struct record *)RECORDS;
    struct colonnade_frame frame;
    check("view file", colonnade_view_open(&view, &colonnade_design, (const void *)VIEW, VIEW_BYTES));
    records[0].camera = view.camera;
    records[0].light = view.lights[0];
    uint32_t computed = compute_view(&records[0], &frame);
    for (uint32_t i = 0; i < FRAMES; ++i) {
        const uint32_t base = FRAMEBUFFERS + i * FRAME_BYTES;
        const struct colonnade_framebuffer framebuffer = {base, STRIDE, COLONNADE_XRGB8888, {base, base + FRAME_BYTES}};
        uint32_t start = now();
        check("set frame", colonnade_set_frame(&device, &frame));
        colonnade_view_accept(&view);
        check("start", colonnade_start(&device, &framebuffer));
        uint32_t started = now();
        printf("colonnade: view %u: %u words in %u cycles, set and started in %u\n", (unsigned)i, (unsigned)frame.count, (unsigned)computed, (unsigned)(started - start));

        if (i + 1 < FRAMES) {
            records[i + 1].camera = records[i].camera;
            records[i + 1].light = records[i].light;
            orbit(&records[i + 1].camera, &records[i + 1].light);
            computed = compute_view(&records[i + 1], &frame);
        }
        check("wait", colonnade_wait(&device, COLONNADE_FRAME_DONE, ATTEMPTS));
        colonnade_acknowledge(&device, COLONNADE_FRAME_DONE | COLONNADE_ERROR);
        check("frame", colonnade_result(&device));
        /* The processor's own view of the frame */
        flush_cpu_dcache();
        printf("colonnade: frame %u: crc32 %08x, hits %u, %u cycles of the array\n", (unsigned)i, (unsigned)crc32((const unsigned char *)base, FRAME_BYTES),
               (unsigned)colonnade_counter(&device, COLONNADE_COUNTER_HITS), (unsigned)colonnade_counter(&device, COLONNADE_COUNTER_CYCLES));
    }
    end("end", COLONNADE_OK);
}
