// Registers of a device for rays: what a scene sets, and sums of the counters.
#pragma once
#include <algorithm>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "colonnade_rays.h"

namespace colonnade::rays {

using RegisterValues = std::map<std::string, std::int64_t>;

/// The registers that a scene sets.
inline RegisterValues registersOf(const colonnade_rays_image& image) {
    RegisterValues values{{"placement.mantissa", image.scale_mantissa},
                          {"placement.exponent", image.scale_exponent},
                          {"scene.recordCount", static_cast<std::int64_t>(image.record_count)}};
    for (int a = 0; a < 3; ++a) {
        const std::string axis = std::string(".") + "xyz"[a];
        values["bounds.low" + axis] = image.bounds_low[a];
        values["bounds.high" + axis] = image.bounds_high[a];
        values["placement.base" + axis] = image.base[a];
    }
    return values;
}

/// The library's sums of a device's counters.
inline colonnade_rays_sums sumsOf(const RegisterValues& counters) {
    const auto of = [&](const char* name) { return static_cast<std::uint64_t>(counters.at(name)); };
    return {of("rays"),     of("raysRefused"),   of("raysInBox"),   of("nodeReads"),
            of("boxTests"), of("triangleTests"), of("deepestStack")};
}

class DeviceRegisters {
public:
    /// Lines "register NAME ADDRESS BITS SIGNED ACCESS". Throws std::invalid_argument for another one.
    explicit DeviceRegisters(const std::string& text) {
        std::istringstream lines(text);
        for (std::string line; std::getline(lines, line);) {
            std::istringstream words(line);
            std::string kind, name;
            Register one{};
            if (!(words >> kind >> name >> one.address >> one.bits >> one.isSigned >> one.access) || kind != "register")
                throw std::invalid_argument("this line is no register: " + line);
            registers_[name] = one;
        }
    }

    std::uint32_t addressOf(const std::string& name) const {
        const auto found = registers_.find(name);
        if (found == registers_.end()) throw std::invalid_argument("the device has no register " + name);
        return found->second.address;
    }

    /// The writes of a scene, address and word: all registers that a host sets, 0 without a value, and commands last.
    std::vector<std::pair<std::uint32_t, std::uint32_t>> writesOf(const RegisterValues& values) const {
        std::vector<std::pair<std::uint32_t, std::uint32_t>> writes;
        for (const auto& [name, value] : values) addressOf(name);
        for (const auto& [name, one] : registers_) {
            const auto found = values.find(name);
            if (one.access == "rw" || found != values.end())
                append(writes, name, one, found == values.end() ? 0 : found->second);
        }
        for (const char* const command : {"control.invalidate", "control.start"})
            if (registers_.count(command)) append(writes, command, registers_.at(command), 1);
        return writes;
    }

    /// Counters since the device was opened. `read` reads the word at an address.
    template <class Read> RegisterValues sums(const Read& read) const {
        RegisterValues sums;
        for (const auto& [name, one] : registers_) {
            if (name.rfind(prefix, 0) != 0) continue;
            std::uint64_t value = 0;
            for (unsigned word = 0; word < wordsOf(one); ++word)
                value |= static_cast<std::uint64_t>(read(one.address + word)) << 32 * word;
            const std::string counter = name.substr(prefix.size());
            const auto found = before_.find(counter);
            const std::int64_t before = found == before_.end() ? 0 : found->second,
                               now = static_cast<std::int64_t>(value);
            sums[counter] = counter == "deepestStack" ? std::max(before, now) : before + now;
        }
        return sums;
    }

    /// Keeps the sums before a scene is loaded: then the device's counters begin at 0.
    template <class Read> void keepSums(const Read& read) { before_ = sums(read); }

private:
    struct Register {
        std::uint32_t address;
        unsigned bits;
        bool isSigned;
        std::string access;
    };
    const std::string prefix = "counters.";

    static unsigned wordsOf(const Register& one) { return (one.bits + 31) / 32; }

    static void append(std::vector<std::pair<std::uint32_t, std::uint32_t>>& writes, const std::string& name,
                       const Register& one, std::int64_t value) {
        const unsigned magnitude = one.bits - one.isSigned;
        const bool fits = one.isSigned ? magnitude >= 63 || (value >> magnitude == 0 || value >> magnitude == -1)
                                       : value >= 0 && (magnitude >= 63 || value >> magnitude == 0);
        if (!fits)
            throw std::invalid_argument("register " + name + ": " + std::to_string(value) + " does not fit " +
                                        std::to_string(one.bits) + " bits");
        const std::uint64_t raw = one.bits >= 64
                                      ? static_cast<std::uint64_t>(value)
                                      : static_cast<std::uint64_t>(value) & ((std::uint64_t{1} << one.bits) - 1);
        for (unsigned word = 0; word < wordsOf(one); ++word)
            writes.emplace_back(one.address + word, static_cast<std::uint32_t>(raw >> 32 * word));
    }

    std::map<std::string, Register> registers_;
    RegisterValues before_;
};

} // namespace colonnade::rays
