#include "shell.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { RUNNING = 1, QUEUED = 2, LOADING = 4, RESETTING = 8 };
enum { START = 1, LOAD = 2, RESET = 4 };

/* When a register can be written. */
enum access { READ_ONLY, WRITE_ONLY, EVENTS, NOT_LOADING, NOT_QUEUED, WITH_ENVIRONMENT, IDLE, NOT_REFITTING };

#define WORD(name, bits, access) {offsetof(colonnade_shell_t, name), bits, access}
#define WIDE(name, access) WORD(name##_low, 32, access), WORD(name##_high, 8, access)

static const struct {
    size_t address;
    uint32_t bits;
    enum access access;
} words[] = {
    WORD(identity, 32, READ_ONLY),
    WORD(version, 32, READ_ONLY),
    WORD(capabilities, 32, READ_ONLY),
    WORD(frameSize, 32, READ_ONLY),
    WORD(formatHash_0, 32, READ_ONLY),
    WORD(formatHash_1, 32, READ_ONLY),
    WORD(formatHash_2, 32, READ_ONLY),
    WORD(formatHash_3, 32, READ_ONLY),
    WORD(formatHash_4, 32, READ_ONLY),
    WORD(formatHash_5, 32, READ_ONLY),
    WORD(formatHash_6, 32, READ_ONLY),
    WORD(formatHash_7, 32, READ_ONLY),
    WORD(control, 3, WRITE_ONLY),
    WORD(status, 4, READ_ONLY),
    WORD(interrupt_status, 4, EVENTS),
    WORD(interrupt_enable, 4, EVENTS),
    WORD(interrupt_test, 4, WRITE_ONLY),
    WORD(framebuffer_errors, 6, READ_ONLY),
    WORD(image_errors, 7, READ_ONLY),
    WIDE(framebuffer_base, NOT_QUEUED),
    WIDE(framebuffer_windowBase, NOT_QUEUED),
    WIDE(framebuffer_windowEnd, NOT_QUEUED),
    WORD(framebuffer_stride, 24, NOT_QUEUED),
    WORD(framebuffer_format, 2, NOT_QUEUED),
    WIDE(image_base, NOT_LOADING),
    WIDE(image_windowBase, NOT_LOADING),
    WIDE(image_windowEnd, NOT_LOADING),
    WORD(image_bytes, 32, NOT_LOADING),
    WIDE(photo_base, NOT_QUEUED),
    WIDE(photo_windowBase, NOT_QUEUED),
    WIDE(photo_windowEnd, NOT_QUEUED),
    WORD(photo_stride, 24, NOT_QUEUED),
    WORD(photo_enabled, 1, WITH_ENVIRONMENT),
    WORD(photo_hasStrengths, 1, NOT_QUEUED),
    WIDE(rays_windowBase, IDLE),
    WIDE(rays_windowEnd, IDLE),
    WORD(refit_control, 1, WRITE_ONLY),
    WORD(refit_status, 1, READ_ONLY),
    WORD(refit_errors, 3, READ_ONLY),
    WORD(refit_flatPairs, 24, READ_ONLY),
    WORD(refit_bounds_0, 24, READ_ONLY),
    WORD(refit_bounds_1, 24, READ_ONLY),
    WORD(refit_bounds_2, 24, READ_ONLY),
    WORD(refit_bounds_3, 24, READ_ONLY),
    WORD(refit_bounds_4, 24, READ_ONLY),
    WORD(refit_bounds_5, 24, READ_ONLY),
    WIDE(refit_plan, NOT_REFITTING),
    WIDE(refit_vertices, NOT_REFITTING),
    WIDE(refit_records, NOT_REFITTING),
    WORD(refit_entries, 24, NOT_REFITTING),
    WORD(refit_lines, 24, NOT_REFITTING),
    WORD(refit_count, 24, NOT_REFITTING),
    WORD(refit_root, 24, NOT_REFITTING),
};

