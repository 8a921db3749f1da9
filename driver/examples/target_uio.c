/* Linux with UIO: map 0 is the registers, map 1 a piece of memory that the device may use. */
#define _POSIX_C_SOURCE 200809L

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <linux/fb.h>
#include <linux/kd.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>

#include "target.h"

enum { REGISTER_BYTES = 0x10000, DISPLAYS = 8 };

static struct uio {
    void *registers;
    int file;
} uio;

static int console; /* the terminal that the display shows */

static uint32_t uio_read(void *context, uint32_t address) {
    return colonnade_mmio_read(((struct uio *)context)->registers, address);
}

static void uio_write(void *context, uint32_t address, uint32_t value) {
    colonnade_mmio_write(((struct uio *)context)->registers, address, value);
}

/* The kernel has disabled the interrupt when it came: enables it, and sleeps until the next one, a tenth of a second at
 * most. */
static void uio_wait(void *context) {
    struct pollfd interrupt = {.fd = ((struct uio *)context)->file, .events = POLLIN};
    uint32_t value = 1;
    const bool is_enabled = write(interrupt.fd, &value, sizeof value) == sizeof value;
    if (!is_enabled || (poll(&interrupt, 1, 100) == 1 && read(interrupt.fd, &value, sizeof value) != sizeof value))
        target_fail("interrupt", "no UIO interrupt");
}

/* A number of /sys/class/uio/NAME/maps/map1. */
static uint64_t memory_number(const char *device, const char *what) {
    const char *name = strrchr(device, '/');
    char path[256];
    uint64_t value;
    snprintf(path, sizeof path, "/sys/class/uio/%s/maps/map1/%s", name == NULL ? device : name + 1, what);
    FILE *file = fopen(path, "r");
    if (file == NULL || fscanf(file, "%" SCNx64, &value) != 1)
        target_fail(path, "cannot be read: the device needs a second map");
    fclose(file);
    return value;
}

static void release_console(void) { ioctl(console, KDSETMODE, KD_TEXT); }

static void end(int signal) {
    release_console();
    _exit(128 + signal);
}

/* Whether a display shows a part of the memory; `line` is the display's if it begins there. colonnade.device.console is
 * the same rule in Python. */
static bool is_displayed(struct target *target) {
    bool is_shown = false;
    for (int number = 0; number < DISPLAYS; ++number) {
        struct fb_fix_screeninfo display;
        char name[32];
        snprintf(name, sizeof name, "/dev/fb%d", number);
        const int file = open(name, O_RDONLY);
        if (file < 0 && (errno == EACCES || errno == EPERM))
            target_fail(name, "cannot be opened, and may show the device's memory: run as root");
        if (file < 0) continue;
        const bool is_known = ioctl(file, FBIOGET_FSCREENINFO, &display) == 0;
        close(file);
        const uint64_t start = display.smem_start;
        if (!is_known || start >= target->base + target->size || target->base >= start + display.smem_len) continue;
        is_shown = true;
        if (start == target->base) target->line = display.line_length;
    }
    return is_shown;
}

/* Keeps the console from drawing into images and pictures until the program ends. */
static void set_console_aside(void) {
    if (access("/sys/class/tty/tty0", F_OK) != 0) return; /* a kernel without consoles on displays */
    console = open("/dev/tty0", O_RDWR);
    if (console < 0 || ioctl(console, KDSETMODE, KD_GRAPHICS) != 0) target_fail("/dev/tty0", strerror(errno));
    const struct sigaction action = {.sa_handler = end};
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
    sigaction(SIGHUP, &action, NULL);
    atexit(release_console);
}

void target_open(struct target *target, const char *device) {
    uio.file = open(device, O_RDWR);
    if (uio.file < 0) target_fail(device, strerror(errno));
    target->base = memory_number(device, "addr");
    target->size = memory_number(device, "size");
    uio.registers = mmap(NULL, REGISTER_BYTES, PROT_READ | PROT_WRITE, MAP_SHARED, uio.file, 0);
    target->memory = mmap(NULL, target->size, PROT_READ | PROT_WRITE, MAP_SHARED, uio.file, sysconf(_SC_PAGESIZE));
    if (uio.registers == MAP_FAILED || target->memory == MAP_FAILED) target_fail(device, strerror(errno));
    target->line = 0;
    if (is_displayed(target)) set_console_aside();
    target->bus = (struct colonnade_bus){uio_read, uio_write, uio_wait, &uio};
}

uint32_t target_put(struct target *target, const char *name) {
    return (uint32_t)target_read(name, target->memory, target->size);
}
