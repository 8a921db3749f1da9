/* SPDX-License-Identifier: Apache-2.0 */
/* Driver of the Colonnade device in its AXI4 shell: docs/driver.md.
 *
 * It allocates nothing, uses no floating point, and keeps no state but what it is given. Pointers are the caller's,
 * and are not kept beyond the call, but for `bus` and `design` of `colonnade_probe`. What a call fills is filled when
 * it returns COLONNADE_OK, and unchanged otherwise. It makes no access that the shell would refuse. */
#ifndef COLONNADE_H
#define COLONNADE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum colonnade_error {
    COLONNADE_OK,
    COLONNADE_NO_DEVICE,       /* no Colonnade answers at this address */
    COLONNADE_UNKNOWN_VERSION, /* the shell has another major version */
    COLONNADE_OTHER_FORMAT,    /* device, image or frame file has another formatHash */
    COLONNADE_NOT_AN_IMAGE,    /* no device image, or one of another version */
    COLONNADE_NOT_A_FRAME,     /* no frame file, or one of another version */
    COLONNADE_TRUNCATED,       /* a file is shorter or longer than it says */
    COLONNADE_TOO_LARGE,       /* an image or a framebuffer leaves its window, lines overlap, a frame is larger than the
                                * device's, or a view's capacity is too small */
    COLONNADE_MISALIGNED,    /* an image's address or size is no multiple of 128, or a base or stride of no tile row */
    COLONNADE_BAD_REGISTER,  /* a frame sets a word that is no frame register, or more words than there are */
    COLONNADE_BAD_FORMAT,    /* a framebuffer's format is none of enum colonnade_format */
    COLONNADE_NO_FRAME,      /* a start without colonnade_set_frame before it */
    COLONNADE_BUSY,          /* not now: a frame is queued, an image is loading, a reset is under way, or the shell
                              * cannot take all registers before the frame that runs has ended */
    COLONNADE_TIMEOUT,       /* the event has not come */
    COLONNADE_BUS_RESPONSE,  /* the memory answered with an error */
    COLONNADE_BAD_SECTION,   /* an image has a section for a memory that the device lacks, or one that is too long */
    COLONNADE_BAD_LENGTH,    /* an image's sections do not fill it */
    COLONNADE_NO_PHOTO,      /* no photo: shell 1.0, or no environment; no strengths: a shell before 1.3 */
    COLONNADE_FRAME_INVALID, /* the device has an error bit: colonnade_device_errors */
    COLONNADE_NO_SCENE,      /* the scene lies in DRAM, and colonnade_set_scene has not said where; or it does not;
                              * or meshes that bend have no second copy */
    /* Of colonnade_view.h */
    COLONNADE_NOT_A_VIEW, /* no view file, or one of another version, or numbers that no design has */
    COLONNADE_BAD_POSE,   /* a rotation is none, or a position is beyond 2^28 metres */
    COLONNADE_BAD_LENS,   /* a focal length, a principal point or a size out of bounds */
    COLONNADE_TOO_FAR,    /* camera or light is out of the hardware's range, or the object is too small for the room */
    COLONNADE_NO_LIGHT,   /* the scene has no such light */
    COLONNADE_NO_SAMPLE,  /* no such number of passes, or no such pass */
    /* Of colonnade_mesh.h */
    COLONNADE_NOT_A_CLIP,    /* no clip file, or one of another version, or numbers that no design has */
    COLONNADE_OUTSIDE,       /* a vertex leaves the object's grid, or an object the world's cube */
    COLONNADE_OTHER_RECORDS, /* the records are not the clip's */
    COLONNADE_TOO_DEEP,      /* a plan needs more boxes than the unit holds */
    /* Of colonnade_batches.h */
    COLONNADE_NO_RAYS, /* the design traces no rays of applications */
    /* Of colonnade_refit_start, in colonnade_mesh.h */
    COLONNADE_NO_REFIT, /* the shell has no unit that refits */
    /* Of colonnade_instances.h */
    COLONNADE_FLAT,     /* an object's transform scales an axis to nothing */
    COLONNADE_TOO_SMALL /* an object is too small for the world */
};

