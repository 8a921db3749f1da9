// SPDX-License-Identifier: Apache-2.0
/// Writes words of tiles into a heap. Equal words are stored once.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

namespace colonnade::live {

class HeapWriter {
public:
    explicit HeapWriter(int words) : heap_(words), sequences_(slots) {}

    void clear() {
        std::fill(heap_.begin(), heap_.end(), std::uint16_t{0});
        std::fill(sequences_.begin(), sequences_.end(), Sequence{0, 0});
        used_ = 0;
    }

    /// The address of words, stored now if no equal ones are; -1 if they do not fit.
    int put(const std::uint16_t* words, int count) {
        std::uint32_t hash = 2166136261u;
        for (int i = 0; i < count; ++i) hash = (hash ^ words[i]) * 16777619u ^ hash >> 15;
        std::uint32_t slot = hash % slots;
        for (; sequences_[slot].count != 0; slot = (slot + 1) % slots) {
            const Sequence& sequence = sequences_[slot];
            if (sequence.count == count && std::equal(words, words + count, heap_.begin() + sequence.address)) return sequence.address;
        }
        if (used_ + count > static_cast<int>(heap_.size())) return -1;
        std::copy(words, words + count, heap_.begin() + used_);
        sequences_[slot] = {used_, count};
        used_ += count;
        return sequences_[slot].address;
    }

    int used() const { return used_; }
    const std::vector<std::uint16_t>& words() const { return heap_; }

private:
    struct Sequence {
        int address, count;
    };
    /// More than the sequences that 13 bits of address can name.
    static constexpr std::uint32_t slots = 1 << 14;

    std::vector<std::uint16_t> heap_;
    std::vector<Sequence> sequences_;
    int used_ = 0;
};

} // namespace colonnade::live
