// Sequences at the pins of ColonnadeAxi: each abuses the shell in one way, against slaves of one order, then loads the
// scene again and renders a frame, which must be the model's. A sequence has a seed, by which it is run again.
//
// The job has a line for each of these:
//   register NAME ADDRESS WIDTH ACCESS     of the shell; ACCESS is ro, rw or wo
//   device START FIRST END                 addresses of control.start, of the device's registers, and behind them
//   frame ADDRESS VALUE NOISE              a word of the frame's registers; with NOISE 1 it may take any value
//   invalidate ADDRESS                     of control.invalidate, if there are caches: the scene may have changed
//   error ADDRESS                          an error register of the device, 0 after a legal frame
//   image ADDRESS FILE, scene ADDRESS FILE, framebuffer ADDRESS FILE STRIDE
#pragma once
#include <algorithm>
#include <fstream>
#include <iterator>

#include "axi_bench.hpp"

struct SequenceJob {
    struct Register {
        unsigned address = 0, width = 0;
        std::string access;
    };
    struct Word {
        unsigned address = 0;
        std::uint32_t value = 0;
        bool isNoisy = false;
    };
    struct Stored {
        std::uint64_t address = 0;
        std::vector<std::uint8_t> bytes;
        std::uint64_t end() const { return address + bytes.size(); }
    };

    explicit SequenceJob(const std::string& name) {
        std::ifstream lines(name);
        if (!lines) throw std::runtime_error("no job " + name);
        for (std::string kind, text; lines >> kind;) {
            if (kind == "register") {
                lines >> text;
                Register& entry = registers[text];
                lines >> entry.address >> entry.width >> entry.access;
            } else if (kind == "device") lines >> deviceStart >> deviceFirst >> deviceEnd;
            else if (kind == "frame") {
                frame.emplace_back();
                lines >> frame.back().address >> frame.back().value >> frame.back().isNoisy;
            } else if (kind == "error") {
                errors.emplace_back();
                lines >> errors.back();
            } else if (kind == "invalidate") lines >> invalidate;
            else if (kind == "image") read(lines, image);
            else if (kind == "scene") read(lines, scene);
            else if (kind == "framebuffer") {
                read(lines, framebuffer);
                lines >> stride;
            } else throw std::runtime_error("cannot parse: " + kind);
            if (!lines) throw std::runtime_error("cannot parse a line of " + kind);
        }
    }

    static void read(std::istream& lines, Stored& stored) {
        std::string name;
        lines >> stored.address >> name;
        std::ifstream file(name, std::ios::binary);
        if (!file) throw std::runtime_error("no file " + name);
        stored.bytes.assign(std::istreambuf_iterator<char>(file), {});
    }

    std::map<std::string, Register> registers;
    std::vector<Word> frame;
    std::vector<unsigned> errors;
    unsigned deviceStart = 0, deviceFirst = 0, deviceEnd = 0, invalidate = 0;
    unsigned stride = 0;
    Stored image, scene, framebuffer;
};

class Sequences {
public:
    Sequences(const SequenceJob& job, unsigned busBytes, std::size_t memoryBytes) : job_(job), busBytes_(busBytes), clean_(memoryBytes, 0xA5) {
        for (const auto* stored : {&job.image, &job.scene})
            std::copy(stored->bytes.begin(), stored->bytes.end(), clean_.begin() + static_cast<std::ptrdiff_t>(stored->address));
    }

    /// Runs a sequence on a shell of its own, whose power-up state is of the seed, too: the seed alone repeats it.
    void run(std::uint64_t seed) {
        slaves_.random.seed(seed);
        Verilated::randSeed(static_cast<int>(seed % 0x7FFFFFFF) + 1);
        const auto& [name, abuse] = kinds_[seed % kinds_.size()];
        Behaviour& behaviour = slaves_.behaviour;
        behaviour = Behaviour{};
        behaviour.order = static_cast<Order>(seed / kinds_.size() % orders);
        behaviour.stall = std::array<unsigned, 5>{0, 10, 30, 60, 85}[pick(5)];
        behaviour.latency = std::array<unsigned, 4>{0, 5, 40, 200}[pick(4)];
        report_.place = "sequence " + std::to_string(seed) + " (" + name + ", " + orderNames[seed / kinds_.size() % orders] + ")";
        const std::uint64_t before = report_.count;
        try {
            restore();
            Bench bench(slaves_, busBytes_);
            bench_ = &bench;
            (this->*abuse)();
            ++ended_;
            behaviour.errorsPer1000 = 0;
            behaviour.silent = Silent::none;
            restore();
            if (load() != 0) report_.broken("a legal image is refused");
            set();
            if (frameIsRight()) ++exact_;
        } catch (const Hang& hang) { report_.broken(std::string("hang: ") + hang.what()); }
        ++done_;
        failed_ += report_.count != before;
    }

