/* Refits by the unit of the shell against shell.c: registers, waits, and what the driver refuses.
 * Prints nothing and returns 0, or the line that failed. */
#include "check.h"
#include "colonnade_mesh.h"
#include "shell.h"

enum { HAS_REFIT = COLONNADE_SHELL__CAPABILITIES__REFIT_bm, RESETTING = 8, FRAME_ENDS = 1, REFIT_ENDS = 8 };

#define END ((uint64_t)1 << 40)
static const struct colonnade_design design = {.device_end = DEVICE_BASE + 4};
static struct shell shell;
static uint32_t polls, ends_after, errors, sleeps;

/* The unit ends after so many reads of its status. */
static uint32_t poll(void *context, uint32_t address) {
    if (address == 4 * AT(refit_status) && shell.registers[AT(refit_status)] != 0 && polls++ == ends_after)
        shell_step(&shell, REFIT_ENDS | errors << 8);
    return shell_read(context, address);
}

/* Until the interrupt, when the unit has ended; the frame that runs has ended before. */
static void sleep_until_interrupt(void *context) {
    ++sleeps;
    shell_step(context, FRAME_ENDS);
    CHECK(shell.registers[AT(interrupt_enable)] == COLONNADE_REFIT_DONE);
    shell_step(context, REFIT_ENDS);
}

static enum colonnade_error refit(struct colonnade *device, const struct colonnade_refit_job *job, uint32_t attempts,
                                  struct colonnade_refit *result) {
    polls = 0;
    const enum colonnade_error error = colonnade_refit_start(device, job);
    return error != COLONNADE_OK ? error : colonnade_refit_wait(device, attempts, result);
}