/* Bits of `interrupt.status` and `interrupt.enable`. A device for rays ends batches in place of frames. */
enum {
    COLONNADE_FRAME_DONE = 1,
    COLONNADE_BATCH_DONE = 1,
    COLONNADE_IMAGE_DONE = 2,
    COLONNADE_ERROR = 4,
    COLONNADE_REFIT_DONE = 8 /* of a shell that refits, from version 1.4 on */
};

enum { COLONNADE_MAX_MAPS = 10 };

enum colonnade_format { COLONNADE_XRGB8888, COLONNADE_RGB565, COLONNADE_LINEAR16 };

/* Access to the registers, at byte addresses from 0 to 0xFFFF. Accesses take effect in the order of the calls. */
struct colonnade_bus {
    uint32_t (*read)(void *context, uint32_t address);
    void (*write)(void *context, uint32_t address, uint32_t value);
    /* Sleeps until the interrupt or for a while; NULL: the driver polls without a pause. Each call is an attempt. The
     * driver has enabled the events that it waits for, and no others. A handler of the program's own may disable them
     * all, and acknowledges none. A `wait` without a limit of its own does not return from a device that hangs. */
    void (*wait)(void *context);
    void *context;
};

/* A memory: at most `records` records, each of `words` words of 32 bits in an image. */
struct colonnade_memory {
    uint32_t words, records;
};

/* One design, as the generated colonnade_design.h describes it. */
struct colonnade_design {
    uint32_t format_hash[8];
    uint32_t device_end;      /* byte address behind the device's registers */
    uint32_t frame_registers; /* byte address of the first frame register; all up to device_end are such */
    uint32_t errors;          /* byte address of the first error bit, each in a word of its own */
    uint32_t error_count;
    uint32_t counters; /* byte address of the first counter, each in two words */
    uint32_t counter_count;
    uint32_t tile_size;     /* pixels */
    uint32_t posted_writes; /* writes to the device's registers that the shell takes while a frame runs */
    uint32_t scene_page;    /* byte address of `dram.page` and of `control.invalidate`; 0 if no scene lies in DRAM */
    uint32_t invalidate;
    uint32_t rays_tail, rays_head;           /* of a device for rays, like the next ones; 0: it has frames */
    uint32_t bounds, scene, placement, ring; /* first words of these groups; `scene` also with a scene in DRAM */
    uint32_t map_count;                      /* memories of a room's maps; 0: the device has no room */
    struct colonnade_memory maps[COLONNADE_MAX_MAPS]; /* an image's section for maps[i] has the target i + 1 */
};

struct colonnade {
    const struct colonnade_bus *bus;
    const struct colonnade_design *design;
    uint32_t capabilities;
    uint32_t events; /* that the shell has */
    uint32_t max_width, max_height;
    uint32_t width, height; /* of the frame that is set; 0: none */
    uint32_t space;         /* writes to the device's registers that the shell still takes while this frame runs */
    bool has_scene;
    uint64_t scene; /* address of the records in DRAM */
};

/* Bus addresses from `base` up to, and without, `end`. */
struct colonnade_window {
    uint64_t base, end;
};

/* A device image, which `colonnade pack --device-image` or `--maps-image` writes.
 * `data` is where the processor sees it; NULL if it does not: the device alone checks the image then. */
struct colonnade_image {
    const void *data;
    uint32_t bytes;
    uint64_t address;
    struct colonnade_window window;
};

/* The registers of a frame, in a file that `colonnade pack --frame-file` writes. */
struct colonnade_frame {
    const uint8_t *writes; /* pairs of words: word address behind the device's base, value */
    uint32_t count;
    uint32_t width, height;
};

struct colonnade_framebuffer {
    uint64_t base;
    uint32_t stride; /* bytes */
    enum colonnade_format format;
    struct colonnade_window window;
};

/* The camera's photo, XRGB8888 in sRGB, as large as the frame. Base and stride are multiples of 4 * tile_size bytes. */
struct colonnade_photo {
    uint64_t base;
    uint32_t stride; /* bytes */
    struct colonnade_window window;
    bool has_strengths; /* X is the strength of the object's shadow, 255 a whole one; otherwise all are whole */
};

