// Sequences of a shell that renders: the legal work is a frame.
#pragma once
#include "sequences.hpp"

class FrameSequences final : public Sequences {
public:
    FrameSequences(const SequenceJob& job, unsigned busBytes, std::size_t memoryBytes)
        : Sequences(job, busBytes, memoryBytes) {
        kinds_ = {{"errors of the memory", [this] { errorsOfTheMemory(); }},
                  {"a silent channel", [this] { silentChannel(); }},
                  {"soft resets", [this] { softResets(); }},
                  {"hard resets", [this] { hardResets(); }},
                  {"commands during a load", [this] { commandsDuringLoad(); }},
                  {"queued frames", [this] { queuedFrames(); }},
                  {"illegal commands", [this] { illegalCommands(); }},
                  {"illegal accesses", [this] { illegalAccesses(); }},
                  {"any accesses", [this] { anyAccesses(); }},
                  {"a narrow window", [this] { narrowWindow(); }},
                  {"ends of the addresses", [this] { endsOfTheAddresses(); }},
                  {"a misaligned framebuffer", [this] { misalignedFramebuffer(); }},
                  {"a damaged image", [this] { damagedImage(); }},
                  {"noisy registers", [this] { noisyRegisters(); }}};
    }

private:
    void set() {
        setDevice();
        write("framebuffer.base", job_.framebuffer.address);
        write("framebuffer.windowBase", job_.framebuffer.address);
        write("framebuffer.windowEnd", job_.framebuffer.end());
        write("framebuffer.stride", job_.stride);
        write("framebuffer.format", 0);
        bench_->write(address("photo.enabled"), 0); // refused by a shell without maps
    }

    void prepare() override {
        load();
        set();
    }

    void render() {
        write("control", start_);
        awaitIdle("a frame does not end");
        expect(bench_->isQuiet(), "a burst is under way after a frame");
    }

    bool framebufferIsRight() const {
        return std::equal(job_.framebuffer.bytes.begin(), job_.framebuffer.bytes.end(),
                          slaves_.memory.begin() + static_cast<std::ptrdiff_t>(job_.framebuffer.address));
    }

    /// Renders a frame that must be the model's, and its interrupt.
    bool isRight() override {
        set();
        write("interrupt.status", 7);
        write("interrupt.enable", 1);
        expect(!bench_->interrupt(), "irq is high without an event");
        render();
        expect(bench_->interrupt(), "irq is low after a frame");
        std::uint32_t errors = read("framebuffer.errors");
        for (const unsigned at : job_.errors) errors |= read(at);
        if (errors != 0) report_.broken("a legal frame has an error bit");
        if (!framebufferIsRight()) report_.broken("a frame differs from the model's");
        return errors == 0 && framebufferIsRight();
    }

    void begin() override { write("control", pick(2) != 0 ? start_ : load_); }

    // The kinds of abuse

    /// SLVERR and DECERR on any beat, in loads and frames.
    void errorsOfTheMemory() {
        prepare();
        slaves_.behaviour.errorsPer1000 = std::array<unsigned, 4>{1, 20, 200, 1000}[pick(4)];
        load();
        set();
        render();
    }

    /// A soft reset at any cycle, also in a soft reset.
    void softResets() {
        prepare();
        begin();
        bench_->cycles(pick(pick(2) != 0 ? 200 : 4000));
        if (pick(3) == 0) {
            write("control", reset_);
            bench_->cycles(pick(30));
        }
        softReset();
    }

    /// Commands and settings of an image during a load, which cannot end meanwhile.
    void commandsDuringLoad() {
        setImage();
        silence(Silent::r);
        write("control", load_);
        bench_->cycles(pick(50));
        const std::array<std::pair<unsigned, std::uint32_t>, 4> writes{{{address("control"), start_},
                                                                        {address("control"), load_},
                                                                        {address("image.base"), 0},
                                                                        {address("image.bytes"), 1}}};
        for (const auto& [at, value] : writes)
            expect(bench_->write(at, value) == refused_, "a write during a load is accepted");
        expect(read("status") == loading_, "a refused command has an effect");
        slaves_.behaviour.silent = Silent::none;
        awaitIdle("a load does not end");
        expect(read("image.errors") == 0, "a load is disturbed by refused commands");
    }

