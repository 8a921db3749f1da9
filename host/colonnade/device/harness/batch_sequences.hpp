// Sequences of a shell for rays: batches of which many are wrong, one after the other from a ring. The legal work is a
// batch.
#pragma once
#include "sequences.hpp"

class BatchSequences final : public Sequences {
public:
    BatchSequences(const SequenceJob& job, unsigned busBytes, std::size_t memoryBytes)
        : Sequences(job, busBytes, memoryBytes) {
        kinds_ = {{"hostile batches", [this] { hostileBatches(); }},
                  {"soft resets", [this] { softResets(); }},
                  {"hard resets", [this] { hardResets(); }},
                  {"errors of the memory", [this] { errorsOfTheMemory(); }},
                  {"a silent channel", [this] { silentChannel(); }}};
    }

private:
    // Behind 4 KB of the window that wrong batches may name come the ring, tags, and memory of the rays and the hits of
    // each batch. Further 4 KB follow.
    static constexpr std::uint64_t ring_ = 0x1000, tags_ = 0x1800, scratch_ = 0x400, rays_ = 0x2000, rayBytes_ = 0x1000,
                                   hits_ = 0x22000, hitBytes_ = 0x800;
    static constexpr unsigned ringLog_ = 5, slots_ = 1u << ringLog_, rounds_ = 30;
    static constexpr std::uint32_t errorBit_ = 1u << 31, maxCount_ = 1u << 24;

    /// What is known of a batch before it runs.
    struct Expected {
        std::uint64_t hits = 0, hitEnd = 0, tagAt = 0; // of its hits: where bytes may change
        const std::vector<std::uint8_t>* bytes = nullptr;
        std::uint32_t tag = 0;
        bool hasTag = false, mayFail = false, fails = false;
    };

    std::uint64_t at(std::uint64_t offset) const { return job_.windowBegin + offset; }
    std::uint32_t wordAt(std::uint64_t address) const {
        std::uint32_t value;
        std::memcpy(&value, &slaves_.memory[address], sizeof value);
        return value;
    }
    void store(std::uint64_t address, const std::vector<std::uint8_t>& bytes) {
        std::copy(bytes.begin(), bytes.end(), slaves_.memory.begin() + static_cast<std::ptrdiff_t>(address));
    }

    /// All registers, after a load or a reset.
    void setAll() {
        write("rays.windowBase", job_.windowBegin);
        write("rays.windowEnd", job_.windowEnd);
        setDevice();
        clear();
        tail_ = read(job_.head);
    }

    /// Errors and counters.
    void clear() { write(job_.deviceStart, 1); }

    /// An address that a batch should not have: beyond the window or the addresses, at an end, misaligned.
    std::uint64_t anyAddress() {
        const std::uint64_t far = std::uint64_t{1} << (40 + pick(24));
        const std::array<std::uint64_t, 9> some{slaves_.random(),   slaves_.random() >> 24, job_.windowBegin - 64,
                                                job_.windowEnd,     job_.windowEnd - 64,    at(scratch_),
                                                at(scratch_) + far, job_.image.address,     0};
        return some[pick(some.size())] + (pick(4) == 0 ? 1u << pick(6) : 0);
    }

    /// Puts a batch into the ring, with wrong fields if it is hostile.
    Expected put(const SequenceJob::Batch& batch, unsigned slot, bool isHostile) {
        std::array<std::uint8_t, 64> words{};
        std::copy(batch.descriptor.begin(), batch.descriptor.end(), words.begin());
        const std::uint64_t own = at(rays_) + slot * rayBytes_;
        const unsigned wrong = isHostile ? 1u << pick(6) | 1u << pick(6) | 1u << pick(6) : 0;
        std::uint64_t rays = own, hits = at(hits_) + slot * hitBytes_, done = at(tags_) + 4 * slot;
        std::uint32_t count, mode;
        std::memcpy(&count, &words[16], 4);
        std::memcpy(&mode, &words[20], 4);
        if (wrong & 1) rays = anyAddress();
        if (wrong & 2) hits = anyAddress();
        if (wrong & 4) done = anyAddress();
        if (wrong & 8)
            count = std::array<std::uint32_t, 5>{0, maxCount_ + 1, 1u << 31, 1,
                                                 static_cast<std::uint32_t>(1 + pick(60))}[pick(5)];
        if (wrong & 16) mode ^= 1u << pick(32);
        if (wrong & 32)
            for (unsigned i = 24; i < 44; ++i) words[i] = static_cast<std::uint8_t>(slaves_.random());
        const std::uint32_t tag = ++number_ & ~errorBit_;
        std::memcpy(&words[0], &rays, 8);
        std::memcpy(&words[8], &hits, 8);
        std::memcpy(&words[16], &count, 4);
        std::memcpy(&words[20], &mode, 4);
        std::memcpy(&words[44], &tag, 4);
        std::memcpy(&words[48], &done, 8);
        store(own, batch.rays);
        std::copy(words.begin(), words.end(),
                  slaves_.memory.begin() + static_cast<std::ptrdiff_t>(at(ring_ + 64 * slot)));
        return expected(batch, wrong, rays, hits, done, count, mode, tag);
    }