int main(void) {
    const struct colonnade_bus bus = {poll, shell_write, NULL, &shell};
    const struct colonnade_refit_job job = {0x1234567840, 0x8080, 0x9020, 5, 9, 7, 3};
    struct colonnade_refit result = {.cost = 77};
    struct colonnade device;
    shell = shell_of(&design, 3);
    CHECK(colonnade_probe(&device, &bus, &design) == COLONNADE_OK);

    /* A shell without the unit */
    CHECK(colonnade_refit_start(&device, &job) == COLONNADE_NO_REFIT && shell.writes == 0);
    CHECK(colonnade_refit_wait(&device, 1, &result) == COLONNADE_NO_REFIT && result.cost == 77);
    shell.registers[AT(capabilities)] = HAS_REFIT;
    CHECK(colonnade_probe(&device, &bus, &design) == COLONNADE_OK);

    /* Refused, without a write */
    static const struct {
        struct colonnade_refit_job job;
        enum colonnade_error error;
    } wrong[] = {
        {{0x20, 0x8080, 0x9020, 5, 9, 7, 3}, COLONNADE_MISALIGNED},
        {{0x40, 0x8090, 0x9020, 5, 9, 7, 3}, COLONNADE_MISALIGNED},
        {{0x40, 0x8080, 0x9010, 5, 9, 7, 3}, COLONNADE_MISALIGNED},
        {{(uint64_t)1 << 40, 0x8080, 0x9020, 5, 9, 7, 3}, COLONNADE_TOO_LARGE},
        {{0x40, 0x8080, (uint64_t)1 << 40, 5, 9, 7, 3}, COLONNADE_TOO_LARGE},
        {{0x40, 0x8080, 0x9020, 1 << 24, 9, 7, 3}, COLONNADE_TOO_LARGE},
        {{0x40, 0x8080, 0x9020, 5, 1 << 26, 7, 3}, COLONNADE_TOO_LARGE},
        {{0x40, 0x8080, 0x9020, 5, 9, 1 << 24, 3}, COLONNADE_TOO_LARGE},
        {{0x40, 0x8080, 0x9020, 5, 9, 7, 1 << 24}, COLONNADE_TOO_LARGE},
        /* The last of them behind the last address */
        {{END - 64, 0x8080, 0x9020, 5, 9, 7, 3}, COLONNADE_TOO_LARGE},
        {{0x40, END - 2 * 64, 0x9020, 5, 9, 7, 3}, COLONNADE_TOO_LARGE},
        {{0x40, 0x8080, END - 6 * 32, 5, 9, 7, 3}, COLONNADE_TOO_LARGE},
    };
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; ++i)
        CHECK(colonnade_refit_start(&device, &wrong[i].job) == wrong[i].error && shell.writes == 0);
    shell.registers[AT(status)] = RESETTING;
    CHECK(colonnade_refit_start(&device, &job) == COLONNADE_BUSY && shell.writes == 0);
    shell.registers[AT(status)] = 1; /* a frame runs */

    /* One that ends */
    shell.registers[AT(refit_bounds_0)] = 11;
    shell.registers[AT(refit_bounds_0) + 5] = 65535;
    shell.registers[AT(refit_flatPairs)] = 4;
    ends_after = 3;
    CHECK(refit(&device, &job, 3, &result) == COLONNADE_OK);
    CHECK(result.low[0] == 11 && result.high[2] == 65535 && result.flat_pairs == 4 && result.cost == 0);
    const uint32_t *registers = shell.registers;
    CHECK(registers[AT(refit_plan_low)] == 0x34567840 && registers[AT(refit_plan_high)] == 0x12);
    CHECK(registers[AT(refit_vertices_low)] == 0x8080 && registers[AT(refit_records_low)] == 0x9020);
    CHECK(registers[AT(refit_entries)] == 5 && registers[AT(refit_lines)] == 3);
    CHECK(registers[AT(refit_count)] == 7 && registers[AT(refit_root)] == 3);

    const struct colonnade_refit_job last = {END - 128, END - 3 * 64, END - 7 * 32, 5, 9, 7, 3};
    CHECK(refit(&device, &last, 3, &result) == COLONNADE_OK);

    /* One that does not end in time, and what comes meanwhile and after */
    CHECK(refit(&device, &job, 2, &result) == COLONNADE_TIMEOUT);
    const uint32_t writes = shell.writes;
    ends_after = UINT32_MAX;
    CHECK(colonnade_refit_start(&device, &job) == COLONNADE_BUSY && shell.writes == writes);
    ends_after = polls;
    CHECK(colonnade_refit_wait(&device, 1, &result) == COLONNADE_OK);

    /* Errors of the unit leave the result */
    static const enum colonnade_error found[] = {COLONNADE_MISALIGNED, COLONNADE_BUS_RESPONSE, COLONNADE_OTHER_RECORDS};
    for (size_t i = 0; i < 3; ++i) {
        ends_after = 0;
        errors = 1u << i;
        result.cost = 77;
        CHECK(refit(&device, &job, 1, &result) == found[i] && result.cost == 77);
    }
    errors = 0;

    /* Shells before 1.4 lack the event, which would end no sleep */
    const struct colonnade_bus waiting = {poll, shell_write, sleep_until_interrupt, &shell};
    CHECK(colonnade_probe(&device, &waiting, &design) == COLONNADE_OK);
    ends_after = 3;
    CHECK(refit(&device, &job, 3, &result) == COLONNADE_OK && sleeps == 0);

    /* A sleep that the event ends, and not an older one. It stays, and the interrupts are those of before */
    shell.registers[AT(version)] = 1u << 16 | 4;
    CHECK(colonnade_probe(&device, &waiting, &design) == COLONNADE_OK);
    colonnade_enable_interrupts(&device, COLONNADE_FRAME_DONE);
    shell.registers[AT(interrupt_status)] = COLONNADE_REFIT_DONE;
    ends_after = UINT32_MAX;
    CHECK(refit(&device, &job, 1, &result) == COLONNADE_OK && sleeps == 1);
    CHECK(shell.registers[AT(interrupt_status)] == (COLONNADE_FRAME_DONE | COLONNADE_REFIT_DONE));
    CHECK(shell.registers[AT(interrupt_enable)] == COLONNADE_FRAME_DONE);
    CHECK(colonnade_refit_wait(&device, 0, &result) == COLONNADE_OK && sleeps == 1);
    return 0;
}