static void require(bool condition, const char *what, const struct shell *shell, uint32_t address, uint32_t value) {
    if (condition) return;
    fprintf(stderr, "the shell refuses: %s; address %#x, value %#x, status %u, %u posted\n", what, (unsigned)address,
            (unsigned)value, (unsigned)shell->registers[AT(status)], (unsigned)shell->posted);
    abort();
}

static size_t find(const struct shell *shell, uint32_t address, uint32_t value) {
    size_t i = 0;
    while (i < sizeof words / sizeof *words && words[i].address != address) ++i;
    require(i < sizeof words / sizeof *words, "no register", shell, address, value);
    return i;
}

struct shell shell_of(const struct colonnade_design *design, uint32_t minor) {
    struct shell shell = {.design = design};
    shell.registers[AT(identity)] = 0x434C4E44;
    shell.registers[AT(version)] = 1u << 16 | minor;
    shell.registers[AT(frameSize)] = 480u << 16 | 640u;
    for (size_t i = 0; i < 8; ++i) shell.registers[AT(formatHash_0) + i] = design->format_hash[i];
    return shell;
}

uint32_t shell_read(void *context, uint32_t address) {
    struct shell *shell = context;
    ++shell->accesses;
    if (address >= DEVICE_BASE) {
        require(address % 4 == 0 && address < shell->design->device_end, "no register of the device", shell, address,
                0);
        return shell->device[(address - DEVICE_BASE) / 4];
    }
    require(words[find(shell, address, 0)].access != WRITE_ONLY, "a read of a write-only register", shell, address, 0);
    return shell->registers[address / 4];
}

static void command(struct shell *shell, uint32_t value) {
    uint32_t *status = &shell->registers[AT(status)];
    switch (value) {
    case START:
        require((*status & (QUEUED | LOADING | RESETTING)) == 0, "a start", shell, 4 * AT(control), value);
        break;
    case LOAD: require(*status == 0, "a load", shell, 4 * AT(control), value); break;
    default:
        require(value == RESET, "no command", shell, 4 * AT(control), value);
        memset(shell->device, 0, sizeof shell->device);
        shell->posted = 0;
    }
    if (shell->is_scripted) shell->registers[AT(interrupt_status)] |= shell->outcome;
    else if (value == RESET) *status = RESETTING;
    else *status |= value == START ? QUEUED : LOADING;
}

/* Of a device for rays: its tail while batches run, all while none does. */
static void write_rays(struct shell *shell, uint32_t address, uint32_t value) {
    uint32_t *status = &shell->registers[AT(status)];
    const bool is_tail = address == shell->design->rays_tail;
    require(is_tail || address == DEVICE_BASE || address >= shell->design->frame_registers, "no register of rays",
            shell, address, value);
    require(*status == 0 || (is_tail && *status == RUNNING), "a register of the device", shell, address, value);
    if (is_tail && value != shell->device[(shell->design->rays_head - DEVICE_BASE) / 4]) *status = RUNNING;
    shell->device[(address - DEVICE_BASE) / 4] = value;
}

static void write_device(struct shell *shell, uint32_t address, uint32_t value) {
    const struct colonnade_design *design = shell->design;
    if (design->rays_tail != 0) {
        write_rays(shell, address, value);
        return;
    }
    const uint32_t status = shell->registers[AT(status)];
    const bool invalidates = design->scene_page != 0 && address == design->invalidate;
    const bool is_frame = address >= design->frame_registers && address < design->device_end && address % 4 == 0;
    require(is_frame || invalidates, "no register of a frame", shell, address, value);
    require((status & (QUEUED | RESETTING)) == 0, "a register of the device", shell, address, value);
    if ((status & RUNNING) != 0 || shell->posted != 0)
        require(shell->posted++ < design->posted_writes, "the queue is full", shell, address, value);
    shell->device[(address - DEVICE_BASE) / 4] = value;
}

static void require_no_refit(const struct shell *shell, uint32_t address, uint32_t value) {
    const bool has_unit = (shell->registers[AT(capabilities)] & COLONNADE_SHELL__CAPABILITIES__REFIT_bm) != 0;
    const bool is_idle = (shell->registers[AT(status)] & RESETTING) == 0 && shell->registers[AT(refit_status)] == 0;
    require(has_unit && is_idle, "a register of a refit", shell, address, value);
}

