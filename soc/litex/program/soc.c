#include "soc.h"

#include <irq.h>
#include <libbase/uart.h>
#include <stdio.h>

#include <generated/csr.h>
#include <generated/mem.h>
#include <generated/soc.h>

#include "colonnade_design.h"

enum { SPINS = 1000000 };

static struct colonnade *interrupting;
static volatile bool interrupt_came;

/* The level goes with the device's own mask, which the driver sets before each wait; the event stays in
 * interrupt.status. */
static void on_interrupt(void) {
    colonnade_enable_interrupts(interrupting, 0);
    interrupt_came = true;
}

static void wait_for_interrupt(void *context) {
    (void)context;
    for (uint32_t spin = 0; !interrupt_came; ++spin)
        if (spin == SPINS) soc_end("interrupt", COLONNADE_TIMEOUT);
    interrupt_came = false;
}

uint32_t soc_now(void) {
    timer0_update_value_write(1);
    return 0xFFFFFFFFu - timer0_value_read();
}

void soc_end(const char *what, enum colonnade_error error) {
    printf("colonnade: %s: %s\n", what, colonnade_error_name(error));
    uart_sync();
    simulation_finish_write(1);
    for (;;) {}
}

void soc_check(const char *what, enum colonnade_error error) {
    if (error != COLONNADE_OK) soc_end(what, error);
}

void soc_begin(struct colonnade *device) {
    static const struct colonnade_bus bus = {colonnade_mmio_read, colonnade_mmio_write, wait_for_interrupt,
                                             (void *)COLONNADE_BASE};
    interrupting = device;
    irq_setmask(0);
    irq_setie(1);
    uart_init();
    timer0_en_write(0);
    timer0_load_write(0xFFFFFFFFu);
    timer0_en_write(1);
    irq_attach(COLONNADE_INTERRUPT, on_interrupt);
    irq_setmask(irq_getmask() | 1u << COLONNADE_INTERRUPT);
    soc_check("probe", colonnade_probe(device, &bus, &colonnade_design));
}
