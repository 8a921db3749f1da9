// Sequences at the pins of ColonnadeAxi: each abuses the shell in one way, against slaves of one order, then loads the
// scene again and does legal work, whose result must be the model's. A sequence has a seed, by which it is run again.
//
// The job has a line for each of these:
//   register NAME ADDRESS WIDTH ACCESS     of the shell; ACCESS is ro, rw or wo
//   device START FIRST END                 addresses of control.start, of the device's registers, and behind them
//   frame ADDRESS VALUE NOISE              a word of the device's registers; with NOISE 1 it may take any value
//   invalidate ADDRESS                     of control.invalidate, if there are caches: the scene may have changed
//   error ADDRESS                          an error register of the device, 0 after a legal frame
//   image ADDRESS FILE, scene ADDRESS FILE, framebuffer ADDRESS FILE STRIDE
//   rays TAIL HEAD ERRORS FIRST END        of a device for rays: addresses of rays.tail, rays.head and errors.batch;
//                                          its window
//   batch DESCRIPTOR RAYS HITS             files of a batch, whose descriptor has no address
#pragma once
#include <algorithm>
#include <fstream>
#include <functional>
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

    /// A batch of rays, and its hits.
    struct Batch {
        std::vector<std::uint8_t> descriptor, rays, hits;
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
            } else if (kind == "rays") lines >> tail >> head >> batchErrors >> windowBegin >> windowEnd;
            else if (kind == "batch") {
                batches.emplace_back();
                for (auto* part : {&batches.back().descriptor, &batches.back().rays, &batches.back().hits})
                    *part = file(lines);
            } else throw std::runtime_error("cannot parse: " + kind);
            if (!lines) throw std::runtime_error("cannot parse a line of " + kind);
        }
    }

    static std::vector<std::uint8_t> file(std::istream& lines) {
        std::string name;
        lines >> name;
        std::ifstream file(name, std::ios::binary);
        if (!file) throw std::runtime_error("no file " + name);
        return {std::istreambuf_iterator<char>(file), {}};
    }

    static void read(std::istream& lines, Stored& stored) {
        lines >> stored.address;
        stored.bytes = file(lines);
    }

    std::map<std::string, Register> registers;
    std::vector<Word> frame;
    std::vector<unsigned> errors;
    unsigned deviceStart = 0, deviceFirst = 0, deviceEnd = 0, invalidate = 0;
    unsigned stride = 0;
    unsigned tail = 0, head = 0, batchErrors = 0;
    std::uint64_t windowBegin = 0, windowEnd = 0;
    Stored image, scene, framebuffer;
    std::vector<Batch> batches;
};

/// What all sequences share. Kinds of abuse are `kinds_`.
class Sequences {
public:
    virtual ~Sequences() = default;
    Sequences(const SequenceJob& job, unsigned busBytes, std::size_t memoryBytes)
        : job_(job), busBytes_(busBytes), clean_(memoryBytes, 0xA5) {
        for (const auto* stored : {&job.image, &job.scene})
            std::copy(stored->bytes.begin(), stored->bytes.end(),
                      clean_.begin() + static_cast<std::ptrdiff_t>(stored->address));
    }

    /// Runs a sequence on a shell of its own, whose power-up state is also the seed's: the seed repeats it.
    void run(std::uint64_t seed) {
        slaves_.random.seed(seed);
        Verilated::randSeed(static_cast<int>(seed % 0x7FFFFFFF) + 1);
        const auto& [name, abuse] = kinds_[seed % kinds_.size()];
        Behaviour& behaviour = slaves_.behaviour;
        behaviour = Behaviour{};
        behaviour.order = static_cast<Order>(seed / kinds_.size() % orders);
        behaviour.stall = std::array<unsigned, 5>{0, 10, 30, 60, 85}[pick(5)];
        behaviour.latency = std::array<unsigned, 8>{0, 0, 5, 5, 5, 40, 40, 200}[pick(8)];
        report_.place =
            "sequence " + std::to_string(seed) + " (" + name + ", " + orderNames[seed / kinds_.size() % orders] + ")";
        const std::uint64_t before = report_.count;
        try {
            restore();
            Bench bench(slaves_, busBytes_);
            bench_ = &bench;
            abuse();
            ++ended_;
            behaviour.errorsPer1000 = 0;
            behaviour.silent = Silent::none;
            restore();
            if (load() != 0) report_.broken("a legal image is refused");
            if (isRight()) ++exact_;
        } catch (const Hang& hang) { report_.broken(std::string("hang: ") + hang.what()); }
        ++done_;
        failed_ += report_.count != before;
    }

