/* The driver's waits by interrupts, against shell.c: a sleep ends when its interrupt comes, or the test fails.
 * Prints nothing and returns 0, or the line that failed. */
#include "check.h"
#include "shell.h"

enum { STEPS = 10, FRAME_AND_IMAGE_END = 3 };

static const struct colonnade_design design = {
    .device_end = 0x8010,
    .frame_registers = 0x8000,
    .tile_size = 16,
    .posted_writes = 4,
};
static const uint8_t writes[8];
static const struct colonnade_frame frame = {writes, 1, 10, 2};
static const struct colonnade_framebuffer framebuffer = {4096, 64, COLONNADE_XRGB8888, {4096, 8192}};
static const struct colonnade_image image = {NULL, 128, 4096, {4096, 8192}};

static struct shell shell;
static uint32_t *const status = &shell.registers[AT(interrupt_status)];
static uint32_t *const enable = &shell.registers[AT(interrupt_enable)];
static uint32_t sleeps;

/* Until the interrupt, as a processor does that has nothing else to do; the device has ended its work by then. */
static void sleep_until_interrupt(void *context) {
    ++sleeps;
    for (int step = 0; (*status & *enable) == 0; ++step) {
        CHECK(step < 2 * STEPS);
        shell_step(context, step == STEPS ? FRAME_AND_IMAGE_END : 0);
    }
}

/* A program with a handler, which disables the interrupt; its first sleep ends by an earlier interrupt. */
static void sleep_with_handler(void *context) {
    if (sleeps == 0) ++sleeps;
    else sleep_until_interrupt(context);
    *enable = 0;
}

static void do_not_sleep(void *context) {
    (void)context;
    ++sleeps;
}

static struct colonnade_bus bus = {shell_read, shell_write, NULL, &shell};

/* Starts a frame in a device without another event. */
static void start(struct colonnade *device, void (*wait)(void *context)) {
    bus.wait = wait;
    sleeps = 0;
    shell = shell_of(&design, 2);
    CHECK(colonnade_probe(device, &bus, &design) == COLONNADE_OK);
    CHECK(colonnade_set_frame(device, &frame) == COLONNADE_OK);
    CHECK(colonnade_start(device, &framebuffer) == COLONNADE_OK);
}

int main(void) {
    struct colonnade device;

    /* Nobody has enabled an interrupt */
    start(&device, sleep_until_interrupt);
    CHECK(colonnade_wait(&device, COLONNADE_FRAME_DONE, 1) == COLONNADE_OK && sleeps == 1 && *enable == 0);
    CHECK(*status == COLONNADE_FRAME_DONE);
    CHECK(colonnade_load(&device, &image, 1) == COLONNADE_OK && sleeps == 2 && *enable == 0);

    /* The program has enabled others, and one of them has come: it ends no sleep, and raises the interrupt afterwards
     */
    start(&device, sleep_until_interrupt);
    colonnade_enable_interrupts(&device, COLONNADE_IMAGE_DONE | COLONNADE_ERROR);
    *status = COLONNADE_ERROR;
    CHECK(colonnade_wait(&device, COLONNADE_FRAME_DONE, 1) == COLONNADE_OK && sleeps == 1);
    CHECK(*enable == (COLONNADE_IMAGE_DONE | COLONNADE_ERROR) && *status == (COLONNADE_FRAME_DONE | COLONNADE_ERROR));

    start(&device, sleep_with_handler);
    CHECK(colonnade_wait(&device, COLONNADE_FRAME_DONE, 2) == COLONNADE_OK && sleeps == 2 && *enable == 0);

    /* No interrupt: attempts bound the sleeps */
    start(&device, do_not_sleep);
    colonnade_enable_interrupts(&device, COLONNADE_ERROR);
    CHECK(colonnade_wait(&device, COLONNADE_FRAME_DONE, 5) == COLONNADE_TIMEOUT && sleeps == 5);
    CHECK(*enable == COLONNADE_ERROR);

    /* An event that has come needs no sleep, and polling no interrupt */
    start(&device, do_not_sleep);
    *status = COLONNADE_FRAME_DONE;
    const uint32_t written = shell.writes;
    CHECK(colonnade_wait(&device, COLONNADE_FRAME_DONE, 0) == COLONNADE_OK && sleeps == 0);
    bus.wait = NULL;
    CHECK(colonnade_wait(&device, COLONNADE_IMAGE_DONE, 5) == COLONNADE_TIMEOUT && shell.writes == written);
    return 0;
}
