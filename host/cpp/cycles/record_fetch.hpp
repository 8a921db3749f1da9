// unit/RecordFetch.scala and its parts: record buffers with miss handling and snooping.
#pragma once
#include "common.hpp"
#include "design.hpp"

namespace colonnade::cycles {

/// A record on the broadcast of a bank, or the answer that it comes later.
struct Broadcast {
    std::uint32_t address;
    int row;
    bool isValid, isLater;
};

using Broadcasts = std::array<Broadcast, 4>;

enum class RecordKind : std::uint8_t { node, leaf, colours };

class RecordFetch {
public:
    /// A context that gets its record, or -1.
    struct Grant {
        int context = -1;
        RecordKind kind = RecordKind::node;
    };

    RecordFetch(const Design& design, int row, int contexts, int buffers)
        : snooping_(design.snooping), row_(row), contexts_(contexts), buffers_(buffers) {
        all_ = static_cast<std::uint32_t>((1 << buffers) - 1);
    }

    bool isIdle() const { return (pending_ | hasRecord_) == 0 && reserved_ == 0; }
    bool waitsForTriangles() const { return (hasRecord_ & ofKind_[1]) != 0; }
    std::uint32_t pending() const { return pending_; }
    std::uint32_t ready() const { return hasRecord_; }
    std::uint64_t snoopHits = 0;

    /// A cycle, up to the request and the grant. `readyNext`: kinds whose unit source a record in the next cycle.
    Grant step(const Broadcasts& broadcasts, int banks, std::array<bool, 3> readyNext) {
        // Lookup of new fetches
        std::uint32_t hits = 0, used = 0, present = 0;
        std::array<std::uint8_t, 16> hitBuffer;
        for (std::uint32_t rest = snooping_ ? new_ & pending_ : 0; rest; rest &= rest - 1) {
            const auto context = static_cast<std::size_t>(__builtin_ctz(rest));
            for (int k = 0; k < buffers_; ++k) {
                if (!((full_ | reserved_) >> k & 1) || bufferAddress_[static_cast<std::size_t>(k)] != address_[context])
                    continue;
                present |= 1u << context;
                if (full_ >> k & 1) {
                    used |= 1u << k;
                    if (!(hits >> context & 1)) hitBuffer[context] = static_cast<std::uint8_t>(k);
                    hits |= 1u << context;
                }
            }
        }
        new_ = 0;
        for (std::uint32_t rest = hasRecord_; rest; rest &= rest - 1)
            used |= 1u << buffer_[static_cast<std::size_t>(__builtin_ctz(rest))];
        std::uint32_t available = all_ & ~reserved_ & ~(full_ & used);

        // Fill
        std::uint32_t found = hits, comes = 0;
        std::uint32_t filled = 0;
        std::array<std::uint32_t, 8> filledAddress;
        std::array<std::uint8_t, 16> source;
        for (std::uint32_t rest = hits; rest; rest &= rest - 1)
            source[static_cast<std::size_t>(__builtin_ctz(rest))] =
                hitBuffer[static_cast<std::size_t>(__builtin_ctz(rest))];
        std::uint32_t emptied = 0, awaiters = 0, retriers = 0;
        for (int bank = 0; bank < banks; ++bank) {
            const Broadcast& broadcast = broadcasts[static_cast<std::size_t>(bank)];
            if (!broadcast.isValid) continue;
            std::uint32_t waiters = 0;
            for (std::uint32_t rest = pending_; rest; rest &= rest - 1)
                if (address_[static_cast<std::size_t>(__builtin_ctz(rest))] == broadcast.address)
                    waiters |= rest & -rest;
            comes |= waiters;
            std::uint32_t awaiting = 0;
            for (std::uint32_t rest = reserved_; rest; rest &= rest - 1)
                if (bufferAddress_[static_cast<std::size_t>(__builtin_ctz(rest))] == broadcast.address)
                    awaiting |= rest & -rest;
            if (broadcast.isLater) {
                const bool isPinned = (awaiting & pinned_) != 0;
                emptied |= awaiting & ~pinned_;
                if (!isPinned) awaiters |= waiters;
                continue;
            }
            if (!snooping_ && broadcast.row != row_) continue;
            int slot = -1;
            if (awaiting) slot = __builtin_ctz(awaiting);
            else if (snooping_ && available) {
                slot = __builtin_ctz(available);
                if ((waiters & ~hits) == 0) slot = waiters ? slot : -1;
                else available &= ~(1u << slot);
            }
            const bool isTaken = slot >= 0 && (awaiting || (waiters & ~hits) != 0);
            if (isTaken) {
                filled |= 1u << slot;
                filledAddress[static_cast<std::size_t>(slot)] = broadcast.address;
            }
            if (slot >= 0) {
                const std::uint32_t taken = (snooping_ ? waiters : waiters & issued_) & ~found;
                for (std::uint32_t rest = taken; rest; rest &= rest - 1)
                    source[static_cast<std::size_t>(__builtin_ctz(rest))] = static_cast<std::uint8_t>(slot);
                found |= taken;
            }
            retriers |= waiters & ~found;
        }

        // Miss
        const std::uint32_t expected = snooping_ ? expected_ | present : issued_;
        const std::uint32_t missing = pending_ & ~expected & ~awaitsFill_;
        request_ = missing ? __builtin_ctz(missing) : -1;
        if (request_ >= 0 && (available == 0 || (snooping_ && (comes >> request_ & 1)))) request_ = -1;
        slot_ = available ? __builtin_ctz(available) : -1;
        expected_ = expected;

        // Grant
        const std::uint32_t ready = hasRecord_ | hits;
        Grant grant;
        for (const RecordKind kind : {RecordKind::leaf, RecordKind::colours, RecordKind::node}) {
            const std::uint32_t of = ready & ofKind_[static_cast<std::size_t>(kind)];
            if (!of || !readyNext[static_cast<std::size_t>(kind)]) continue;
            grant = {__builtin_ctz(of), kind};
            break;
        }

        // Registers
        full_ |= filled;
        reserved_ &= ~filled & ~emptied;
        for (std::uint32_t rest = filled; rest; rest &= rest - 1)
            bufferAddress_[static_cast<std::size_t>(__builtin_ctz(rest))] =
                filledAddress[static_cast<std::size_t>(__builtin_ctz(rest))];
        for (std::uint32_t rest = found; rest; rest &= rest - 1) {
            const auto context = static_cast<std::size_t>(__builtin_ctz(rest));
            buffer_[context] = source[context];
            snoopHits += !(issued_ >> context & 1);
        }
        pending_ &= ~found;
        hasRecord_ |= found;
        awaiters &= ~found;
        awaitsFill_ = (awaitsFill_ | awaiters) & ~retriers;
        expected_ &= ~awaiters;
        retries_ |= retriers;
        if (grant.context >= 0) hasRecord_ &= ~(1u << grant.context);
        return grant;
    }

