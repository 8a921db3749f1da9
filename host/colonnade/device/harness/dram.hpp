// A model of DRAM behind the device's AXI4 read port, for designs with a cache (DRAM_BUS_BYTES).
//
// Reads take `latency` cycles, with `banks` also rows and refresh (dram_timing.hpp), then deliver a beat per cycle,
// or every `interval` cycles, in the order of the reads. With `randomPercent`, addresses and beats are refused or
// withheld in that share of the cycles, and reads of different ids overtake each other. A read beyond the scene is
// answered with DECERR. Two failures end with the first frame: with `errorsPer1024`, so many of 1024 beats are answered
// with SLVERR; with `silentAfter`, reads are answered no more after so many.
#pragma once
#include <cstdint>
#include <cstring>
#include <deque>
#include <random>
#include <stdexcept>
#include <vector>

#include "dram_timing.hpp"

struct DramOptions {
    unsigned latency = 100, randomPercent = 0, errorsPer1024 = 0, silentAfter = 0, seed = 1, interval = 1, banks = 0;
};

#ifdef DRAM_BUS_BYTES
/// Layout of the scene: lines of `lineRecords` records at a pitch of `linePitch` bytes, from address 0.
template <class Top, class Bytes = std::vector<unsigned char>> class Dram {
public:
    Dram(Top& top, const DramOptions& options) : Dram(top, options, own_) {}

    /// A DRAM whose content is `memory`, which others may change.
    Dram(Top& top, const DramOptions& options, Bytes& memory)
        : top_(top), options_(options), timing_(dramTiming(options.banks, options.latency)), random_(options.seed),
          memory_(memory) {}

    /// Writes a record, as the host would.
    void store(std::uint64_t address, const void* record, std::size_t bytes) {
        const std::uint64_t at = address / DRAM_LINE_RECORDS * DRAM_LINE_PITCH + address % DRAM_LINE_RECORDS * bytes;
        if (memory_.size() < at + DRAM_LINE_PITCH)
            memory_.resize((at / (2 * DRAM_LINE_PITCH) + 2) * 2 * DRAM_LINE_PITCH); // whole pairs of lines
        std::memcpy(&memory_[at], record, bytes);
    }

    /// Sets the inputs of the port for this cycle, before the device settles.
    void offer() {
        top_.io_memory_ar_ready = !stalls();
        if (!offers_) choose();
        top_.io_memory_r_valid = offers_;
        if (!offers_) return;
        const Read& read = reads_[chosen_];
        unsigned char data[DRAM_BUS_BYTES] = {};
        const std::uint64_t at = read.address + read.sent * DRAM_BUS_BYTES;
        const bool isInside = at + DRAM_BUS_BYTES <= memory_.size();
        if (isInside) std::memcpy(data, &memory_[at], sizeof data);
        std::memcpy(&top_.io_memory_r_bits_data, data, sizeof data);
        top_.io_memory_r_bits_id = read.id;
        top_.io_memory_r_bits_last = read.sent + 1 == read.beats;
        top_.io_memory_r_bits_resp = !isInside ? 3 : fails_ ? 2 : 0;
    }

    /// Takes the transfers of this cycle, after the device has settled.
    void take() {
        ++now_;
        if (top_.io_memory_r_valid && top_.io_memory_r_ready) {
            offers_ = false;
            ++beats_;
            next_ = now_ + options_.interval - 1;
            if (++reads_[chosen_].sent == reads_[chosen_].beats) {
                reads_.erase(reads_.begin() + static_cast<std::ptrdiff_t>(chosen_));
                ++answered_;
            }
        }
        if (!top_.io_memory_ar_valid || !top_.io_memory_ar_ready) return;
        const std::uint64_t address = top_.io_memory_ar_bits_addr;
        const unsigned length = (top_.io_memory_ar_bits_len + 1u) << top_.io_memory_ar_bits_size;
        if (address / 4096 != (address + length - 1) / 4096) throw std::runtime_error("a burst crosses a page of 4 KB");
        reads_.push_back({address, timing_->due(now_, address, length), top_.io_memory_ar_bits_len + 1u, 0,
                          static_cast<unsigned>(top_.io_memory_ar_bits_id)});
    }

    /// Beats that the port has moved.
    std::uint64_t beats() const { return beats_; }

    /// From now on no read fails.
    void stopFailing() { options_.errorsPer1024 = options_.silentAfter = 0; }

    /// From now on so many of 1024 beats fail.
    void fail(unsigned errorsPer1024) { options_.errorsPer1024 = errorsPer1024; }

private:
    struct Read {
        std::uint64_t address, due;
        unsigned beats, sent, id;
    };

    bool stalls() { return options_.randomPercent != 0 && random_() % 100 < options_.randomPercent; }

    /// Chooses the read whose next beat is offered: the oldest, or any that is the oldest of its id.
    void choose() {
        if (options_.silentAfter != 0 && answered_ >= options_.silentAfter) return;
        if (now_ < next_) return;
        std::vector<std::size_t> candidates;
        bool isSeen[256] = {};
        for (std::size_t i = 0; i < reads_.size(); ++i) {
            if (isSeen[reads_[i].id & 255]) continue;
            isSeen[reads_[i].id & 255] = true;
            if (reads_[i].due <= now_) candidates.push_back(i);
            if (options_.randomPercent == 0) break;
        }
        if (candidates.empty() || stalls()) return;
        chosen_ = candidates[options_.randomPercent == 0 ? 0 : random_() % candidates.size()];
        fails_ = options_.errorsPer1024 != 0 && random_() % 1024 < options_.errorsPer1024;
        offers_ = true;
    }

    Top& top_;
    DramOptions options_;
    std::unique_ptr<DramTiming> timing_;
    std::mt19937 random_;
    Bytes own_;
    Bytes& memory_;
    std::deque<Read> reads_;
    std::size_t chosen_ = 0;
    bool offers_ = false, fails_ = false;
    std::uint64_t now_ = 0, answered_ = 0, beats_ = 0, next_ = 0;
};
#endif