    std::uint64_t failed() const { return failed_; }

    void print() const {
        report_.print();
        std::cout << "sequences " << done_ << " ended " << ended_ << " exact " << exact_ << " violations "
                  << report_.count << " failed " << failed_ << " cycles " << report_.cycle << " bursts "
                  << slaves_.bursts << " accesses " << slaves_.accesses << " batches " << batches_ << '\n';
    }

protected:
    /// Legal work after the abuse and a load; whether its result is the model's.
    virtual bool isRight() = 0;
    /// Loads the scene and sets the registers.
    virtual void prepare() = 0;
    /// Begins work that some abuse interrupts.
    virtual void begin() = 0;
    /// Counts work that has ended.
    virtual void count() {}

    static constexpr unsigned start_ = 1, load_ = 2, reset_ = 4, okay_ = 0, refused_ = 2;
    static constexpr unsigned running_ = 1, queued_ = 2, loading_ = 4;
    static constexpr std::uint64_t patience_ = 5000000;

    std::uint64_t pick(std::uint64_t end) { return slaves_.below(end); }
    unsigned address(const std::string& name) const { return job_.registers.at(name).address; }

    void expect(bool holds, const char* rule) {
        if (!holds) report_.broken(rule);
    }

    void write(unsigned at, std::uint32_t value) {
        expect(bench_->write(at, value) == okay_, "a legal write is refused");
    }

    void write(const std::string& name, std::uint64_t value) {
        const auto& entry = job_.registers.at(name);
        for (unsigned word = 0; 32 * word < entry.width; ++word)
            write(entry.address + 4 * word, static_cast<std::uint32_t>(value >> 32 * word));
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

    /// The memory and the windows of legal work.
    void restore() {
        slaves_.memory = clean_;
        slaves_.readable = {{job_.image.address, job_.image.end()},
                            {job_.scene.address, job_.scene.end()},
                            {job_.windowBegin, job_.windowEnd}};
        slaves_.writable = {{job_.framebuffer.address, job_.framebuffer.end()}, {job_.windowBegin, job_.windowEnd}};
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
        expect(slaves_.writtenBeats - before <= 2,
               "bytes are written after a soft reset"); // two beats may have been offered
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

    /// A channel does not move until it is told otherwise.
    void silence(Silent channel) {
        slaves_.behaviour.silent = channel;
        slaves_.behaviour.silentUntil = ~std::uint64_t{0};
    }

    // Kinds of abuse that all shells have

    /// A channel that does not move for a while, also during a soft reset; the registers answer all the while.
    void silentChannel() {
        prepare();
        slaves_.behaviour.silent = static_cast<Silent>(1 + pick(silentChannels));
        slaves_.behaviour.silentUntil = report_.cycle + 3000 + pick(10000);
        begin();
        bench_->cycles(pick(600));
        expect(read("identity") == 0x434C4E44, "registers do not answer while the memory is silent");
        if (pick(2) != 0) {
            count();
            softReset();
        }
        awaitIdle("a silent memory that answers again does not end it");
        count();
    }

    /// A reset at any cycle, also in a soft reset.
    void hardResets() {
        prepare();
        begin();
        bench_->cycles(pick(pick(2) != 0 ? 200 : 4000));
        count();
        if (pick(3) == 0) write("control", reset_);
        bench_->hardReset(1 + static_cast<unsigned>(pick(4)));
    }

    const SequenceJob& job_;
    const unsigned busBytes_;
    Slaves slaves_;
    Report& report_ = slaves_.report;
    Bench* bench_ = nullptr; // of the sequence that runs
    std::vector<std::uint8_t> clean_;
    std::vector<std::pair<const char*, std::function<void()>>> kinds_;
    std::uint64_t batches_ = 0; // of rays

private:
    std::uint64_t done_ = 0, ended_ = 0, exact_ = 0, failed_ = 0;
};
