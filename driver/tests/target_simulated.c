/* The machine of driver/examples/target.h that is a simulated device: simulator.h. Its memory begins at PAGE. */
#include "target.h"

#include "simulator.h"

enum { MEMORY = 1 << 21 };

static void dump(void) { printf("dump memory 0 %d\n", PAGE + MEMORY); }

void target_open(struct target *target, const char *device) {
    waits_for_interrupt = strcmp(device, "interrupt") == 0;
    *target = (struct target){{bus_read, bus_write, bus_wait, NULL}, PAGE, MEMORY, NULL, 0};
    atexit(dump);
}

uint32_t target_put(struct target *target, const char *name) {
    size_t bytes;
    free(read_file(name, &bytes));
    printf("store %s %" PRIu64 "\n", name, target->base);
    return (uint32_t)bytes;
}
