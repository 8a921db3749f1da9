/* The driver against a simulated device: commands of the shell's test bench go to the standard output, its answers come
 * from the standard input. Renders a frame in each format, two of them queued, and then tries what the device has to
 * refuse.
 *
 * usage: simulated IMAGE FRAME interrupt|poll [SCENE | MAPS OTHER FRAME]
 *
 * SCENE has the records of a scene in DRAM. After three frames the device loads MAPS, but first OTHER, an image of maps
 * of another format, which it has to refuse; frames from then on are the last FRAME's.
 *
 * Memory: the image at PAGE, scene or maps behind it, then framebuffers, each in a window of its size.
 * A page of untouched memory is around each of them. */
#include "simulator.h"

/* Renders the frame that is set and prints its place. */
static void render(struct colonnade *device, const struct colonnade_framebuffer *framebuffer, const char *what) {
    expect(colonnade_start(device, framebuffer), COLONNADE_OK, what);
    expect(colonnade_wait(device, COLONNADE_FRAME_DONE, ATTEMPTS), COLONNADE_OK, what);
    colonnade_acknowledge(device, COLONNADE_FRAME_DONE | COLONNADE_ERROR);
    expect(colonnade_result(device), COLONNADE_OK, what);
    fprintf(stderr, "frame %" PRIu64 " %" PRIu32 " hits %" PRIu64 "\n", framebuffer->base, framebuffer->stride,
            colonnade_counter(device, COLONNADE_COUNTER_HITS));
}

/* Loads maps into a device that has rendered frames; the scene stays. What is no image of maps, or of another format,
 * is refused, by the driver and, where it does not see the image, by the device. */
static void load_maps(struct colonnade *device, const struct colonnade_image *scene, const char *maps,
                      const char *other, uint64_t place) {
    size_t bytes, other_bytes;
    void *data = read_file(maps, &bytes), *other_data = read_file(other, &other_bytes);
    struct colonnade_image image = {other_data, (uint32_t)other_bytes, place, {place, place + other_bytes}};
    expect(colonnade_load_maps(device, scene, ATTEMPTS), COLONNADE_BAD_SECTION, "a scene in place of maps");
    expect(colonnade_load_maps(device, &image, ATTEMPTS), COLONNADE_OTHER_FORMAT, "maps of another format");
    image.data = NULL;
    printf("store %s %" PRIu64 "\n", other, place);
    expect(colonnade_load_maps(device, &image, ATTEMPTS), COLONNADE_OTHER_FORMAT,
           "maps of another format by the device");
    image = (struct colonnade_image){data, (uint32_t)bytes, place, {place, place + bytes}};
    printf("store %s %" PRIu64 "\n", maps, place);
    expect(colonnade_load_maps(device, &image, ATTEMPTS), COLONNADE_OK, "load maps");
    fprintf(stderr, "stored %" PRIu64 "\n", place);
    free(data);
    free(other_data);
}

