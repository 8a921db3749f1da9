/* Files and errors of the examples, on every machine. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "target.h"

void target_fail(const char *what, const char *why) {
    fprintf(stderr, "%s: %s\n", what, why);
    exit(2);
}

void target_check(const char *what, enum colonnade_error error) {
    if (error != COLONNADE_OK) target_fail(what, colonnade_error_name(error));
}

size_t target_read(const char *name, void *to, size_t most) {
    FILE *file = fopen(name, "rb");
    if (file == NULL) target_fail(name, strerror(errno));
    size_t bytes = fread(to, 1, most, file);
    if (fgetc(file) != EOF) {
        char why[64];
        snprintf(why, sizeof why, "larger than the %zu bytes that it may have", most);
        target_fail(name, why);
    }
    fclose(file);
    return bytes;
}
