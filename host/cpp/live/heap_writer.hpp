/// Writes words of tiles into a heap. Equal words are stored once.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

namespace colonnade::live {

/// 256 bits; the first word is the lowest.
struct Pattern {
    std::uint64_t bits[4];
};

class HeapWriter {
public:
    explicit HeapWriter(int words) : heap_(words), sequences_(slots) {}

    void clear() {
        std::fill(heap_.begin(), heap_.end(), std::uint16_t{0});
        std::fill(sequences_.begin(), sequences_.end(), Sequence{0, 0});
        for (std::vector<Pattern>& patterns : patterns_) patterns.clear();
        used_ = 0;
    }

    /// The address of words, stored now if no equal ones are; -1 if they do not fit.
    int put(const std::uint16_t* words, int count) {
        std::uint32_t hash = 2166136261u;
        for (int i = 0; i < count; ++i) hash = (hash ^ words[i]) * 16777619u ^ hash >> 15;
        std::uint32_t slot = hash % slots;
        for (; sequences_[slot].count != 0; slot = (slot + 1) % slots) {
            const Sequence& sequence = sequences_[slot];
            if (sequence.count == count && std::equal(words, words + count, heap_.begin() + sequence.address))
                return sequence.address;
        }
        if (used_ + count > static_cast<int>(heap_.size())) return -1;
        std::copy(words, words + count, heap_.begin() + used_);
        sequences_[slot] = {used_, count};
        Pattern pattern{};
        for (int i = 0; i < std::min(count, 16); ++i)
            pattern.bits[i >> 2] |= static_cast<std::uint64_t>(words[i]) << (16 * i & 48);
        patterns_[count].push_back(pattern);
        used_ += count;
        return sequences_[slot].address;
    }

    /// The stored sequences of so many words, up to 16.
    const std::vector<Pattern>& patterns(int count) const { return patterns_[count]; }
    int used() const { return used_; }
    const std::vector<std::uint16_t>& words() const { return heap_; }

private:
    struct Sequence {
        int address, count;
    };
    /// More than the sequences that 13 bits of address can name.
    static constexpr std::uint32_t slots = 1 << 14;
    static constexpr int longest = 34;

    std::vector<std::uint16_t> heap_;
    std::vector<Sequence> sequences_;
    std::vector<Pattern> patterns_[longest + 1];
    int used_ = 0;
};

} // namespace colonnade::live
