/* What the tests in C require. */
#ifndef COLONNADE_TESTS_CHECK_H
#define COLONNADE_TESTS_CHECK_H

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define CHECK(condition) \
    do { \
        if (!(condition)) { \
            fprintf(stderr, "%s:%d: %s\n", strrchr("/" __FILE__, '/') + 1, __LINE__, #condition); \
            abort(); \
        } \
    } while (0)

#endif