    std::uint64_t failed() const { return failed_; }

    void print() const {
        report_.print();
        std::cout << "sequences " << done_ << " ended " << ended_ << " exact " << exact_ << " violations " << report_.count << " failed " << failed_ << " cycles "
                  << report_.cycle << " bursts " << slaves_.bursts << " accesses " << slaves_.accesses << '\n';
    }

private:
    static constexpr unsigned start_ = 1, load_ = 2, reset_ = 4, okay_ = 0, refused_ = 2;
    static constexpr unsigned running_ = 1, queued_ = 2, loading_ = 4;
    static constexpr std::uint64_t patience_ = 5000000;

    std::uint64_t pick(std::uint64_t end) { return slaves_.below(end); }
    unsigned address(const std::string& name) const { return job_.registers.at(name).address; }

    void expect(bool holds, const char* rule) {
        if (!holds) report_.broken(rule);
    }

    void write(unsigned at, std::uint32_t value) { expect(bench_->write(at, value) == okay_, "a legal write is refused"); }

    void write(const std::string& name, std::uint64_t value) {
        const auto& entry = job_.registers.at(name);
        for (unsigned word = 0; 32 * word < entry.width; ++word) write(entry.address + 4 * word, static_cast<std::uint32_t>(value >> 32 * word));
    }

    std::uint32_t read(unsigned at) {
        const Access access = bench_->read(at);
        expect(access.response == okay_, "a legal read is refused");
        return access.data;
    }
    std::uint32_t read(const std::string& name) { return read(address(name)); }

    /// Writes words without waiting for the answer of the one before.
    void writeAll(const std::vector<std::pair<unsigned, std::uint32_t>>& words) {
        for (const auto& [at, value] : words) bench_->beginWrite(at, value);
        for (const unsigned response : bench_->finish()) expect(response == okay_, "a legal write is refused");
    }

    void setDevice() {
        std::vector<std::pair<unsigned, std::uint32_t>> words;
        for (const auto& word : job_.frame) words.emplace_back(word.address, word.value);
        if (job_.invalidate != 0) words.emplace_back(job_.invalidate, 1);
        writeAll(words);
    }

    /// The memory and the windows of a legal frame.
    void restore() {
        slaves_.memory = clean_;
        slaves_.readable = {{job_.image.address, job_.image.end()}, {job_.scene.address, job_.scene.end()}};
        slaves_.writable = {{job_.framebuffer.address, job_.framebuffer.end()}};
    }

    bool endsWithin(std::uint64_t cycles) {
        for (const std::uint64_t end = report_.cycle + cycles; report_.cycle < end;)
            if (read("status") == 0) return true;
        return false;
    }

    void awaitIdle(const char* what) {
        if (!endsWithin(patience_)) throw Hang(what);
    }

    void softReset() {
        write("control", reset_);
        const std::uint64_t before = slaves_.writtenBeats;
        awaitIdle("a soft reset does not end");
        expect(slaves_.writtenBeats - before <= 2, "bytes are written after a soft reset"); // two beats may have been offered
        expect(bench_->isQuiet(), "a burst is under way after a soft reset");
        for (const auto& word : job_.frame)
            if (read(word.address) != 0) return report_.broken("a register of the device is not 0 after a soft reset");
    }

    void setImage() {
        write("image.base", job_.image.address);
        write("image.windowBase", job_.image.address);
        write("image.windowEnd", job_.image.end());
        write("image.bytes", job_.image.bytes.size());
    }