    /// A frame that is queued behind another, which cannot end meanwhile, and a third one.
    void queuedFrames() {
        prepare();
        silence(Silent::b);
        write("control", start_);
        setDevice();
        write("control", start_);
        const std::array<std::pair<unsigned, std::uint32_t>, 3> writes{
            {{address("control"), start_},
             {address("framebuffer.stride"), job_.stride},
             {job_.frame.front().address, job_.frame.front().value}}};
        for (const auto& [at, value] : writes)
            expect(bench_->write(at, value) == refused_, "a write while a frame is queued is accepted");
        expect(read("status") == (running_ | queued_), "a refused command has an effect");
        slaves_.behaviour.silent = Silent::none;
        awaitIdle("queued frames do not end");
        expect(framebufferIsRight(), "a queued frame differs from the model's");
    }

    /// All that `control` refuses.
    void illegalCommands() {
        for (std::uint32_t value = 0; value < 16; ++value)
            if (value != start_ && value != load_ && value != reset_)
                expect(bench_->write(address("control"), value | static_cast<std::uint32_t>(pick(2)) << 20) == refused_,
                       "an illegal command is accepted");
        expect(bench_->write(job_.deviceStart, 1) == refused_, "control.start of the device is accepted");
        expect(bench_->read(address("control")).response == refused_, "control is read");
    }

    /// Registers that are missing or read-only, parts of words, values that do not fit: no effect.
    void illegalAccesses() {
        const std::uint32_t before = read("framebuffer.stride");
        for (int i = 0; i < 20; ++i) {
            expect(bench_->write(address("framebuffer.stride"), 64, static_cast<unsigned>(pick(15))) == refused_,
                   "a part of a word is written");
            expect(bench_->write(address("framebuffer.stride"), 1u << 24) == refused_,
                   "a value that does not fit is accepted");
            const unsigned missing = pick(2) != 0 ? 0x108 + 4 * static_cast<unsigned>(pick(1000))
                                                  : job_.deviceEnd + 4 * static_cast<unsigned>(pick(1000));
            expect(bench_->write(missing, 0) == refused_ && bench_->read(missing).response == refused_,
                   "a missing register is accessed");
            auto entry = std::next(job_.registers.begin(), static_cast<std::ptrdiff_t>(pick(job_.registers.size())));
            if (entry->second.access == "ro")
                expect(bench_->write(entry->second.address, 0) == refused_, "a read-only register is written");
            if (entry->second.access == "wo")
                expect(bench_->read(entry->second.address).response == refused_, "a write-only register is read");
        }
        expect(read("framebuffer.stride") == before, "a refused write has an effect");
    }

    /// Any accesses, reads and writes at the same time; then a soft reset.
    void anyAccesses() {
        for (int i = 0; i < 60; ++i) {
            const unsigned at = static_cast<unsigned>(pick(3) != 0 ? pick(0x110) : pick(0x10000)),
                           other = static_cast<unsigned>(pick(0x10000));
            if (at / 4 == address("control") / 4) continue; // a command: the other kinds give them
            if (at / 4 == job_.deviceStart / 4) continue;
            const auto value = static_cast<std::uint32_t>(pick(3) != 0 ? slaves_.random() : pick(8));
            switch (pick(3)) {
            case 0: bench_->write(at, value, pick(4) != 0 ? 15 : static_cast<unsigned>(pick(16))); break;
            case 1: bench_->read(at); break;
            default:
                bench_->beginWrite(at, value);
                bench_->beginRead(other);
                bench_->beginWrite(other == address("control") || other == job_.deviceStart ? at : other, value);
                bench_->finish();
            }
        }
        softReset();
    }

