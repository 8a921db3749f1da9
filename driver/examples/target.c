/* What the examples do on every machine: a load and a frame. */
#include "target.h"

enum { ATTEMPTS = 6000 }; /* of a tenth of a second at most */

void target_load(struct target *target, struct colonnade *device, const char *name) {
    target_check("device", colonnade_probe(device, &target->bus, &colonnade_design));
    colonnade_acknowledge(device,
                          COLONNADE_FRAME_DONE | COLONNADE_IMAGE_DONE | COLONNADE_ERROR); /* of an earlier program */
    /* Also of an event that comes before the wait for it: who counts interrupts sees each */
    colonnade_enable_interrupts(device, COLONNADE_IMAGE_DONE);
    const uint32_t bytes = target_put(target, name);
    const uint64_t base = target->base;
    const struct colonnade_image image = {target->memory, bytes, base, {base, base + target->size}};
    target_check(name, colonnade_load(device, &image, ATTEMPTS));
    colonnade_enable_interrupts(device, COLONNADE_FRAME_DONE);
}

uint32_t target_stride(uint32_t width) {
    const uint32_t tile = colonnade_design.tile_size;
    return (width + tile - 1) / tile * tile * 4;
}

uint32_t target_start(struct target *target, struct colonnade *device, const struct colonnade_frame *frame) {
    const uint32_t stride = target_stride(frame->width);
    const uint64_t base = target->base;
    const struct colonnade_framebuffer framebuffer = {base, stride, COLONNADE_XRGB8888, {base, base + target->size}};
    colonnade_acknowledge(device, COLONNADE_FRAME_DONE | COLONNADE_ERROR);
    target_check("start", colonnade_start(device, &framebuffer));
    return stride;
}

void target_finish(struct colonnade *device) {
    target_check("frame", colonnade_wait(device, COLONNADE_FRAME_DONE, ATTEMPTS));
    target_check("frame", colonnade_result(device));
}

uint32_t target_render(struct target *target, struct colonnade *device, const struct colonnade_frame *frame) {
    const uint32_t stride = target_start(target, device, frame);
    target_finish(device);
    return stride;
}
