// A throw, where there are no exceptions: its text stays for the page, and the module ends.
#pragma once
#include <cstdio>

extern "C" {
inline char colonnade_refusal[256];
}

namespace colonnade {
struct Refused {
    template <class Exception> [[noreturn]] void operator=(const Exception& exception) const {
        std::snprintf(colonnade_refusal, sizeof colonnade_refusal, "%s", exception.what());
        __builtin_trap();
    }
};
} // namespace colonnade