int main(int argc, char **argv) {
    static const struct colonnade_bus bus = {bus_read, bus_write, bus_wait, NULL};
    static const uint32_t pixel_bytes[] = {4, 2, 8};
    if (argc != 4 && argc != 5 && argc != 7) fail("usage");
    waits_for_interrupt = strcmp(argv[3], "interrupt") == 0;
    size_t image_bytes, frame_bytes;
    uint8_t *image_data = read_file(argv[1], &image_bytes);
    void *frame_data = read_file(argv[2], &frame_bytes);
    struct colonnade device;
    struct colonnade_frame frame;
    expect(colonnade_probe(&device, &bus, &colonnade_design), COLONNADE_OK, "probe");

    /* An image that the device refuses, since the driver does not see it: one word of the format hash differs */
    struct colonnade_image image = {NULL, (uint32_t)image_bytes, PAGE, {PAGE, PAGE + image_bytes}};
    puts("store other 4096");
    expect(colonnade_load(&device, &image, ATTEMPTS), COLONNADE_OTHER_FORMAT, "an image of another format");
    puts("store image 4096");
    image.bytes -= 128;
    expect(colonnade_load(&device, &image, ATTEMPTS), COLONNADE_BAD_LENGTH, "a truncated image");
    image.bytes += 128;
    image.data = image_data;
    image.window.end -= 1;
    expect(colonnade_load(&device, &image, ATTEMPTS), COLONNADE_TOO_LARGE, "an image larger than its window");
    image.window.end += 1;
    expect(colonnade_load(&device, &image, ATTEMPTS), COLONNADE_OK, "load");

    expect(colonnade_open_frame(&colonnade_design, frame_data, frame_bytes, &frame), COLONNADE_OK, "frame file");
    expect(colonnade_set_frame(&device, &frame), COLONNADE_OK, "set frame");
    uint32_t tile = colonnade_design.tile_size, columns = (frame.width + tile - 1) / tile * tile;
    uint64_t place = PAGE + pages(image_bytes) + PAGE;
    if (argc == 5) {
        size_t scene_bytes;
        free(read_file(argv[4], &scene_bytes));
        printf("store %s %" PRIu64 "\n", argv[4], place);
        expect(colonnade_set_scene(&device, place), COLONNADE_OK, "set scene");
        fprintf(stderr, "stored %" PRIu64 "\n", place);
        place += pages(scene_bytes) + PAGE;
    }
    const uint64_t maps_place = place;
    if (argc == 7) place += pages(image_bytes) + PAGE; /* maps are a part of an image */
    for (uint32_t format = COLONNADE_XRGB8888; format <= COLONNADE_LINEAR16; ++format) {
        uint32_t stride = columns * pixel_bytes[format];
        uint64_t bytes = (uint64_t)stride * frame.height;
        struct colonnade_framebuffer framebuffer = {place, stride, format, {place, place + bytes}};
        render(&device, &framebuffer, "a frame");
        place += pages(bytes) + PAGE;
    }
    if (argc == 7) {
        free(frame_data);
        frame_data = read_file(argv[6], &frame_bytes);
        load_maps(&device, &image, argv[4], argv[5], maps_place);
        expect(colonnade_open_frame(&colonnade_design, frame_data, frame_bytes, &frame), COLONNADE_OK,
               "second frame file");
        expect(colonnade_set_frame(&device, &frame), COLONNADE_OK, "set a frame of new maps");
        const uint64_t bytes = (uint64_t)4 * columns * frame.height;
        render(&device, &(struct colonnade_framebuffer){place, columns * 4, COLONNADE_XRGB8888, {place, place + bytes}},
               "a frame of new maps");
        place += pages(bytes) + PAGE;
    }

    /* A soft reset in the middle of a frame; then the device lacks a frame, and takes one again */
    struct colonnade_framebuffer last = {
        place, columns * 4, COLONNADE_XRGB8888, {place, place + 4 * columns * frame.height}};
    expect(colonnade_start(&device, &last), COLONNADE_OK, "start before a reset");
    uint32_t sets = 0; /* while it runs: as many as fit, none in part */
    while (colonnade_set_frame(&device, &frame) == COLONNADE_OK) ++sets;
    const uint32_t words = frame.count + (colonnade_design.scene_page != 0);
    if (sets != colonnade_design.posted_writes / words) fail("the shell has space for other many sets of registers");
    expect(colonnade_start(&device, &last), COLONNADE_OK, "start of a queued frame");
    expect(colonnade_set_frame(&device, &frame), COLONNADE_BUSY, "a third frame");
    expect(colonnade_reset(&device, ATTEMPTS), COLONNADE_OK, "reset");
    expect(colonnade_start(&device, &last), COLONNADE_NO_FRAME, "start after a reset");
    expect(colonnade_set_frame(&device, &frame), COLONNADE_OK, "set frame after a reset");
    colonnade_acknowledge(&device, COLONNADE_FRAME_DONE | COLONNADE_ERROR);
    render(&device, &last, "a frame after a reset");
    printf("dump memory 0 %" PRIu64 "\n", place + pages(4 * columns * frame.height) + PAGE);
    free(image_data);
    free(frame_data);
    return 0;
}
