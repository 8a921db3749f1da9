/* What programs of the simulated SoC share: the console, the time, the device with its interrupt, and the end. */
#ifndef SOC_H
#define SOC_H

#include "colonnade.h"

enum { ATTEMPTS = 1000 };

/* Prepares console, timer and interrupt, and probes the device. */
void soc_begin(struct colonnade *device);

/* Cycles since the begin. */
uint32_t soc_now(void);

/* Ends the simulation if `error` is one, and prints it. */
void soc_check(const char *what, enum colonnade_error error);

/* Prints the error, and ends the simulation. */
_Noreturn void soc_end(const char *what, enum colonnade_error error);

#endif
