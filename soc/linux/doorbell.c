/* Registers in an emulated machine's memory: a doorbell in their last word, which no register has, tells the device of
 * each access, since the emulator does not. The linker puts this between the examples and their accesses to map 0 of
 * UIO
 * (--wrap, docs/soc.md); everything else of them is as on a board. */
#define _POSIX_C_SOURCE 200809L

#include <stdint.h>
#include <time.h>

enum { DOORBELL = 0xFFFC, READ = 1, WRITE = 2 };

uint32_t __real_colonnade_mmio_read(void *registers, uint32_t address);
void __real_colonnade_mmio_write(void *registers, uint32_t address, uint32_t value);
uint32_t __wrap_colonnade_mmio_read(void *registers, uint32_t address);
void __wrap_colonnade_mmio_write(void *registers, uint32_t address, uint32_t value);

static void ring(void *registers, uint32_t command) {
    static const struct timespec pause = {0, 20000};
    __real_colonnade_mmio_write(registers, DOORBELL, command);
    while (__real_colonnade_mmio_read(registers, DOORBELL) != 0) nanosleep(&pause, NULL);
}

uint32_t __wrap_colonnade_mmio_read(void *registers, uint32_t address) {
    ring(registers, address | READ);
    return __real_colonnade_mmio_read(registers, address);
}

void __wrap_colonnade_mmio_write(void *registers, uint32_t address, uint32_t value) {
    __real_colonnade_mmio_write(registers, address, value);
    ring(registers, address | WRITE);
}
