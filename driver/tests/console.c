/* target_uio.c on a Linux of files: which displays show the device's memory, and what becomes of the console.
 *
 * usage: console BASE SIZE DISPLAYS...   a display is START:BYTES:LINE, "absent", "denied" or "unknown"; "no-console"
 *                                        and "deaf" (KDSETMODE fails) are of the machine
 *
 * Prints the line, and each mode of the console. */
#define _POSIX_C_SOURCE 200809L

#include <errno.h>
#include <fcntl.h>
#include <linux/fb.h>
#include <linux/kd.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>

static char **displays;
static int display_count;

static int is_machine(const char *what) {
    for (int i = 0; i < display_count; ++i)
        if (strcmp(displays[i], what) == 0) return 1;
    return 0;
}

enum { TERMINAL = 100 };

static int test_open(const char *name, int flags) {
    (void)flags;
    if (strcmp(name, "/dev/tty0") == 0) return TERMINAL;
    const int number = atoi(name + strlen("/dev/fb"));
    errno = number < display_count && strcmp(displays[number], "denied") == 0 ? EACCES : ENOENT;
    return errno == EACCES || number >= display_count || strcmp(displays[number], "absent") == 0 ? -1 : number;
}

static int test_close(int file) { return file < 0; }

static int test_access(const char *name, int mode) {
    (void)name, (void)mode;
    return is_machine("no-console") ? -1 : 0;
}

static int test_ioctl(int file, unsigned long request, ...) {
    va_list arguments;
    va_start(arguments, request);
    if (file == TERMINAL) {
        const int mode = va_arg(arguments, int);
        va_end(arguments);
        errno = EPERM;
        if (is_machine("deaf")) return -1;
        puts(request == KDSETMODE && mode == KD_GRAPHICS ? "graphics" : "text");
        return 0;
    }
    struct fb_fix_screeninfo *display = va_arg(arguments, struct fb_fix_screeninfo *);
    va_end(arguments);
    return sscanf(displays[file], "%lx:%x:%u", &display->smem_start, &display->smem_len, &display->line_length) == 3
               ? 0
               : -1;
}

#define open test_open
#define close test_close
#define access test_access
#define ioctl test_ioctl
#include "../examples/target_uio.c"

int main(int argc, char **argv) {
    struct target target = {.base = strtoull(argv[1], NULL, 16), .size = strtoull(argv[2], NULL, 16)};
    displays = argv + 3;
    display_count = argc - 3;
    if (is_displayed(&target)) set_console_aside();
    printf("line %u\n", target.line);
    return 0;
}