    /// `image.errors`.
    std::uint32_t load() {
        setImage();
        write("control", load_);
        awaitIdle("a load does not end");
        return read("image.errors");
    }

    void set() {
        setDevice();
        write("framebuffer.base", job_.framebuffer.address);
        write("framebuffer.windowBase", job_.framebuffer.address);
        write("framebuffer.windowEnd", job_.framebuffer.end());
        write("framebuffer.stride", job_.stride);
        write("framebuffer.format", 0);
        bench_->write(address("photo.enabled"), 0); // refused by a shell without maps
    }

    void prepare() {
        load();
        set();
    }

    void render() {
        write("control", start_);
        awaitIdle("a frame does not end");
        expect(bench_->isQuiet(), "a burst is under way after a frame");
    }

    bool framebufferIsRight() const {
        return std::equal(job_.framebuffer.bytes.begin(), job_.framebuffer.bytes.end(), slaves_.memory.begin() + static_cast<std::ptrdiff_t>(job_.framebuffer.address));
    }

    /// Renders a frame that must be the model's, and its interrupt.
    bool frameIsRight() {
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

    /// A channel does not move until it is told otherwise.
    void silence(Silent channel) {
        slaves_.behaviour.silent = channel;
        slaves_.behaviour.silentUntil = ~std::uint64_t{0};
    }

    void begin() { write("control", pick(2) != 0 ? start_ : load_); }

    // The kinds of abuse

    /// SLVERR and DECERR on any beat, in loads and frames.
    void errorsOfTheMemory() {
        prepare();
        slaves_.behaviour.errorsPer1000 = std::array<unsigned, 4>{1, 20, 200, 1000}[pick(4)];
        load();
        set();
        render();
    }

    /// A channel that does not move for a while, also during a soft reset; the registers answer all the while.
    void silentChannel() {
        prepare();
        slaves_.behaviour.silent = static_cast<Silent>(1 + pick(silentChannels));
        slaves_.behaviour.silentUntil = report_.cycle + 3000 + pick(10000);
        begin();
        bench_->cycles(pick(600));
        expect(read("identity") == 0x434C4E44, "registers do not answer while the memory is silent");
        if (pick(2) != 0) softReset();
        awaitIdle("a silent memory that answers again does not end it");
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

    /// A reset at any cycle, also in a soft reset.
    void hardResets() {
        prepare();
        begin();
        bench_->cycles(pick(pick(2) != 0 ? 200 : 4000));
        if (pick(3) == 0) write("control", reset_);
        bench_->hardReset(1 + pick(4));
    }

    /// Commands and settings of an image during a load, which cannot end meanwhile.
    void commandsDuringLoad() {
        setImage();
        silence(Silent::r);
        write("control", load_);
        bench_->cycles(pick(50));
        const std::array<std::pair<unsigned, std::uint32_t>, 4> writes{
            {{address("control"), start_}, {address("control"), load_}, {address("image.base"), 0}, {address("image.bytes"), 1}}};
        for (const auto& [at, value] : writes) expect(bench_->write(at, value) == refused_, "a write during a load is accepted");
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
            {{address("control"), start_}, {address("framebuffer.stride"), job_.stride}, {job_.frame.front().address, job_.frame.front().value}}};
        for (const auto& [at, value] : writes) expect(bench_->write(at, value) == refused_, "a write while a frame is queued is accepted");
        expect(read("status") == (running_ | queued_), "a refused command has an effect");
        slaves_.behaviour.silent = Silent::none;
        awaitIdle("queued frames do not end");
        expect(framebufferIsRight(), "a queued frame differs from the model's");
    }

    /// All that `control` refuses.
    void illegalCommands() {
        for (std::uint32_t value = 0; value < 16; ++value)
            if (value != start_ && value != load_ && value != reset_)
                expect(bench_->write(address("control"), value | static_cast<std::uint32_t>(pick(2)) << 20) == refused_, "an illegal command is accepted");
        expect(bench_->write(job_.deviceStart, 1) == refused_, "control.start of the device is accepted");
        expect(bench_->read(address("control")).response == refused_, "control is read");
    }

    /// Registers that are missing or read-only, parts of words, values that do not fit: no effect.
    void illegalAccesses() {
        const std::uint32_t before = read("framebuffer.stride");
        for (int i = 0; i < 20; ++i) {
            expect(bench_->write(address("framebuffer.stride"), 64, static_cast<unsigned>(pick(15))) == refused_, "a part of a word is written");
            expect(bench_->write(address("framebuffer.stride"), 1u << 24) == refused_, "a value that does not fit is accepted");
            const unsigned missing = pick(2) != 0 ? 0x108 + 4 * static_cast<unsigned>(pick(1000)) : job_.deviceEnd + 4 * static_cast<unsigned>(pick(1000));
            expect(bench_->write(missing, 0) == refused_ && bench_->read(missing).response == refused_, "a missing register is accessed");
            auto entry = std::next(job_.registers.begin(), static_cast<std::ptrdiff_t>(pick(job_.registers.size())));
            if (entry->second.access == "ro") expect(bench_->write(entry->second.address, 0) == refused_, "a read-only register is written");
            if (entry->second.access == "wo") expect(bench_->read(entry->second.address).response == refused_, "a write-only register is read");
        }
        expect(read("framebuffer.stride") == before, "a refused write has an effect");
    }

    /// Any accesses, reads and writes at the same time; then a soft reset.
    void anyAccesses() {
        for (int i = 0; i < 60; ++i) {
            const unsigned at = static_cast<unsigned>(pick(3) != 0 ? pick(0x110) : pick(0x10000)), other = static_cast<unsigned>(pick(0x10000));
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
            const std::uint64_t at = pick(2) != 0 ? pick(std::min<std::uint64_t>(192, damaged.bytes.size())) : pick(damaged.bytes.size());
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

    /// Any values in the registers of a frame, but its size and those of `frame.watchdogCycles` and `dram.page`.
    void noisyRegisters() {
        prepare();
        for (const auto& word : job_.frame)
            if (word.isNoisy && pick(3) == 0) bench_->write(word.address, pick(2) != 0 ? static_cast<std::uint32_t>(slaves_.random()) : word.value ^ 1u << pick(32));
        slaves_.readable = {{0, ~std::uint64_t{0}}};
        write("control", start_);
        awaitIdle("a frame does not end, in spite of the watchdog");
    }

    const std::vector<std::pair<const char*, void (Sequences::*)()>> kinds_{{"errors of the memory", &Sequences::errorsOfTheMemory},
                                                                            {"a silent channel", &Sequences::silentChannel},
                                                                            {"soft resets", &Sequences::softResets},
                                                                            {"hard resets", &Sequences::hardResets},
                                                                            {"commands during a load", &Sequences::commandsDuringLoad},
                                                                            {"queued frames", &Sequences::queuedFrames},
                                                                            {"illegal commands", &Sequences::illegalCommands},
                                                                            {"illegal accesses", &Sequences::illegalAccesses},
                                                                            {"any accesses", &Sequences::anyAccesses},
                                                                            {"a narrow window", &Sequences::narrowWindow},
                                                                            {"ends of the addresses", &Sequences::endsOfTheAddresses},
                                                                            {"a misaligned framebuffer", &Sequences::misalignedFramebuffer},
                                                                            {"a damaged image", &Sequences::damagedImage},
                                                                            {"noisy registers", &Sequences::noisyRegisters}};

    const SequenceJob& job_;
    const unsigned busBytes_;
    Slaves slaves_;
    Report& report_ = slaves_.report;
    Bench* bench_ = nullptr; // of the sequence that runs
    std::vector<std::uint8_t> clean_;
    std::uint64_t done_ = 0, ended_ = 0, exact_ = 0, failed_ = 0;
};

/// Runs sequences of consecutive seeds; prints what was broken, and counts. Ends after ten that broke a rule: hangs take long.
inline int runSequences(const std::string& job, std::map<std::string, unsigned>& options) {
    const SequenceJob parsed(job);
    Sequences sequences(parsed, options["--bus"], options["--memory"]);
    for (unsigned i = 0; i < options["--sequences"] && sequences.failed() < 10; ++i) sequences.run(options["--seed"] + i);
    sequences.print();
    return 0;
}