    /// What docs/rays.md says of a batch.
    Expected expected(const SequenceJob::Batch& batch, unsigned wrong, std::uint64_t rays, std::uint64_t hits,
                      std::uint64_t done, std::uint32_t count, std::uint32_t mode, std::uint32_t tag) const {
        constexpr std::uint64_t reach = std::uint64_t{1} << 40;
        const auto fits = [this](std::uint64_t first, std::uint64_t bytes) {
            return first >= job_.windowBegin && first + (bytes + 63) / 64 * 64 <= job_.windowEnd;
        };
        const bool isSensor = mode >> 5 & 1, isFan = mode >> 4 & 1;
        const unsigned response = mode & 3;
        const bool hasPlace = rays % 64 == 0 && hits % 64 == 0 && done % 4 == 0 && (rays | hits | done) < reach;
        const bool isLegal = hasPlace && response != 3 && !(isSensor && isFan) && (mode & ~0xff000f33u) == 0 &&
                             count != 0 && count <= maxCount_;
        const std::uint64_t taken = isSensor ? 64 : std::uint64_t{count} * (isFan ? 16 : 32);
        const std::uint64_t answers =
            response == 2 ? (std::uint64_t{count} + 63) / 64 * 8 : std::uint64_t{count} * (response == 1 ? 8 : 16);
        Expected found;
        found.tag = tag;
        found.hasTag = done != 0 && done % 4 == 0 && done < reach && fits(done / 64 * 64, 4);
        found.tagAt = done;
        found.fails = !isLegal || !fits(rays, taken) || !fits(hits, answers) || (done != 0 && !found.hasTag);
        found.mayFail = found.fails || (isSensor && wrong != 0); // what it reads may be no sensor
        if (isLegal) {
            found.hits = std::min(std::max(hits, job_.windowBegin), job_.windowEnd);
            found.hitEnd = std::max(found.hits, std::min(hits + answers, job_.windowEnd));
        }
        if (wrong == 0) found.bytes = &batch.hits;
        return found;
    }

    /// Hands over `count` batches that are in the ring from `tail_` on; the device takes them, in several writes of the
    /// tail.
    void submit(unsigned count) {
        while (count != 0) {
            const unsigned some = 1 + static_cast<unsigned>(pick(count));
            tail_ = (tail_ + some) & 0xffff;
            write(job_.tail, tail_);
            count -= some;
        }
    }

    /// As many batches as the ring takes, one of `hostility` of which is right.
    std::vector<Expected> fill(unsigned hostility) {
        std::vector<Expected> found;
        for (unsigned i = 0; i + 1 < slots_; ++i)
            found.push_back(put(job_.batches[pick(job_.batches.size())], (tail_ + i) % slots_, pick(hostility) != 0));
        return found;
    }

    /// Runs as many batches as the ring takes, and checks all bytes of the memory.
    void run(bool hasErrors) {
        const std::vector<Expected> batches = fill(std::array<unsigned, 3>{2, 10, 100}[pick(3)]);
        std::vector<std::uint8_t> after = slaves_.memory;
        std::vector<bool> isOpen(after.size());
        submit(slots_ - 1);
        awaitIdle("batches do not end");
        batches_ += batches.size();
        expect(read(job_.head) == tail_, "the head of the ring is not at its tail");
        bool fails = false, mayFail = hasErrors;
        for (const Expected& each : batches) {
            fails |= each.fails;
            mayFail |= each.mayFail;
            check(each, hasErrors, after, isOpen);
        }
        for (std::size_t i = 0; i < after.size(); ++i)
            if (!isOpen[i] && after[i] != slaves_.memory[i])
                return report_.broken("a byte that belongs to no batch has changed");
        const std::uint32_t errors = read(job_.batchErrors);
        expect(!fails || errors != 0, "a wrong batch raises no error");
        expect(mayFail || errors == 0, "an error without a wrong batch");
        clear();
    }

