/* The machine of driver/examples/target.h that is a simulated device: simulator.h. Its memory is the file "ram", from
 * PAGE on. A frame is dumped to "frame.N" when the next one starts, the memory at the end. */
#define _POSIX_C_SOURCE 200809L

#include "target.h"

#include <fcntl.h>
#include <sys/mman.h>

#include "colonnade_shell.h"
#include "simulator.h"

enum { MEMORY = 3 << 20, FRAME = 1 << 16 };

static void start_dumped(void *context, uint32_t address, uint32_t value) {
    static int started;
    if (address == offsetof(colonnade_shell_t, control) && value == COLONNADE_SHELL__CONTROL__START_bm && started++ > 0)
        printf("dump frame.%d %d %d\n", started - 2, PAGE, FRAME);
    bus_write(context, address, value);
}

static void dump(void) { printf("dump memory 0 %d\n", PAGE + MEMORY); }

void target_open(struct target *target, const char *device) {
    const int file = open("ram", O_RDWR);
    void *memory = mmap(NULL, MEMORY, PROT_READ | PROT_WRITE, MAP_SHARED, file, PAGE);
    if (memory == MAP_FAILED) fail("no memory");
    waits_for_interrupt = strcmp(device, "interrupt") == 0;
    *target = (struct target){{bus_read, start_dumped, bus_wait, NULL}, PAGE, MEMORY, memory, 0};
    atexit(dump);
}

uint32_t target_put(struct target *target, const char *name) {
    return (uint32_t)target_read(name, target->memory, target->size);
}
