/* Renders one frame by the driver, with interrupts, and ends the simulation. The build puts the files into memory and
 * their places into layout.h. */
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
#include "layout.h"

enum { ATTEMPTS = 1000 };

static struct colonnade device;
static volatile bool interrupt_came;

/* The level goes with the device's own mask; the event stays in interrupt.status. */
static void on_interrupt(void) {
    colonnade_enable_interrupts(&device, 0);
    interrupt_came = true;
}

static void wait_for_interrupt(void *context) {
    (void)context;
    interrupt_came = false;
    colonnade_enable_interrupts(&device, COLONNADE_FRAME_DONE | COLONNADE_IMAGE_DONE);
    while (!interrupt_came) {
    }
}

static uint32_t now(void) {
    timer0_update_value_write(1);
    return 0xFFFFFFFFu - timer0_value_read();
}

static void end(const char *what, enum colonnade_error error) {
    printf("colonnade: %s: %s\n", what, colonnade_error_name(error));
    uart_sync();
    simulation_finish_write(1);
    for (;;) {
    }
}

static void check(const char *what, enum colonnade_error error) {
    if (error != COLONNADE_OK) end(what, error);
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
    uint32_t start = now();
    check("probe", colonnade_probe(&device, &bus, &colonnade_design));
    uint32_t probed = now();
    printf("colonnade: found, frames of up to %ux%u, capabilities %03x\n", (unsigned)device.max_width,
           (unsigned)device.max_height, (unsigned)device.capabilities);

    const uint8_t *data = (const uint8_t *)IMAGE;
    printf("colonnade: an image without its end: %s\n",
           colonnade_error_name(colonnade_check_image(&colonnade_design, data, IMAGE_BYTES - 128)));
    const struct colonnade_image image = {data, IMAGE_BYTES, IMAGE, {IMAGE, IMAGE + IMAGE_BYTES}};
    uint32_t loading = now();
    check("load", colonnade_load(&device, &image, ATTEMPTS));
    uint32_t loaded = now();

#ifdef SCENE
    check("set scene", colonnade_set_scene(&device, SCENE));
#endif
    struct colonnade_frame frame;
    check("frame file", colonnade_open_frame(&colonnade_design, (const void *)FRAME, FRAME_BYTES, &frame));
    check("set frame", colonnade_set_frame(&device, &frame));
    const struct colonnade_framebuffer framebuffer = {
        FRAMEBUFFER, STRIDE, COLONNADE_XRGB8888, {FRAMEBUFFER, FRAMEBUFFER + FRAMEBUFFER_BYTES}};
    check("start", colonnade_start(&device, &framebuffer));
    uint32_t started = now();
    check("wait", colonnade_wait(&device, COLONNADE_FRAME_DONE, ATTEMPTS));
    uint32_t done = now();
    colonnade_acknowledge(&device, COLONNADE_FRAME_DONE | COLONNADE_ERROR);
    check("frame", colonnade_result(&device));

    /* The processor's own view of the frame */
    flush_cpu_dcache();
    printf("colonnade: frame of %ux%u, crc32 %08x, hits %u\n", (unsigned)frame.width, (unsigned)frame.height,
           (unsigned)crc32((const unsigned char *)FRAMEBUFFER, FRAMEBUFFER_BYTES),
           (unsigned)colonnade_counter(&device, COLONNADE_COUNTER_HITS));
    printf("colonnade: cycles: probe %u, load %u, set and start %u, frame %u, of which the array %u\n",
           (unsigned)(probed - start), (unsigned)(loaded - loading), (unsigned)(started - loaded),
           (unsigned)(done - started), (unsigned)colonnade_counter(&device, COLONNADE_COUNTER_CYCLES));
    end("end", COLONNADE_OK);
}