    /// The record that is requested in this cycle.
    bool requests() const { return request_ >= 0; }
    std::uint32_t requested() const { return address_[static_cast<std::size_t>(request_)]; }

    /// The request is accepted.
    void accept() {
        const std::uint32_t address = requested();
        for (std::uint32_t rest = pending_; rest; rest &= rest - 1)
            if (address_[static_cast<std::size_t>(__builtin_ctz(rest))] == address) expected_ |= rest & -rest;
        issued_ |= 1u << request_;
        buffer_[static_cast<std::size_t>(request_)] = static_cast<std::uint8_t>(slot_);
        const std::uint32_t slot = 1u << slot_;
        full_ &= ~slot;
        reserved_ |= slot;
        bufferAddress_[static_cast<std::size_t>(slot_)] = address;
        pinned_ = (retries_ >> request_ & 1) ? pinned_ | slot : pinned_ & ~slot;
    }

    /// A context begins a fetch, which counts from the next cycle on.
    void begin(int context, RecordKind kind, std::uint32_t address) {
        const std::uint32_t bit = 1u << context;
        pending_ |= bit;
        new_ |= bit;
        issued_ &= ~bit, expected_ &= ~bit, awaitsFill_ &= ~bit, retries_ &= ~bit;
        for (std::uint32_t& of : ofKind_) of &= ~bit;
        ofKind_[static_cast<std::size_t>(kind)] |= bit;
        address_[static_cast<std::size_t>(context)] = address;
    }

private:
    bool snooping_;
    int row_, contexts_, buffers_;
    std::uint32_t all_;
    std::uint32_t pending_ = 0, hasRecord_ = 0, issued_ = 0, expected_ = 0, awaitsFill_ = 0, retries_ = 0, new_ = 0;
    std::array<std::uint32_t, 3> ofKind_{};
    std::array<std::uint32_t, 16> address_{};
    std::array<std::uint8_t, 16> buffer_{};
    std::uint32_t full_ = 0, reserved_ = 0, pinned_ = 0;
    std::array<std::uint32_t, 8> bufferAddress_{};
    int request_ = -1, slot_ = -1;
};

} // namespace colonnade::cycles