    /// A batch that has ended: what it wrote goes to `after`, or `isOpen` has the bytes that may have any value.
    void check(const Expected& each, bool hasErrors, std::vector<std::uint8_t>& after, std::vector<bool>& isOpen) {
        std::uint32_t tag = each.tag | errorBit_;
        if (each.hasTag) {
            const std::uint32_t found = wordAt(each.tagAt);
            const bool isMissing = found != each.tag && found != (each.tag | errorBit_);
            if (!isMissing) tag = found;
            expect(!isMissing || hasErrors || isShared(each.tagAt), "a batch has no tag");
            expect(isMissing || hasErrors || !each.fails || tag != each.tag, "the tag of a wrong batch has no error");
            expect(isMissing || hasErrors || each.mayFail || tag == each.tag, "the tag of a right batch has an error");
            std::fill_n(isOpen.begin() + static_cast<std::ptrdiff_t>(each.tagAt), 4, true);
        }
        if (each.bytes && tag == each.tag)
            std::copy(each.bytes->begin(), each.bytes->end(), after.begin() + static_cast<std::ptrdiff_t>(each.hits));
        else
            std::fill(isOpen.begin() + static_cast<std::ptrdiff_t>(each.hits),
                      isOpen.begin() + static_cast<std::ptrdiff_t>(each.hitEnd), true);
    }

    /// Other wrong batches may also write there.
    bool isShared(std::uint64_t tagAt) const { return tagAt < at(tags_) || tagAt >= at(tags_) + 4 * slots_; }

    bool isRight() override {
        setAll();
        const SequenceJob::Batch& batch = job_.batches[pick(job_.batches.size())];
        write("interrupt.status", 7);
        write("interrupt.enable", 1);
        const Expected each = put(batch, tail_ % slots_, false);
        submit(1);
        awaitIdle("a batch does not end");
        ++batches_;
        expect(bench_->interrupt(), "irq is low after a batch");
        expect(bench_->isQuiet(), "a burst is under way after a batch");
        std::uint32_t errors = 0;
        for (const unsigned error : job_.errors) errors |= read(error);
        expect(errors == 0, "a right batch has an error bit");
        expect(wordAt(each.tagAt) == each.tag, "a right batch has another tag");
        const bool isSame = std::equal(batch.hits.begin(), batch.hits.end(),
                                       slaves_.memory.begin() + static_cast<std::ptrdiff_t>(each.hits));
        expect(isSame, "hits differ from the model's");
        return isSame && errors == 0;
    }

    void prepare() override {
        load();
        setAll();
    }

    void begin() override {
        fill(8);
        submit(slots_ - 1);
    }

    void count() override { batches_ += read(job_.head); }

    // The kinds of abuse

    void hostileBatches() {
        prepare();
        for (unsigned i = 0; i < rounds_; ++i) run(false);
    }

    /// A soft reset at any cycle, also in a soft reset.
    void softResets() {
        prepare();
        for (unsigned i = 0; i < rounds_; ++i) {
            begin();
            bench_->cycles(pick(pick(2) != 0 ? 200 : 4000));
            count();
            if (pick(3) == 0) {
                write("control", reset_);
                bench_->cycles(pick(30));
            }
            softReset();
            restore();
            setAll();
            run(false);
        }
    }

    /// SLVERR and DECERR on any beat of batches.
    void errorsOfTheMemory() {
        prepare();
        slaves_.behaviour.errorsPer1000 = std::array<unsigned, 4>{1, 20, 200, 1000}[pick(4)];
        for (unsigned i = 0; i < rounds_; ++i) run(true);
        slaves_.behaviour.errorsPer1000 = 0;
        run(false);
    }

    unsigned tail_ = 0;
    std::uint32_t number_ = 0;
};
