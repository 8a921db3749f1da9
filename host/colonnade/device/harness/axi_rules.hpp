// Rules of AXI4 and AXI4-Lite (IHI 0022) at the pins of the shell, and the report of broken ones.
#pragma once
#include <array>
#include <cstdint>
#include <iostream>
#include <map>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

/// Broken rules by name: how often, and where for the first time.
class Report {
public:
    void require(bool holds, const std::string& port, const char* rule) {
        if (!holds) broken(port + ": " + rule);
    }

    void broken(const std::string& rule) {
        Break& entry = breaks_[rule];
        if (entry.count++ == 0) entry.first = place + ", cycle " + std::to_string(cycle);
        ++count;
    }

    void print() const {
        for (const auto& [rule, entry] : breaks_)
            std::cout << "broken " << rule << " (" << entry.count << " times, first in " << entry.first << ")\n";
    }

    std::string place;
    std::uint64_t cycle = 0, count = 0;

private:
    struct Break {
        std::uint64_t count = 0;
        std::string first;
    };
    std::map<std::string, Break> breaks_;
};

/// An address of a burst.
struct Address {
    std::uint64_t address = 0;
    unsigned length = 0, size = 0, burst = 0, id = 0, protection = 0;

    bool operator==(const Address& o) const {
        return std::tie(address, length, size, burst, id, protection) ==
               std::tie(o.address, o.length, o.size, o.burst, o.id, o.protection);
    }
    unsigned beats() const { return length + 1; }
    /// Of the bytes of all beats: only the first beat of a burst may begin within a word of the bus.
    std::uint64_t first() const { return address >> size << size; }
    std::uint64_t end() const { return first() + (std::uint64_t{beats()} << size); }
};

/// A beat of a write.
struct WriteBeat {
    std::array<std::uint8_t, 128> data{};
    std::array<std::uint8_t, 16> strobes{};
    bool isLast = false;

    bool operator==(const WriteBeat& o) const { return data == o.data && strobes == o.strobes && isLast == o.isLast; }
    bool writes(unsigned byte) const { return strobes[byte / 8] >> byte % 8 & 1; }
};

/// A channel that the shell drives: what is offered holds until it is taken (A3.2.1).
template <class Payload> class Channel {
public:
    Channel(Report& report, std::string name) : report_(report), name_(std::move(name)) {}

    /// Looks at a cycle; whether the payload is transferred in it.
    bool transfers(bool valid, bool ready, const Payload& payload) {
        if (isOffered_) {
            report_.require(valid, name_, "VALID falls before READY");
            report_.require(!valid || payload == offered_, name_, "the payload changes before READY");
        }
        isOffered_ = valid && !ready;
        if (isOffered_) offered_ = payload;
        return valid && ready;
    }

    void reset() { isOffered_ = false; }

private:
    Report& report_;
    std::string name_;
    Payload offered_{};
    bool isOffered_ = false;
};

/// Ranges of byte addresses, each from its first address to the one behind its last.
using Windows = std::vector<std::pair<std::uint64_t, std::uint64_t>>;

inline bool isInside(const Windows& windows, std::uint64_t first, std::uint64_t end) {
    for (const auto& window : windows)
        if (first >= window.first && end <= window.second) return true;
    return false;
}

/// The rules of a burst: what all of AXI4 demands, and what the shell documents beyond that.
inline void requireLegal(Report& report, const std::string& port, const Address& burst, unsigned busBytes) {
    report.require(burst.address / 4096 == (burst.end() - 1) / 4096, port, "a burst crosses 4 KB");
    report.require(burst.burst == 1, port, "a burst is not INCR");
    report.require(1u << burst.size == busBytes, port, "beats are not as wide as the bus");
    report.require(burst.end() <= std::uint64_t{1} << 40, port, "a burst leaves the addresses of 40 bits");
    report.require(burst.protection == 2, port, "the protection is not data, unprivileged and non-secure");
}