static bool has_refit_event(const struct shell *shell) {
    return (shell->registers[AT(capabilities)] & COLONNADE_SHELL__CAPABILITIES__REFIT_bm) != 0 &&
           (shell->registers[AT(version)] & 0xFFFF) >= 4;
}

void shell_write(void *context, uint32_t address, uint32_t value) {
    struct shell *shell = context;
    ++shell->accesses;
    ++shell->writes;
    if (address >= DEVICE_BASE) {
        write_device(shell, address, value);
        return;
    }
    const size_t i = find(shell, address, value);
    const uint32_t status = shell->registers[AT(status)];
    const bool changes = (status & (QUEUED | RESETTING)) == 0;
    if (address == 4 * AT(photo_hasStrengths))
        require((shell->registers[AT(version)] & 0xFFFF) >= 3, "no register of this version", shell, address, value);
    require(words[i].bits == 32 || value >> words[i].bits == 0, "the value does not fit", shell, address, value);
    switch (words[i].access) {
    case READ_ONLY: require(false, "a write to a read-only register", shell, address, value); break;
    case EVENTS:
        require((value & COLONNADE_REFIT_DONE) == 0 || has_refit_event(shell), "no event", shell, address, value);
        break;
    case NOT_LOADING: require((status & LOADING) == 0, "a register of the image", shell, address, value); break;
    case WITH_ENVIRONMENT:
        require((shell->registers[AT(capabilities)] & COLONNADE_SHELL__CAPABILITIES__ENVIRONMENT_bm) != 0,
                "no environment", shell, address, value);
        require(changes, "a register of the photo", shell, address, value);
        break;
    case IDLE: require(status == 0, "a register of batches", shell, address, value); break;
    case NOT_QUEUED: require(changes, "a register of a frame", shell, address, value); break;
    case NOT_REFITTING: require_no_refit(shell, address, value); break;
    default: break;
    }
    if (address == 4 * AT(control)) command(shell, value);
    else if (address == 4 * AT(refit_control)) {
        require_no_refit(shell, address, value);
        shell->registers[AT(refit_status)] = value;
        shell->registers[AT(refit_errors)] = 0;
    } else if (address == 4 * AT(interrupt_status)) shell->registers[address / 4] &= ~value;
    else if (address == 4 * AT(interrupt_test)) shell->registers[AT(interrupt_status)] |= value;
    else shell->registers[address / 4] = value;
}

static void end(struct shell *shell, uint32_t state, uint32_t event, uint32_t *errors, uint32_t bits) {
    shell->registers[AT(status)] &= ~state;
    shell->registers[AT(interrupt_status)] |= event | (bits != 0 ? COLONNADE_ERROR : 0u);
    *errors = bits;
}

void shell_step(struct shell *shell, uint32_t events) {
    uint32_t *status = &shell->registers[AT(status)];
    if ((events & 1) != 0 && (*status & RUNNING) != 0)
        end(shell, RUNNING, COLONNADE_FRAME_DONE, &shell->registers[AT(framebuffer_errors)], events >> 8 & 0x3F);
    if ((events & 2) != 0 && (*status & LOADING) != 0)
        end(shell, LOADING, COLONNADE_IMAGE_DONE, &shell->registers[AT(image_errors)], events >> 8 & 0x7F);
    if ((events & 4) != 0) *status &= ~(uint32_t)RESETTING;
    if ((events & 8) != 0 && shell->registers[AT(refit_status)] != 0) {
        shell->registers[AT(refit_status)] = 0;
        shell->registers[AT(refit_errors)] = events >> 8 & 7;
        if (has_refit_event(shell)) shell->registers[AT(interrupt_status)] |= COLONNADE_REFIT_DONE;
    }
    if ((*status & RUNNING) == 0 && shell->posted > 0) --shell->posted;
    if (*status == QUEUED && shell->posted == 0) *status = RUNNING;
}