/* Finds out whether the device is the one of the design, and fills `device`. Touches nothing but read-only registers.
 * While a frame runs that another program has started, registers of the device cannot be set: COLONNADE_BUSY. */
enum colonnade_error colonnade_probe(struct colonnade *device, const struct colonnade_bus *bus,
                                     const struct colonnade_design *design);

/* Checks an image without a device: `bytes` bytes at `data`. */
enum colonnade_error colonnade_check_image(const struct colonnade_design *design, const void *data, size_t bytes);

/* Checks an image of maps without a device: all of its sections are for memories of a room's maps, and fill it. */
enum colonnade_error colonnade_check_maps(const struct colonnade_design *design, const void *data, size_t bytes);

/* Loads an image and waits for its end, as colonnade_wait does. Acknowledges imageDone and error. */
enum colonnade_error colonnade_load(struct colonnade *device, const struct colonnade_image *image, uint32_t attempts);

/* Loads the maps of another view or room, as colonnade_load does. The scene, textures and registers stay. The registers
 * of the next frame must be these maps'. An image that the processor does not see must hold maps alone. */
enum colonnade_error colonnade_load_maps(struct colonnade *device, const struct colonnade_image *image,
                                         uint32_t attempts);

/* Reads a frame file of `bytes` bytes, and fills `frame`, which points into it. */
enum colonnade_error colonnade_open_frame(const struct colonnade_design *design, const void *data, size_t bytes,
                                          struct colonnade_frame *frame);

/* Says where the records lie that `colonnade pack --dram-image` writes: a multiple of 4096. It holds for all frames
 * that are set or started from now on. Call it again, also with the same address, when the records have changed. */
enum colonnade_error colonnade_set_scene(struct colonnade *device, uint64_t address);

/* Writes the registers of a frame that colonnade_open_frame has filled, also while another one runs: at least once, and
 * again as long as the shell has space for a whole set. Writes all registers or, with an error, none. */
enum colonnade_error colonnade_set_frame(struct colonnade *device, const struct colonnade_frame *frame);

/* Chooses the photo that frames show where the object is not, from the next start on; NULL: none. Call it after
 * colonnade_set_frame. */
enum colonnade_error colonnade_set_photo(struct colonnade *device, const struct colonnade_photo *photo);

/* Starts the frame that is set; while one runs, it is queued. What the processor has written to memory before is there.
 */
enum colonnade_error colonnade_start(struct colonnade *device, const struct colonnade_framebuffer *framebuffer);

/* Waits until one of `events` has come, `attempts` polls or waits at most. It is not acknowledged. While the bus's
 * `wait` sleeps, these events alone raise the interrupt; then `interrupt.enable` is as it was before the call. */
enum colonnade_error colonnade_wait(struct colonnade *device, uint32_t events, uint32_t attempts);

/* Whether the last frame that ended is valid, and if not, why: its framebuffer's errors first, then the device's. */
enum colonnade_error colonnade_result(struct colonnade *device);

/* Clears events in `interrupt.status`; bits that the shell lacks are left out. */
void colonnade_acknowledge(struct colonnade *device, uint32_t events);

/* Chooses the events that raise the interrupt while the driver does not wait; bits that the shell lacks are left
 * out. */
void colonnade_enable_interrupts(struct colonnade *device, uint32_t events);

/* Resets the device in any state, and polls until it is idle, `attempts` times at most; the frame registers are 0 then.
 */
enum colonnade_error colonnade_reset(struct colonnade *device, uint32_t attempts);

/* A bit for each error of the last frame, bit n for number n of colonnade_design.h. */
uint32_t colonnade_device_errors(struct colonnade *device);

/* Counter number `index` of colonnade_design.h; 0 if there is none. Read it while no frame runs. */
uint64_t colonnade_counter(struct colonnade *device, uint32_t index);

/* The name of an error, such as "otherFormat". */
const char *colonnade_error_name(enum colonnade_error error);

/* Accesses of a processor that sees the registers at `context`, for `struct colonnade_bus`. */
uint32_t colonnade_mmio_read(void *context, uint32_t address);
/* Likewise, a write of 32 bits at a byte address. */
void colonnade_mmio_write(void *context, uint32_t address, uint32_t value);

#ifdef __cplusplus
}
#endif

#endif
