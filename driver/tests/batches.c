/* Batches of rays against shell.c: slots of the ring, waits, and what the driver refuses.
 * Prints nothing and returns 0, or the line that failed. */
#include "colonnade_batches.h"

#include "check.h"
#include "shell.h"

enum { TAIL = 6, HEAD = 12, FIRST = 16, RING = FIRST + 16, RUNNING = 1, COUNT = 3 };

#define WORD(word) (DEVICE_BASE + 4 * (word))

static const struct colonnade_design design = {
    .device_end = WORD(RING + 3),
    .frame_registers = WORD(FIRST),
    .posted_writes = 2,
    .rays_tail = WORD(TAIL),
    .rays_head = WORD(HEAD),
    .bounds = WORD(FIRST),
    .scene = WORD(FIRST + 6),
    .placement = WORD(FIRST + 8),
    .ring = WORD(RING),
};
static const struct colonnade_window window = {0x1000, 0x3000};
static struct shell shell;
static uint32_t sleeps, ended;

/* The device ends a batch in each sleep, `ended` in all. */
static void end_batch(void *context) {
    struct shell *of = context;
    ++sleeps;
    if (ended == 0) return;
    --ended;
    of->device[HEAD] = (of->device[HEAD] + 1) & 0xFFFF;
    of->registers[AT(interrupt_status)] |= COLONNADE_BATCH_DONE;
    if (of->device[HEAD] == of->device[TAIL]) of->registers[AT(status)] = 0;
}

int main(void) {
    const struct colonnade_bus bus = {shell_read, shell_write, end_batch, &shell};
    struct colonnade device;
    struct colonnade_ring ring;
    uint64_t slot;
    shell = shell_of(&design, 3);
    shell.device[HEAD] = shell.device[TAIL] = 0xFFFE; /* of an earlier ring */
    CHECK(colonnade_probe(&device, &bus, &design) == COLONNADE_OK);

    /* Refused, without a write */
    static const struct {
        uint64_t address;
        uint32_t size_log;
        struct colonnade_window window;
        enum colonnade_error error;
    } wrong[] = {
        {0x1020, 2, window, COLONNADE_MISALIGNED},
        {0x1040, 2, {0x1000, 0x3020}, COLONNADE_MISALIGNED},
        {0x1040, 2, {0x1020, 0x3000}, COLONNADE_MISALIGNED},
        {0x1040, 0, window, COLONNADE_TOO_LARGE},
        {0x1040, 16, window, COLONNADE_TOO_LARGE},
        {0x2F40, 2, window, COLONNADE_TOO_LARGE},
        {0x0FC0, 2, window, COLONNADE_TOO_LARGE},
        {0x1040, 2, {0x1000, (uint64_t)1 << 41}, COLONNADE_TOO_LARGE},
    };
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; ++i)
        CHECK(colonnade_open_ring(&ring, &device, wrong[i].address, wrong[i].size_log, &wrong[i].window) ==
              wrong[i].error);
    CHECK(shell.writes == 0);

    /* Where the scene lies */
    const struct colonnade_rays_image image = {NULL, 77, 32, {1, 2, 3}, {4, 5, 6}, 7, -8, {9, -10, (int64_t)11 << 32}};
    CHECK(colonnade_set_rays(&device, &image) == COLONNADE_OK);
    static const uint32_t expected[] = {1,          2, 3, 4, 5, 6, 77, 0, 7, (uint32_t)-8, 9, 0, (uint32_t)-10,
                                        0xFFFFFFFF, 0, 11};
    CHECK(memcmp(shell.device + FIRST, expected, sizeof expected) == 0 && shell.device[0] == 1);

    /* All slots but one, around the end of the ring and of the count */
    CHECK(colonnade_open_ring(&ring, &device, 0x1040, 2, &window) == COLONNADE_OK);
    CHECK(shell.device[RING] == 0x1040 && shell.device[RING + 2] == 2 &&
          shell.registers[AT(rays_windowEnd_low)] == 0x3000);
    for (uint32_t i = 0; i < COUNT; ++i) {
        CHECK(colonnade_next_batch(&ring, &slot) == COLONNADE_OK && slot == 0x1040 + 64 * ((2 + i) % 4));
        CHECK(colonnade_submit(&ring) == COLONNADE_OK && shell.device[TAIL] == ((0xFFFF + i) & 0xFFFF));
    }
    uint32_t writes = shell.writes;
    CHECK(colonnade_next_batch(&ring, &slot) == COLONNADE_BUSY && colonnade_submit(&ring) == COLONNADE_BUSY);
    CHECK(colonnade_set_rays(&device, &image) == COLONNADE_BUSY);
    CHECK(colonnade_open_ring(&ring, &device, 0x1040, 2, &window) == COLONNADE_BUSY && shell.writes == writes);

    /* One ends, and then no more: its slot is free */
    ended = 1;
    CHECK(colonnade_wait_batches(&ring, 5) == COLONNADE_TIMEOUT && sleeps == 6);
    CHECK(colonnade_next_batch(&ring, &slot) == COLONNADE_OK && slot == 0x1040 + 64);
    ended = COUNT;
    CHECK(colonnade_wait_batches(&ring, 1) == COLONNADE_OK && sleeps == 8 && ended == 1);
    CHECK(colonnade_wait_batches(&ring, 0) == COLONNADE_OK && sleeps == 8);

    /* A device of frames has no rays; one with its scene in DRAM needs a scene */
    struct colonnade_design other = design;
    other.scene_page = WORD(RING);
    device.design = &other;
    CHECK(colonnade_submit(&ring) == COLONNADE_NO_SCENE);
    other.rays_tail = 0;
    CHECK(colonnade_set_rays(&device, &image) == COLONNADE_NO_RAYS);
    CHECK(colonnade_open_ring(&ring, &device, 0x1040, 2, &window) == COLONNADE_NO_RAYS);
    return 0;
}
