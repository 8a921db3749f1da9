/* The samples of a frame's passes: docs/view.md. Their definition is host/colonnade/scene/samples.py. */
#include "colonnade_view_parts.h"

enum { MAX_SAMPLES = 16, MAX_DIMENSIONS = COLONNADE_VIEW_LIGHTS + COLONNADE_VIEW_RAYS };

/* The order of the points for dimensions 3, 4, ... (after pixel, time and lens: lights, then rays), with 2, 4, 8 and 16
 * passes: four bits for each pass, the first one lowest. */
static const uint64_t orders[MAX_DIMENSIONS][4] = {
    {0x1, 0x2013, 0x20136475, 0xa893eb05fc2614d7},
    {0x1, 0x2310, 0x26510374, 0xae7518df2b94360c},
    {0x10, 0x3210, 0x36501427, 0x3ed6c0984bfa2715},
    {0x1, 0x2130, 0x21347650, 0xa934fb01d58276ec},
    {0x10, 0x3012, 0x74136052, 0xf4963b7de10c2a58},
    {0x10, 0x3012, 0x34156207, 0x34195a8f07bed2c6},
    {0x1, 0x2031, 0x64503217, 0xec568f1a43029db7},
    {0x10, 0x1302, 0x15407632, 0x9d401fcb2a867e35},
    {0x10, 0x1032, 0x10375462, 0x90b17cd2e54fa638},
    {0x10, 0x3210, 0x37512064, 0xbf6123a0dc47e985},
    {0x1, 0x2031, 0x20765341, 0x20ae6f43d9751cb8},
    {0x10, 0x3021, 0x30412765, 0xb8c679d05ef2143a},
};

/* Point `index` of Sobol's sequence in `count` steps of each axis. */
static void find_point(uint32_t index, uint32_t count, uint32_t point[2]) {
    uint32_t bit = count / 2, direction = count / 2;
    point[0] = point[1] = 0;
    for (; index != 0; index >>= 1) {
        if (index & 1) point[0] ^= bit, point[1] ^= direction;
        bit >>= 1;
        direction ^= direction >> 1;
    }
}

enum colonnade_error colonnade_view_set_sample(struct colonnade_view *view, uint32_t index, uint32_t count) {
    if (count > MAX_SAMPLES || (count & (count - 1)) != 0 || index >= count) return COLONNADE_NO_SAMPLE;
    const int power = colonnade_bit_length(count) - 1;
    struct colonnade_sample *sample = &view->sample;
    uint32_t point[2];
    find_point(index, count, point);
    for (int axis = 0; axis < 2; ++axis) /* the middle of its step, from that of the pixel */
        sample->shift[axis] = ((int64_t)(2 * point[axis] + 1) - (int64_t)count) * (COLONNADE_PIXEL / 2 / count);
    for (uint32_t ray = 0; ray < COLONNADE_VIEW_RAYS; ++ray) {
        const uint64_t order = power == 0 ? 0 : orders[view->scene.lights + ray][power - 1];
        find_point((uint32_t)(order >> (4 * index)) & 15, count, point);
        for (int axis = 0; axis < 2; ++axis) sample->points[ray][axis] = (uint8_t)((2 * point[axis] + 1) * (128 / count));
    }
    return COLONNADE_OK;
}