    /// A framebuffer that leaves its window.
    void narrowWindow() {
        prepare();
        const std::uint64_t first = job_.framebuffer.address + pick(600), end = first + pick(900);
        write("framebuffer.base", job_.framebuffer.address + 64 * pick(40));
        write("framebuffer.windowBase", first);
        write("framebuffer.windowEnd", end);
        write("framebuffer.stride", 64 * (1 + pick(8)));
        write("framebuffer.format", pick(3));
        slaves_.writable = {{first, end}};
        render();
    }

    /// A framebuffer at the first and at the last address: nothing wraps around.
    void endsOfTheAddresses() {
        prepare();
        constexpr std::uint64_t last = (std::uint64_t{1} << 40) - 1;
        write("framebuffer.base", pick(2) != 0 ? (last - pick(0x1000)) / 64 * 64 : 0);
        const std::uint64_t first = pick(2) != 0 ? 0 : last - 0xFFFF, end = pick(2) != 0 ? last : 0x1000;
        write("framebuffer.windowBase", first);
        write("framebuffer.windowEnd", end);
        write("framebuffer.stride", pick(4) != 0 ? 64 * (1 + pick(8)) : (1u << 24) - 64);
        slaves_.writable = {{first, end}};
        render();
    }

    /// A framebuffer at any address, in any format: refused frames write nothing.
    void misalignedFramebuffer() {
        prepare();
        slaves_.writable = {{0, clean_.size()}};
        const std::uint64_t base = job_.framebuffer.address + pick(64);
        const unsigned stride = static_cast<unsigned>(pick(4096)), format = static_cast<unsigned>(pick(4));
        write("framebuffer.base", base);
        write("framebuffer.windowEnd", clean_.size());
        write("framebuffer.stride", stride);
        write("framebuffer.format", format);
        const std::vector<std::uint8_t> before = slaves_.memory;
        render();
        const std::uint32_t errors = read("framebuffer.errors");
        if (format == 3) expect(errors & 8, "an illegal format is not refused");
        if (errors & 12) expect(before == slaves_.memory, "a refused frame is written");
    }

    /// Damaged images and scenes: a load ends, and so does a frame of what was loaded, if need be by the watchdog.
    void damagedImage() {
        for (std::uint64_t i = 0, damages = 1 + pick(4); i < damages; ++i) {
            const auto& damaged = pick(2) != 0 && !job_.scene.bytes.empty() ? job_.scene : job_.image;
            const std::uint64_t at =
                pick(2) != 0 ? pick(std::min<std::uint64_t>(192, damaged.bytes.size())) : pick(damaged.bytes.size());
            slaves_.memory[damaged.address + at] ^= static_cast<std::uint8_t>(1u << pick(8));
        }
        setImage();
        if (pick(4) == 0) write("image.bytes", 128 * pick(1 + job_.image.bytes.size() / 128));
        if (pick(4) == 0) write("image.windowEnd", job_.image.end() - pick(512));
        if (pick(4) == 0) write("image.base", job_.image.address + pick(1024));
        write("control", load_);
        awaitIdle("a load of a damaged image does not end");
        set();
        slaves_.readable = {{0, ~std::uint64_t{0}}};
        write("control", start_);
        awaitIdle("a frame does not end, in spite of the watchdog");
    }

    /// Any values in the registers of a frame, but its size, `frame.watchdogCycles` and `dram.page`.
    void noisyRegisters() {
        prepare();
        for (const auto& word : job_.frame)
            if (word.isNoisy && pick(3) == 0)
                bench_->write(word.address, pick(2) != 0 ? static_cast<std::uint32_t>(slaves_.random())
                                                         : word.value ^ 1u << pick(32));
        slaves_.readable = {{0, ~std::uint64_t{0}}};
        write("control", start_);
        awaitIdle("a frame does not end, in spite of the watchdog");
    }
};
