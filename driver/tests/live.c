/* The frames of a moving camera by a simulated device: maps, registers, the camera's photo.
 *
 * usage: live IMAGE FRAMES
 *
 * Of frame N, the file maps.N has new maps, or is missing; view.N is a view file, whose registers are computed here, or
 * frame.N a frame file; photo.N is the photo, XRGB8888, in lines of whole tile rows. Prints the place of each frame,
 * and the cycles of its load and of its rendering.
 *
 * Memory: image, maps and photo, each in its own pages, then framebuffers in windows of their size; a page of untouched
 * memory is around each of these. */
#include "simulator.h"

#include "colonnade_view.h"

static bool exists(const char *name) {
    FILE *file = fopen(name, "rb");
    if (file != NULL) fclose(file);
    return file != NULL;
}

static char *numbered(const char *name, long number) {
    static char text[32];
    snprintf(text, sizeof text, "%s.%ld", name, number);
    return text;
}

/* Registers of the file of a frame; its size. */
static struct colonnade_frame set_frame(struct colonnade *device, long number) {
    static struct colonnade_view view;
    struct colonnade_frame frame;
    size_t bytes;
    const bool has_poses = exists(numbered("view", number));
    void *data = read_file(numbered(has_poses ? "view" : "frame", number), &bytes);
    if (has_poses) {
        expect(colonnade_view_open(&view, &colonnade_design, data, bytes), COLONNADE_OK, "view file");
        const uint32_t capacity = colonnade_view_most_writes(&view);
        uint8_t *writes = malloc((size_t)8 * capacity);
        if (writes == NULL) fail("no memory");
        expect(colonnade_view_frame(&view, writes, capacity, &frame), COLONNADE_OK, "registers of a view");
        expect(colonnade_set_frame(device, &frame), COLONNADE_OK, "set a view");
        colonnade_view_accept(&view);
        free(writes);
    } else {
        expect(colonnade_open_frame(&colonnade_design, data, bytes, &frame), COLONNADE_OK, "frame file");
        expect(colonnade_set_frame(device, &frame), COLONNADE_OK, "set frame");
    }
    free(data);
    return frame;
}

/* Stores a file at a place and returns the end of its pages. */
static uint64_t store(const char *name, uint64_t place, size_t *bytes) {
    free(read_file(name, bytes));
    printf("store %s %" PRIu64 "\n", name, place);
    return place + pages(*bytes);
}

int main(int argc, char **argv) {
    static const struct colonnade_bus bus = {bus_read, bus_write, bus_wait, NULL};
    if (argc != 3) fail("usage");
    waits_for_interrupt = true;
    struct colonnade device;
    expect(colonnade_probe(&device, &bus, &colonnade_design), COLONNADE_OK, "probe");
    size_t bytes;
    const uint64_t maps_place = store(argv[1], 0, &bytes), photo_place = maps_place + pages(bytes);
    struct colonnade_image image = {NULL, (uint32_t)bytes, 0, {0, bytes}};
    expect(colonnade_load(&device, &image, ATTEMPTS), COLONNADE_OK, "load");

    uint64_t place = 0;
    for (long number = 0; number < strtol(argv[2], NULL, 10); ++number) {
        waited = 0;
        if (exists(numbered("maps", number))) {
            if (store(numbered("maps", number), maps_place, &bytes) > photo_place) fail("maps larger than the image");
            void *data = read_file(numbered("maps", number), &bytes);
            image = (struct colonnade_image){data, (uint32_t)bytes, maps_place, {maps_place, maps_place + bytes}};
            expect(colonnade_load_maps(&device, &image, ATTEMPTS), COLONNADE_OK, "load maps");
            free(data);
        }
        const uint64_t loading = waited;
        const struct colonnade_frame frame = set_frame(&device, number);
        const uint64_t end = store(numbered("photo", number), photo_place, &bytes);
        const uint32_t stride = (uint32_t)(bytes / frame.height);
        const struct colonnade_photo photo = {photo_place, stride, {photo_place, photo_place + bytes}, true};
        expect(colonnade_set_photo(&device, &photo), COLONNADE_OK, "set photo");
        if (place == 0) place = end + PAGE;
        const struct colonnade_framebuffer framebuffer = {place, stride, COLONNADE_XRGB8888, {place, place + bytes}};
        waited = 0;
        expect(colonnade_start(&device, &framebuffer), COLONNADE_OK, "start");
        expect(colonnade_wait(&device, COLONNADE_FRAME_DONE, ATTEMPTS), COLONNADE_OK, "a frame");
        colonnade_acknowledge(&device, COLONNADE_FRAME_DONE | COLONNADE_ERROR);
        expect(colonnade_result(&device), COLONNADE_OK, "a frame");
        fprintf(stderr, "frame %" PRIu64 " %" PRIu32 " load %" PRIu64 " render %" PRIu64 "\n", place, stride, loading,
                waited);
        place += pages(bytes) + PAGE;
    }
    printf("dump memory 0 %" PRIu64 "\n", place);
    return 0;
}
