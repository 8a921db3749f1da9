/* Renders a frame under Linux by UIO.
 *
 * usage: uio /dev/uio0 IMAGE FRAME OUTPUT
 *        uio /dev/uio0 IMAGE VIEW OUTPUT X Y Z     moves the object by whole millimetres
 *
 * IMAGE, FRAME and VIEW come from `colonnade pack`; OUTPUT receives lines of XRGB8888. colonnade_design.h comes from
 * `colonnade registers`, for the design in the chip. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

#include "colonnade_view.h"
#include "target.h"

/* The frame of a view file, with the object moved by whole millimetres; or a frame file. */
static struct colonnade_frame read_frame(char **argv, bool is_moved) {
    static uint8_t file[65536], writes[8 * 4096];
    static struct colonnade_view view;
    struct colonnade_frame frame;
    const size_t bytes = target_read(argv[3], file, sizeof file);
    if (!is_moved) {
        target_check(argv[3], colonnade_open_frame(&colonnade_design, file, bytes, &frame));
        return frame;
    }
    target_check(argv[3], colonnade_view_open(&view, &colonnade_design, file, bytes));
    struct colonnade_pose pose = view.object;
    for (int axis = 0; axis < 3; ++axis)
        pose.position[axis] += strtol(argv[5 + axis], NULL, 10) * (INT64_C(1) << 32) / 1000;
    target_check("pose", colonnade_view_set_object(&view, &pose));
    target_check("pose", colonnade_view_frame(&view, writes, sizeof writes / 8, &frame));
    return frame;
}

int main(int argc, char **argv) {
    if (argc != 5 && argc != 8)
        target_fail("usage", "uio /dev/uio0 IMAGE FRAME OUTPUT, or IMAGE VIEW OUTPUT X Y Z millimetres");
    struct target target;
    struct colonnade device;
    target_open(&target, argv[1]);
    target_load(&target, &device, argv[2]);
    const struct colonnade_frame frame = read_frame(argv, argc == 8);
    target_check(argv[3], colonnade_set_frame(&device, &frame));
    const uint32_t stride = target_render(&target, &device, &frame);
    printf("%" PRIu32 "x%" PRIu32 ", %" PRIu64 " cycles\n", frame.width, frame.height,
           colonnade_counter(&device, COLONNADE_COUNTER_CYCLES));
    FILE *output = fopen(argv[4], "wb");
    if (output == NULL) target_fail(argv[4], "cannot be written");
    for (uint32_t line = 0; line < frame.height; ++line)
        fwrite(target.memory + (size_t)line * stride, 4, frame.width, output);
    if (fclose(output) != 0) target_fail(argv[4], "cannot be written");
    return 0;
}
